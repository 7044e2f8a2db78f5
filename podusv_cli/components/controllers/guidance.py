"""Guidance by line of sight to a moving target: errors in the frame of its course, and a speed.

The path is the straight line through the target along its velocity. Source of the frame and of the
lookahead: T. I. Fossen, "Handbook of Marine Craft Hydrodynamics and Motion Control" (2011). The
speed that follows the target is podusv's. docs/laws/los_pid.md has the equations.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, NamedTuple

from podusv_cli.components import rules as by
from podusv_cli.components.controllers.base import Controller, Most
from podusv_cli.core.component import Rule, Ruled, value
from podusv_cli.core.elementary import arctangent, cos_sin
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.kinematics import direction
from podusv_cli.core.signal import Signal

STEERED = (
    Signal("along", "m", "target ahead of the vessel, along the target's course", "s"),
    Signal("across", "m", "vessel to the right of the target's course", "y_e"),
    Signal("psi_r", "rad", "wanted heading", r"\psi_r", wrapped=True),
    Signal("u_d", "m/s", "wanted surge velocity"),
)
STEEPEST = 0.2  # cosine; with the bow further off the course the wanted speed grows no more


class Frame(NamedTuple):
    """The vessel in the frame of the target's course."""

    along: float  # target ahead of the vessel [m]
    across: float  # vessel to the right of the course [m]
    along_rate: float  # m/s
    across_rate: float  # m/s
    course: float  # rad
    turn: float  # rate of the course [rad/s], limited
    speed: float  # of the target [m/s]
    cos_off: float  # of the heading less the course
    sin_off: float


# x (6) state, target (6). The rates are those in a frame that turns with the course; of a target at
# rest that turn counts as 0.
@kernel
def course_frame(x: Vector, target: Vector, k: Any) -> Frame:
    """Errors along and across; the course of a target at rest is the line of sight."""
    e_x, e_y = target[0] - x[0], target[1] - x[1]
    speed = math.sqrt(target[2] * target[2] + target[3] * target[3])
    rests = speed < k.V_m
    course = direction(e_x, e_y) if rests else direction(target[2], target[3])
    cos_c, sin_c = cos_sin(course)
    cos_off, sin_off = cos_sin(x[2] - course)
    turn = (target[2] * target[5] - target[3] * target[4]) / max(speed * speed, k.V_m * k.V_m)
    turn = 0.0 if rests else min(max(turn, -k.chi_m), k.chi_m)
    along, across = e_x * cos_c + e_y * sin_c, e_x * sin_c - e_y * cos_c
    along_rate = speed - x[3] * cos_off + x[4] * sin_off - turn * across
    across_rate = x[3] * sin_off + x[4] * cos_off + turn * along
    return Frame(along, across, along_rate, across_rate, course, turn, speed, cos_off, sin_off)


@kernel
def line_of_sight(
    at: Frame, behind: float, offset: float, offset_rate: float, k: Any
) -> tuple[float, float]:
    """Angle [rad] from the course to the line of sight, and its rate.

    It goes to the point of the line that lies the lookahead ahead; with the vessel `behind` [m] the
    target, to the target if that is further. `offset` [m] is added to the distance across.
    """
    ahead = math.sqrt(k.lookahead * k.lookahead + behind * behind)
    across = at.across + offset
    rate = ahead * (at.across_rate + offset_rate) - across * behind / ahead * at.along_rate
    return -arctangent(across, ahead), -rate / (ahead * ahead + across * across)


# x (6) state; in m/s. The speed along the course is u cos_off - v sin_off, solved for u; the cosine
# is not taken below STEEPEST, or a bow crosswise would ask for an endless speed.
@kernel
def wanted_speed(x: Vector, at: Frame, k: Any) -> float:
    """The surge velocity with which the speed along the course is the target's, plus k_s along.

    A vessel beside its target has to come to the line, at k_s times what lies across beyond the
    lookahead.
    """
    wanted = at.speed + k.k_s * at.along + x[4] * at.sin_off
    least = max(k.U_min, k.k_s * (abs(at.across) - k.lookahead))
    return float(min(max(wanted / max(at.cos_off, STEEPEST), least), k.U))


class LineOfSight(Controller):
    """What laws with line-of-sight guidance have in common."""

    rules: ClassVar[dict[str, Rule]] = {
        "lookahead": by.AHEAD,
        "k_s": by.SURGE,
        "U": by.SPEED,
        "U_min": by.SPEED,
        "V_m": by.SPEED,
        "chi_m": by.TURN,
    }

    lookahead: Ruled = value(2.0, "m", "distance ahead on the path that the bow aims at", gt=0)
    k_s: Ruled = value(0.3, "1/s", "gain of the distance along the course", ge=0)
    U: Ruled = value(0.9, "m/s", "largest wanted surge velocity", gt=0)
    U_min: Ruled = value(0.1, "m/s", "least wanted surge velocity, for steerage", ge=0)
    V_m: Ruled = value(
        0.02, "m/s", "below this speed of the target its course is the line of sight", gt=0
    )
    chi_m: Ruled = value(0.3, "rad/s", "largest turn of the course used ahead", gt=0)

    def most(self) -> Most:
        """The speed U [m/s] that the law keeps within."""
        return Most(self.U)
