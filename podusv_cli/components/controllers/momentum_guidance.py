"""The velocity that momentum_vector wants: one gain along the target's course, another across it.

Constant-bearing guidance (see `constant_bearing`), all in the body frame.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from podusv_cli.components.controllers.constant_bearing import Moving, approach_speed, turn_rate
from podusv_cli.components.controllers.momentum_schedule import resting_gain
from podusv_cli.components.controllers.velocity_steering import Wanted
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel


class Seen(NamedTuple):
    """The target in the body frame."""

    e_a: float  # ahead [m]
    e_b: float  # to starboard [m]
    t_a: float  # its velocity over ground [m/s]
    t_b: float
    t_a_rate: float  # surge part of its acceleration [m/s2]
    turn: float  # rate of its course [rad/s]
    s_max: float  # speed with which the vessel can approach it [m/s]
    k_p: float  # gain of the distance [1/s], smaller near a target that rests


class LevelledGain(NamedTuple):
    """A gain that levels off with the distance, and its rate."""

    kappa: float  # 1/s
    rate: float  # 1/s2


# x (6) state, target (6), both over ground. The distance's own rates are not needed here, so they
# are 0.
@kernel
def see_target(x: Vector, target: Vector, k: Any) -> Seen:
    """Distance, velocity and acceleration of the target along and across the bow."""
    c, s = cos_sin(x[2])
    e_x, e_y = target[0] - x[0], target[1] - x[1]
    e, V_d = Moving(e_x, e_y, 0.0, 0.0), Moving(target[2], target[3], target[4], target[5])
    return Seen(
        e_x * c + e_y * s,
        e_y * c - e_x * s,
        V_d.x * c + V_d.y * s,
        V_d.y * c - V_d.x * s,
        V_d.rate_x * c + V_d.rate_y * s,
        turn_rate(V_d, k.V_m),
        approach_speed(e, V_d, k.U),
        resting_gain(math.sqrt(e_x * e_x + e_y * e_y), math.sqrt(V_d.x * V_d.x + V_d.y * V_d.y), k),
    )


# gain [1/s]; kappa e is gain times a short distance, and s_max at a long one.
@kernel
def level_gain(gain: float, at: Seen, closing: float) -> LevelledGain:
    """kappa = gain/sqrt(1 + (gain |e|/s_max)^2); `closing` is e.e' [m2/s]."""
    slope = (gain / at.s_max) * (gain / at.s_max)
    q2 = 1.0 / (1.0 + slope * (at.e_a * at.e_a + at.e_b * at.e_b))
    kappa = gain * math.sqrt(q2)
    return LevelledGain(kappa, -kappa * q2 * slope * closing)


# x (6) state, `at` the target as `see_target` sees it, k_b [1/s]; of k only V_m [m/s] is read. The
# ends _a and _b are ahead and to starboard. d [m/s] is the target's velocity less the vessel's, the
# rate of the distance e. T [m] is the part of e along the target's course: with the bow's unit
# vector n, T = (t t^T + V_m^2 n n^T) e/(|t|^2 + V_m^2), so near rest the bow stands for the course.
# V_c = t + kappa_across e + (kappa_along - kappa_across) T. Its rate takes that projection as
# constant, and its turn is that of the target's course alone.
@kernel
def guidance(x: Vector, at: Seen, along: LevelledGain, k_b: float, k: Any) -> Wanted:
    """V_c and its surge rate: the gain k_b across the target's course, and `along` along it.

    Where the target is slower than V_m the course gives way to the bow.
    """
    d_a, d_b = at.t_a - x[3], at.t_b - x[4]
    across = level_gain(k_b, at, at.e_a * d_a + at.e_b * d_b)
    bow = k.V_m * k.V_m
    per = 1.0 / (at.t_a * at.t_a + at.t_b * at.t_b + bow)
    dot, rate = at.t_a * at.e_a + at.t_b * at.e_b, at.t_a * d_a + at.t_b * d_b
    T_a, T_b = (at.t_a * dot + bow * at.e_a) * per, at.t_b * dot * per
    T_a_rate = (at.t_a * rate + bow * d_a) * per
    more, more_rate = along.kappa - across.kappa, along.rate - across.rate
    a = at.t_a + across.kappa * at.e_a + more * T_a
    b = at.t_b + across.kappa * at.e_b + more * T_b
    A_a = at.t_a_rate + across.kappa * d_a + across.rate * at.e_a
    A_a += more * T_a_rate + more_rate * T_a
    return Wanted(a, b, A_a, at.turn, a * at.t_a + b * at.t_b < 0.0 < at.t_a)
