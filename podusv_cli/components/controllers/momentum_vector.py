"""Steers the velocity vector by the momentum of the hull's neutral point, which no moment changes.

As `velocity_vector`, for hulls whose sway answers yaw strongly too: of the sway velocity the part
that the loads cause counts in full, and of the part that yaw causes only as much as the loop bears.
Source: ours, on the guidance of Breivik and Fossen (see `constant_bearing`).

Proved: no offset in a steady state off the limits, for a told hull whose sway damping grows with
sway; the linear loop on a straight line, told exactly, has the polynomial of docs/theory.md. Not
proved: that it comes to the steady state from afar, nor the loop with what it learns. Anti-windup:
the observer is told the loads that act.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

from podusv_cli.components import rules as by
from podusv_cli.components.controllers.base import Slots, each
from podusv_cli.components.controllers.momentum_adaptation import LEARNT, MORE, adapt, answer_force
from podusv_cli.components.controllers.momentum_guidance import guidance, level_gain, see_target
from podusv_cli.components.controllers.momentum_schedule import (
    neutral,
    pace,
    pace_constants,
    schedule,
    sway_answer,
)
from podusv_cli.components.controllers.observer import B_R, B_V, V_HAT, observe
from podusv_cli.components.controllers.velocity_loop import Axis
from podusv_cli.components.controllers.velocity_steering import VelocitySteering, aim, surge_demand
from podusv_cli.components.vessels.plant import sway_force, yaw_moment
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import Rule, Ruled, value
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal

LOAD_SWAY = 6  # position in the memory, behind the observer
V_L = Signal("v_l", "m/s", "sway velocity that the loads and the target's turn cause", "v_l")


# a and v_l [m/s] are surge and sway, turn in rad/s, memory has the observed loads; in m/s2.
@kernel
def load_sway_rate(a: float, v_l: float, turn: float, memory: Vector, k: Any) -> float:
    """v_l': the sway of a hull that keeps to the target's turn under the observed loads."""
    across = sway_force(a, v_l, turn, k) + memory[B_V] + answer_force(turn, memory, k)
    across += k.per_lever * (yaw_moment(a, v_l, turn, k) + memory[B_R])
    return float(across / k.neutral_mass)


# x (6) state; memory has the observed loads.
@kernel
def moment_for(alpha: float, x: Vector, memory: Vector, k: Any) -> float:
    """The yaw moment [N m] for r' = alpha [rad/s2] under the observed loads.

    Sway follows by the full mass matrix, and by the sway force of a moment with a thrust lever.
    """
    u, v, r = x[3], x[4], x[5]
    across = sway_force(u, v, r, k) + memory[B_V] + answer_force(r, memory, k)
    sway_rate = (across - k.m23 * alpha) / k.m22
    moment = k.m33 * alpha + k.m32 * sway_rate - yaw_moment(u, v, r, k) - memory[B_R]
    return float(moment * k.m22 / k.neutral_mass)


class MomentumVector(VelocitySteering):
    """Turns the velocity vector to the target, with as much of the sway as the loop bears."""

    kind: Literal["momentum_vector"] = "momentum_vector"
    rules: ClassVar[dict[str, Rule]] = VelocitySteering.rules | {
        "Q0": by.YAW_SQUARED,
        "S0": by.YAW,
        "k_b0": by.PACE,
        "T_v": by.YAW_TIME,
        "gamma": by.YAW,
    }
    omega_u: Ruled = value(5.0, "rad/s", "bandwidth of the observer in surge", gt=0)
    omega_v: Ruled = value(3.0, "rad/s", "bandwidth of the observer in sway", gt=0)
    omega_r: Ruled = value(0.9, "rad/s", "bandwidth of the observer in yaw", gt=0)
    Q0: Ruled = value(7.5, "1/s2", "gain of the angle", gt=0)
    S0: Ruled = value(4.4, "1/s", "gain of the yaw rate", gt=0)
    k_b0: Ruled = value(0.5, "1/s", "largest gain of the distance across the path", gt=0)
    T_v: Ruled = value(1.8, "s", "time over which the loads' sway is predicted", ge=0)
    trust: float = value(
        1.25,
        "",
        "how many times as much as told sway may answer yaw; more is safer and slower",
        ge=1,
    )
    gamma: Ruled = value(
        0.2, "1/s", "how fast it learns by how much more sway answers yaw; 0: never", ge=0
    )

    def slots(self) -> Slots:
        """The memory: the observer's, the loads' sway, and what is learnt of sway's answer."""
        return super().slots() + each((V_L, *LEARNT))

    def start(self, x: Vector, target: Vector, nominal: Vessel) -> Vector:
        """The memory: velocities as they are, no loads; the sway is taken for that of the loads."""
        memory = super().start(x, target, nominal)
        memory[LOAD_SWAY] = memory[V_HAT]
        return memory

    def constants_with(self, nominal: Vessel) -> dict[str, float]:
        """The constants, with neutral point, gains at its pace and the yaw rate N_m allows."""
        own = neutral(nominal, self.thrust_lever)
        own |= pace_constants(nominal.m33, self.N_m, self.Q0, self.S0)
        own["fastest"] = min(self.r_m, math.sqrt(self.N_m / nominal.m33))
        return super().constants_with(nominal) | own

    def steering(self) -> tuple[str, float]:
        """Key and gain [1/s] with which it turns the hull: Q0 over S0."""
        return "Q0", self.Q0 / self.S0

    def axis_gains(self, axes: tuple[Axis, Axis]) -> tuple[tuple[str, float, float], ...]:
        """Key, gain [1/s] and observer's bandwidth [rad/s] of surge and yaw.

        With the part of A that acts on the surge velocity; S is slower where N_m is small.
        """
        S = self.S0 * pace(axes[1].told, self.N_m, self.Q0)
        return ("k_u", self.k_u + self.k_p, self.omega_u), ("S0", S, self.omega_r)

    # x (6), memory and rate (10), target (6); writes tau (2) [N, N m], rate and signals (4). The
    # wanted speed V sets the schedule, so it is formed with the gain along the course before the
    # gain across is known. v_s is the sway that the bow is aimed with; `bend` lets the yaw rate
    # level off at `fastest`.
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
        """Yaw first, as far as sway bears it; surge as far as the velocity points the right way."""
        at, v, r, v_l = see_target(x, target, k), x[4], x[5], memory[LOAD_SWAY]
        closing = at.e_a * (at.t_a - x[3]) + at.e_b * (at.t_b - v)
        along = level_gain(at.k_p, at, closing)
        V_a, V_b = at.t_a + along.kappa * at.e_a, at.t_b + along.kappa * at.e_b
        V = max(math.sqrt(V_a * V_a + V_b * V_b), k.V_m)
        more = memory[MORE] * k.m22 / k.neutral_mass
        gains = schedule(sway_answer(V, v, v_l, at.turn, more, k), k)
        wanted = guidance(x, at, along, min(gains.k_b, at.k_p), k)

        v_l_rate = load_sway_rate(wanted.a, v_l, at.turn, memory, k)
        v_s = v_l + gains.eta * (v + k.x_n * (r - at.turn) - v_l) + k.T_v / k.pace * v_l_rate
        bow = aim(wanted, v_s, k)
        g = min(1.0, bow.speed / k.V_m)
        bend = k.Q_per_S * bow.chi_e / k.fastest
        r_d = g * k.Q_per_S * bow.chi_e / math.sqrt(1.0 + bend * bend) + at.turn
        tau[1] = moment_for(k.S * (r_d - r), x, memory, k)
        signals[0] = surge_demand(x, memory, wanted, bow, k, tau)
        signals[1], signals[2], signals[3] = r_d, v_s, bow.chi_e
        observe(x, memory, tau, k, rate)
        rate[LOAD_SWAY] = v_l_rate
        adapt(x, memory, k, rate)
