"""Legs whose last waypoint is held: the boat drifts and returns, or goes round it.

As autopilots have it. Drifting, the boat is let go within a radius; beyond it the wanted speed back
grows with the distance. ArduPilot's Loiter mode of rovers and boats does the same, with 2 m and
0.5 1/s (from its documentation); it also slows down while it turns, and may go astern.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

from podusv_cli.components import rules as by
from podusv_cli.components.paths.legs import ALONG, LEG, Legs, leg_frame
from podusv_cli.core.component import Rule, Ruled, value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel, scratch, tail
from podusv_cli.core.kinematics import direction
from podusv_cli.core.signal import Signal

HOLD_COURSE = Signal(
    "hold_course", "rad", "course of the last leg, then to the waypoint that is held"
)
COURSE = ALONG + 1  # where the place has it
CIRCLE = 1.0  # the place of "circle" among the choices of `hold`
CREEP = 1e-6  # of the wanted speed, and metres ahead: a target that rests keeps its course

on_legs, seek_leg = Legs.evaluate, Legs.locate


# Reads (x[0], x[1]) and the waypoint [m]; `course` [rad] holds while the vessel is within the
# radius. Writes target (6). The law steers by the target's velocity, so it never rests altogether.
# Its place is a little ahead of the vessel, so that the direction to it is defined.
@kernel
def drift(x: Vector, course: float, waypoint: Vector, k: Any, target: Vector) -> None:
    """A target at the vessel that goes back to the waypoint, as fast as it is beyond the radius."""
    north, east = waypoint[0] - x[0], waypoint[1] - x[1]
    away = math.sqrt(north * north + east * east)
    c, s = cos_sin(course)
    speed = CREEP * k.speed
    if away > k.radius:
        c, s = north / away, east / away
        speed = max(speed, min(k.gain * (away - k.radius), k.speed))
    target[0], target[1] = x[0] + (k.lead + CREEP) * c, x[1] + (k.lead + CREEP) * s
    target[2], target[3] = speed * c, speed * s
    target[4], target[5] = 0.0, 0.0


# Arguments as those of `drift`. The angle is that of the vessel seen from the waypoint; a growing
# one goes round clockwise. Writes target (6); `inwards` [m/s2] is its acceleration towards the
# waypoint.
@kernel
def go_round(x: Vector, waypoint: Vector, k: Any, target: Vector) -> None:
    """The point of the circle beside the vessel, or ahead of it by the lead, clockwise."""
    angle = direction(x[0] - waypoint[0], x[1] - waypoint[1]) + k.lead / k.radius
    c, s = cos_sin(angle)
    target[0], target[1] = waypoint[0] + k.radius * c, waypoint[1] + k.radius * s
    target[2], target[3] = -k.speed * s, k.speed * c
    inwards = k.speed * k.speed / k.radius
    target[4], target[5] = -inwards * c, -inwards * s


class LegsHold(Legs):
    """Straight legs, as `legs`; the boat stays about the last waypoint, and metrics end there.

    It drifts within `radius` and returns, or goes round on that circle, clockwise.
    """

    kind: Literal["legs_hold"] = "legs_hold"  # type: ignore[assignment]
    rules: ClassVar[dict[str, Rule]] = {**Legs.rules, "radius": by.LENGTH}
    places: ClassVar[tuple[Signal, ...]] = (*Legs.places, HOLD_COURSE)
    hold: Literal["drift", "circle"] = value(
        "drift", "", "drift within `radius` of the last waypoint and return to it, or go round it"
    )
    radius: Ruled = value(2.0, "m", "distance to the last waypoint that is allowed, or kept", gt=0)
    gain: float = value(0.5, "1/s", "speed back per distance beyond `radius`, up to `speed`", gt=0)

    # Arguments as those of `Legs.locate`; place (4).
    @staticmethod
    @kernel
    def locate(x: Vector, s: Vector, place: Vector, k: Any, table: Vector) -> None:
        """As on legs; and the course with which the vessel drifts."""
        seek_leg(x, s, place, k, table)
        last = int(k.legs)
        if place[LEG] < last:
            at = scratch(5)
            leg_frame(x, int(place[LEG]), table, at)
            place[COURSE] = direction(at[0], at[1])
        else:
            north, east = table[2 * last] - x[0], table[2 * last + 1] - x[1]
            if north * north + east * east > k.radius * k.radius:
                place[COURSE] = direction(north, east)

    # Arguments as those of `Legs.evaluate`; place (4).
    @staticmethod
    @kernel
    def evaluate(x: Vector, place: Vector, k: Any, table: Vector, target: Vector) -> None:
        """The target on the active leg; once all are done that about the last waypoint."""
        last = int(k.legs)
        if place[LEG] < last:
            on_legs(x, place, k, table, target)
        elif k.hold == CIRCLE:
            go_round(x, tail(table, 2 * last), k, target)
        else:
            drift(x, place[COURSE], tail(table, 2 * last), k, target)
