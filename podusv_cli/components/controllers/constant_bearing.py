"""Constant-bearing guidance with an approach speed that a vessel can reach.

Source: M. Breivik and T. I. Fossen, "Guidance laws for planar motion control", IEEE CDC (2008),
570-577: the target's velocity plus U_a |e|/sqrt(|e|^2 + D^2) towards it. Here U_a = s_max changes
with the target's velocity, and D = s_max/k_p.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from podusv_cli.core.kernel import kernel

NEARS = 0.05  # m/s; the least speed at which a law approaches


class Moving(NamedTuple):
    """A vector over ground and its rate, both north and east."""

    x: float
    y: float
    rate_x: float
    rate_y: float


# e [m] to the target, V_d [m/s] its velocity, U [m/s]. What U leaves beside the target's velocity
# across the line of sight, less that along it; a faster target is neared at NEARS.
@kernel
def approach_speed(e: Moving, V_d: Moving, U: float) -> float:
    """s_max [m/s]: with it towards the target the vessel moves at U over ground."""
    squared = e.x * e.x + e.y * e.y
    per = 1.0 / math.sqrt(squared) if squared > 0.0 else 0.0
    along = (V_d.x * e.x + V_d.y * e.y) * per
    across = (V_d.x * e.y - V_d.y * e.x) * per
    return max(math.sqrt(max(U * U - across * across, 0.0)) - along, NEARS)


# kappa e is s_max far away and k_p e near; `fall` is what kappa's rate leaves out of it, with s_max
# taken as constant.
@kernel
def approach(e: Moving, V_d: Moving, k: Any) -> Moving:
    """V_c = p_d' + kappa e and its rate; |V_c| stays below U if the target is slower.

    `e` is where the target is from here [m], `V_d` its velocity [m/s].
    """
    squared = e.x * e.x + e.y * e.y
    s_max = approach_speed(e, V_d, k.U)
    slope = (k.k_p / s_max) * (k.k_p / s_max)
    q2 = 1.0 / (1.0 + slope * squared)
    kappa = k.k_p * math.sqrt(q2)
    fall = kappa * q2 * slope * (e.x * e.rate_x + e.y * e.rate_y)
    return Moving(
        V_d.x + kappa * e.x,
        V_d.y + kappa * e.y,
        V_d.rate_x + kappa * e.rate_x - fall * e.x,
        V_d.rate_y + kappa * e.rate_y - fall * e.y,
    )


@kernel
def turn_rate(v: Moving, slowest: float) -> float:
    """Rate of the direction of a velocity [rad/s]; below `slowest` [m/s] it counts for less."""
    speed2 = max(v.x * v.x + v.y * v.y, slowest * slowest)
    return (v.x * v.rate_y - v.y * v.rate_x) / speed2
