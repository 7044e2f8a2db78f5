"""A point of the bow, and what it lacks: shared by laws that linearise its motion exactly.

With w = v + l r the hand point h = p + l (cos psi, sin psi) moves at R (u, w), and surge force and
yaw moment push it along and across the bow, each by itself. So its motion can be prescribed. What
stays behind is the heading: it settles as docs/laws/hand_position.md says.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal, NamedTuple

from podusv_cli.components import rules as by
from podusv_cli.components.controllers.base import Controller, Most
from podusv_cli.components.controllers.constant_bearing import NEARS, Moving, approach, turn_rate
from podusv_cli.components.vessels.plant import surge_force, sway_force, yaw_moment
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import Rule, Ruled, value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal

ORIGIN = 1.0
SLOWEST = 0.05  # m/s; a slower target has no course
PSI_F = Signal("psi_f", "rad", "lagged heading, along which the hand point's target lies")


class Hand(NamedTuple):
    """What the hand point lacks, in the body frame, and how the lagged heading moves."""

    s_a: float  # missing velocity along the bow [m/s]
    s_b: float  # missing velocity across the bow [m/s]
    A_a: float  # wanted acceleration along the bow, seen in the body frame [m/s2]
    A_b: float  # wanted acceleration across the bow, seen in the body frame [m/s2]
    distance: float  # of the hand point to its target [m]
    psi_f_rate: float  # [rad/s]


# psi_f [rad], rate [rad/s] and bend [rad/s2] of the lagged heading, target (6); m/s and m/s2.
@kernel
def hand_target(psi_f: float, rate: float, bend: float, target: Vector, k: Any) -> Moving:
    """Velocity of the hand point's target: l ahead along the lagged heading, or at the target."""
    reach = k.hand if k.reference == ORIGIN else 0.0
    c, s = cos_sin(psi_f)
    return Moving(
        target[2] - reach * rate * s,
        target[3] + reach * rate * c,
        target[4] - reach * (bend * s + rate * rate * c),
        target[5] + reach * (bend * c - rate * rate * s),
    )


# x (6) state, target (6); psi_f [rad] is the filtered heading, which follows psi behind the lag T_f
# and turns with the target's course, so that a steady turn leaves no lag. A is seen in the body
# frame, where a velocity at rest over ground turns: hence r w and -r u. w [m/s] is the sway
# velocity of the hand point.
@kernel
def hand_errors(x: Vector, psi_f: float, target: Vector, k: Any) -> Hand:
    """What the hand point lacks to the velocity of constant-bearing guidance."""
    u, r, w = x[3], x[5], x[4] + k.hand * x[5]
    cos_psi, sin_psi = cos_sin(x[2])
    h_x, h_y = u * cos_psi - w * sin_psi, u * sin_psi + w * cos_psi
    course = turn_rate(Moving(target[2], target[3], target[4], target[5]), SLOWEST)
    rate = (x[2] - psi_f) / k.T_f + course
    V_h = hand_target(psi_f, rate, (r - rate) / k.T_f, target, k)
    reach = k.hand if k.reference == ORIGIN else 0.0
    cos_f, sin_f = cos_sin(psi_f)
    e = Moving(
        target[0] - x[0] + reach * cos_f - k.hand * cos_psi,
        target[1] - x[1] + reach * sin_f - k.hand * sin_psi,
        V_h.x - h_x,
        V_h.y - h_y,
    )
    V = approach(e, V_h, k)
    s_x, s_y = V.x - h_x, V.y - h_y
    return Hand(
        s_x * cos_psi + s_y * sin_psi,
        s_y * cos_psi - s_x * sin_psi,
        V.rate_x * cos_psi + V.rate_y * sin_psi + r * w,
        V.rate_y * cos_psi - V.rate_x * sin_psi - r * u,
        math.sqrt(e.x * e.x + e.y * e.y),
        rate,
    )


# x (6) state; along and across [m/s2], loads [N, N, N m]. Writes tau (2) [N, N m]. Across, the hand
# point moves by v' + l r': r' makes up for what the hull's own sway leaves.
@kernel
def push(
    x: Vector, along: float, across: float, b_u: float, b_v: float, b_r: float, k: Any, tau: Vector
) -> None:
    """The demand that gives the hand point these accelerations under known loads b."""
    u, v, r = x[3], x[4], x[5]
    tau[0] = k.m11 * along - surge_force(u, v, r, k) - b_u
    v_dot = (sway_force(u, v, r, k) + b_v) / k.m22
    tau[1] = k.m33 / k.hand * (across - v_dot) - yaw_moment(u, v, r, k) - b_r


class HandController(Controller):
    """Options of the hand point, the same for every law that steers it."""

    rules: ClassVar[dict[str, Rule]] = {
        "hand": by.AHEAD,
        "T_f": by.HAND_TIME,
        "k_p": by.HAND,
        "U": by.SPEED,
        "k_v": by.HAND,
    }

    signals: ClassVar[tuple[Signal, ...]] = (
        Signal("s_a", "m/s", "velocity that the hand point lacks along the bow"),
        Signal("s_b", "m/s", "velocity that the hand point lacks across the bow"),
        Signal("z_h", "m", "distance of the hand point to its own target"),
    )
    hand: Ruled = value(0.3, "m", "how far the hand point is ahead of the origin", gt=0)
    reference: Literal["target", "origin"] = value(
        "origin",
        "",
        "what comes to the target: the hand point as published (target), or the "
        "origin, with a target for the hand point that lies ahead along the lagged heading",
    )
    T_f: Ruled = value(2.0, "s", "lag of that heading", gt=0)
    k_p: Ruled = value(0.5, "1/s", "gain of the distance, near the target", gt=0)
    U: Ruled = value(1.25, "m/s", "largest wanted speed, about 1.2 times that at full thrust", gt=0)
    k_v: Ruled = value(1.0, "1/s", "gain of the velocity that the hand point lacks", gt=0)

    def start(self, x: Vector, target: Vector, nominal: Vessel) -> Vector:
        """The memory: the lagged heading, which comes last, is the vessel's; all else is 0."""
        memory = super().start(x, target, nominal)
        memory[-1] = x[2]
        return memory

    def most(self) -> Most:
        """The speed U [m/s] that the law keeps within, and how fast it nears a target as fast."""
        return Most(self.U, NEARS)

    def rate_gains(self) -> tuple[float, float]:
        """Gains [1/s] with which surge and yaw answer a change of u and of r at rest.

        The part of A in them is k_p; with `reference: origin` the lagged heading takes 1/T_f off.
        """
        gain = self.k_v + self.k_p
        return gain, gain - (1.0 / self.T_f if self.reference == "origin" else 0.0)
