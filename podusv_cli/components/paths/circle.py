"""A target on a circle at constant speed."""

from __future__ import annotations

from typing import Any, Literal

from podusv_cli.components.paths.base import Path
from podusv_cli.core.component import value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel


# Writes target (6): position [m], velocity, acceleration, each north and east.
@kernel
def on_circle(radius: float, angle: float, rate: float, target: Vector) -> None:
    """Target at `angle` [rad] of a circle about the origin, turning at constant `rate` [rad/s]."""
    cos_angle, sin_angle = cos_sin(angle)
    target[0] = radius * cos_angle
    target[1] = radius * sin_angle
    target[2] = -radius * rate * sin_angle
    target[3] = radius * rate * cos_angle
    target[4] = -radius * rate * rate * cos_angle
    target[5] = -radius * rate * rate * sin_angle


class Circle(Path):
    """About (x, y), from `angle` on, to starboard where `turn` is starboard."""

    kind: Literal["circle"] = "circle"
    x: float = value(0.0, "m", "centre, north")
    y: float = value(0.0, "m", "centre, east")
    radius: float = value(10.0, "m", "radius", gt=0)
    speed: float = value(0.5, "m/s", "speed of the target", ge=0)
    angle: float = value(
        0.0, "rad", "where on the circle the target starts, 0 is north of the centre"
    )
    turn: Literal["starboard", "port"] = value("starboard", "", "sense of rotation seen from above")

    # t [s]; writes target (6): position [m], velocity, acceleration, each north and east.
    @staticmethod
    @kernel
    def evaluate(t: float, k: Any, target: Vector) -> None:
        """Uniform rotation; with y to the east, a growing angle turns to starboard."""
        rate = (1.0 - 2.0 * k.turn) * k.speed / k.radius
        on_circle(k.radius, k.angle + rate * t, rate, target)
        target[0] += k.x
        target[1] += k.y
