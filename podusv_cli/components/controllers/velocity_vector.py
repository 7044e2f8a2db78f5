"""Steers the velocity vector, not the bow: constant-bearing guidance with observed loads.

The bow is turned until the velocity that results, with the sway that the hull settles to, is the
wanted one. Source: ours, on the guidance of Breivik and Fossen (see `constant_bearing`).

Proved: no offset in a steady state off the limits, whatever vessel it was told; the position error
is bounded if the velocity error is. Not proved: that it comes to the steady state; docs/theory.md
has eigenvalues, docs/laws/velocity_vector.md the derivation. Anti-windup: the observer knows the
loads that act.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

from podusv_cli.components import rules as by
from podusv_cli.components.controllers.constant_bearing import Moving, approach, turn_rate
from podusv_cli.components.controllers.observer import B_R, B_V, observe
from podusv_cli.components.controllers.velocity_loop import Axis
from podusv_cli.components.controllers.velocity_steering import (
    VelocitySteering,
    Wanted,
    aim,
    surge_demand,
)
from podusv_cli.components.vessels.plant import sway_force, yaw_moment
from podusv_cli.core.component import Rule, Ruled, value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel


# x (6) state, target (6). rate_x and rate_y [m/s] are how the distance to the target changes.
# Returns V_c along and across the bow, its surge rate, its turn, and whether it points back.
@kernel
def guidance(x: Vector, target: Vector, k: Any) -> Wanted:
    """V_c and its rate, as the hull sees them."""
    cos_psi, sin_psi = cos_sin(x[2])
    rate_x = target[2] - (x[3] * cos_psi - x[4] * sin_psi)
    rate_y = target[3] - (x[3] * sin_psi + x[4] * cos_psi)
    e = Moving(target[0] - x[0], target[1] - x[1], rate_x, rate_y)
    V = approach(e, Moving(target[2], target[3], target[4], target[5]), k)
    return Wanted(
        V.x * cos_psi + V.y * sin_psi,
        V.y * cos_psi - V.x * sin_psi,
        V.rate_x * cos_psi + V.rate_y * sin_psi,
        min(max(turn_rate(V, k.V_m), -k.chi_m), k.chi_m),
        V.x * target[2] + V.y * target[3] < 0.0 < target[2] * cos_psi + target[3] * sin_psi,
    )


# v and a [m/s] are sway and wanted surge, turn in rad/s; memory has the observed loads.
@kernel
def settled_sway(v: float, a: float, turn: float, memory: Vector, k: Any) -> float:
    """The sway velocity T_v ahead, at the wanted surge velocity and turn.

    With a thrust lever the steady moment -(f_r + b_r) brings the sway force (f_r + b_r)/lever.
    """
    across = sway_force(a, v, turn, k) + memory[B_V]
    if k.thrust_lever > 0.0:
        across += (yaw_moment(a, v, turn, k) + memory[B_R]) / k.thrust_lever
    return float(v + k.T_v * across / k.m22)


class VelocityVector(VelocitySteering):
    """Turns the vector of velocity over ground to the target and keeps it there."""

    kind: Literal["velocity_vector"] = "velocity_vector"
    rules: ClassVar[dict[str, Rule]] = VelocitySteering.rules | {
        "k_psi": by.YAW,
        "k_r": by.YAW,
        "T_v": by.YAW_TIME,
        "chi_m": by.TURN,
    }
    k_psi: Ruled = value(1.3, "1/s", "gain of the angle", gt=0)
    k_r: Ruled = value(1.3, "1/s", "gain of the yaw rate", gt=0)
    T_v: Ruled = value(5.0, "s", "time over which the sway velocity is predicted", ge=0)
    chi_m: Ruled = value(0.3, "rad/s", "largest turn of the wanted velocity used ahead", gt=0)

    def steering(self) -> tuple[str, float]:
        """Key and gain [1/s] with which it turns the hull."""
        return "k_psi", self.k_psi

    def axis_gains(self, axes: tuple[Axis, Axis]) -> tuple[tuple[str, float, float], ...]:
        """Key, gain [1/s] and observer's bandwidth [rad/s] of surge and yaw.

        The gains have the parts of A and of the angle's rate that act on the velocities.
        """
        surge, yaw = self.k_u + self.k_p, self.k_r + self.k_psi
        return ("k_u", surge, self.omega_u), ("k_r", yaw, self.omega_r)

    # x (6), memory and rate (6), target (6); writes tau (2) [N, N m], rate and signals (4). r_d
    # levels off at r_m for large angles; its derivative by chi_e has the third power of sigma. Near
    # rest the angle counts for less, since its direction is uncertain. `yaw` [rad/s2] is the yaw
    # acceleration that is asked for.
    @staticmethod
    @kernel
    def law(
        x: Vector,
        memory: Vector,
        target: Vector,
        k: Any,
        tau: Vector,
        rate: Vector,
        signals: Vector,
    ) -> None:
        """Yaw first: turn the velocity vector; surge as far as it points the right way."""
        wanted = guidance(x, target, k)
        u, v, r, turn = x[3], x[4], x[5], wanted.turn
        v_s = settled_sway(v, wanted.a, turn, memory, k)
        at = aim(wanted, v_s, k)
        g = k.k_psi * min(1.0, at.speed * at.speed / (k.V_m * k.V_m))
        bend = k.k_psi * at.chi_e / k.r_m
        sigma = 1.0 / math.sqrt(1.0 + bend * bend)
        r_d = g * at.chi_e * sigma + turn
        yaw = g * sigma * sigma * sigma * (turn - r) + k.k_r * (r_d - r)
        tau[1] = k.m33 * yaw - yaw_moment(u, v, r, k) - memory[B_R]
        signals[0] = surge_demand(x, memory, wanted, at, k, tau)
        signals[1], signals[2], signals[3] = r_d, v_s, at.chi_e
        observe(x, memory, tau, k, rate)
