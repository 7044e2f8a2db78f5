"""Steers the velocity vector, not the bow: constant-bearing guidance with observed loads.

The bow is turned until the velocity that results, with the sway that the hull settles to, is the
wanted one. Source: ours, on the guidance of Breivik and Fossen (see `constant_bearing`).

Proved: no offset in a steady state off the limits, whatever vessel it was told; the position error
is bounded if the velocity error is. Not proved: that it comes to the steady state; docs/theory.md
has eigenvalues, docs/laws.md the derivation. Anti-windup: the observer is told the loads that act.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal, NamedTuple

from podusv_cli.components.controllers.constant_bearing import Moving, approach, turn_rate
from podusv_cli.components.controllers.observer import B_R, B_U, B_V, ObservingController, observe
from podusv_cli.components.vessels.plant import surge_force, sway_force, yaw_moment
from podusv_cli.core.component import Positive, value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.kinematics import direction
from podusv_cli.core.signal import Signal

SHORTER = 1.0


class Wanted(NamedTuple):
    """The wanted velocity V_c in the body frame, its surge acceleration and its turn."""

    a: float  # surge part of V_c [m/s]
    b: float  # sway part of V_c [m/s]
    A_a: float  # surge part of its rate A [m/s2]
    turn: float  # rate of the direction of V_c [rad/s], limited
    backward: bool  # whether V_c points against the target's course, and the bow does not


@kernel
def guidance(x: Vector, target: Vector, k: Any) -> Wanted:
    """V_c and its rate, as the hull sees them."""
    cos_psi, sin_psi = cos_sin(x[2])
    rate_x = target[2] - (x[3] * cos_psi - x[4] * sin_psi)
    rate_y = target[3] - (x[3] * sin_psi + x[4] * cos_psi)
    e = Moving(target[0] - x[0], target[1] - x[1], rate_x, rate_y)
    V = approach(e, Moving(target[2], target[3], target[4], target[5]), k)
    return Wanted(
        V.x * cos_psi + V.y * sin_psi, V.y * cos_psi - V.x * sin_psi,
        V.rate_x * cos_psi + V.rate_y * sin_psi,
        min(max(turn_rate(V, k.V_m), -k.chi_m), k.chi_m),
        V.x * target[2] + V.y * target[3] < 0.0 < target[2] * cos_psi + target[3] * sin_psi,
    )  # fmt: skip


@kernel
def settled_sway(v: float, a: float, turn: float, memory: Vector, k: Any) -> float:
    """The sway velocity T_v ahead, at the wanted surge velocity and turn.

    With a thrust lever the steady moment -(f_r + b_r) brings the sway force (f_r + b_r)/lever.
    """
    across = sway_force(a, v, turn, k) + memory[B_V]
    if k.thrust_lever > 0.0:
        across += (yaw_moment(a, v, turn, k) + memory[B_R]) / k.thrust_lever
    return float(v + k.T_v * across / k.m22)


class VelocityVector(ObservingController):
    """Turns the vector of velocity over ground to the target and keeps it there."""

    kind: Literal["velocity_vector"] = "velocity_vector"
    signals: ClassVar[tuple[Signal, ...]] = (
        Signal("u_d", "m/s", "wanted surge velocity"),
        Signal("r_d", "rad/s", "wanted yaw rate"),
        Signal("v_s", "m/s", "sway velocity that the hull settles to, predicted"),
        Signal(
            "chi_e", "rad", "angle that the velocity vector has to turn by", r"\chi_e", wrapped=True
        ),
    )
    no_gains: ClassVar[tuple[str, ...]] = ("thrust_lever",)  # where the pods are
    k_p: float = value(0.5, "1/s", "gain of the distance, near the target", gt=0)
    U: float = value(1.25, "m/s", "largest wanted speed, about 1.2 times that at full thrust", gt=0)
    k_psi: float = value(1.3, "1/s", "gain of the angle", gt=0)
    r_m: float = value(1.4, "rad/s", "yaw rate that a large angle approaches", gt=0)
    k_u: float = value(0.75, "1/s", "gain of the surge velocity", gt=0)
    k_r: float = value(1.3, "1/s", "gain of the yaw rate", gt=0)
    T_v: float = value(5.0, "s", "time over which the sway velocity is predicted", ge=0)
    V_m: float = value(0.1, "m/s", "speed below which a direction counts for less", gt=0)
    chi_m: float = value(0.3, "rad/s", "largest turn of the wanted velocity used ahead", gt=0)
    a_m: float = value(1.0, "m/s2", "largest wanted acceleration used ahead", gt=0)
    astern: Literal["never", "shorter"] = value(
        "shorter", "", "what a vessel ahead of the target does: turns round, and again when it is "
        "there (never), or backs up if its bow points to the target's course (shorter)",
    )  # fmt: skip
    thrust_lever: Positive | None = value(
        None, "m", "distance behind the origin at which the pods turn, whose sway force makes the "
        "moment; none where the moment comes without a sway force",
    )  # fmt: skip
    N_m: float = value(2.5, "N m", "moment beyond which surge yields to yaw", gt=0)

    def gains(self) -> tuple[tuple[str, float, float], ...]:
        """With the parts of A and of the angle's rate that act on the velocities."""
        surge, yaw = self.k_u + self.k_p, self.k_r + self.k_psi
        return ("k_u", surge, self.omega_u), ("k_r", yaw, self.omega_r)

    @staticmethod
    @kernel
    def law(
        x: Vector, memory: Vector, target: Vector, k: Any, tau: Vector, rate: Vector,
        signals: Vector,
    ) -> None:  # fmt: skip
        """Yaw first: turn the velocity vector; surge as far as it points the right way."""
        wanted = guidance(x, target, k)
        a, b, A_a, turn = wanted.a, wanted.b, wanted.A_a, wanted.turn
        u, v, r = x[3], x[4], x[5]
        v_s = settled_sway(v, a, turn, memory, k)
        w = b - v_s
        speed = math.sqrt(a * a + w * w)
        side = -1.0 if wanted.backward and a < 0.0 and k.astern == SHORTER else 1.0
        chi_e = direction(side * a, side * w)
        g = k.k_psi * min(1.0, speed * speed / (k.V_m * k.V_m))
        bend = k.k_psi * chi_e / k.r_m
        sigma = 1.0 / math.sqrt(1.0 + bend * bend)
        r_d = g * chi_e * sigma + turn
        yaw = g * sigma * sigma * sigma * (turn - r) + k.k_r * (r_d - r)
        tau[1] = k.m33 * yaw - yaw_moment(u, v, r, k) - memory[B_R]

        forward = side * a / speed if side * a > 0.0 and speed > 0.0 else 1.0
        F = forward * k.N_m / max(abs(tau[1]), k.N_m)
        u_d = a * F
        ahead = min(max((A_a + r * b) * F, -k.a_m), k.a_m)
        tau[0] = k.m11 * (ahead + k.k_u * (u_d - u)) - surge_force(u, v, r, k) - memory[B_U]
        signals[0], signals[1], signals[2], signals[3] = u_d, r_d, v_s, chi_e
        observe(x, memory, tau, k, rate)
