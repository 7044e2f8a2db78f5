"""A target on a straight line at constant speed."""

from __future__ import annotations

from typing import Any, Literal

from podusv_cli.components.paths.base import Path
from podusv_cli.core.component import value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel


class Line(Path):
    """From (x, y) along `course` at `speed`."""

    kind: Literal["line"] = "line"
    x: float = value(0.0, "m", "start, north")
    y: float = value(0.0, "m", "start, east")
    course: float = value(0.0, "rad", "direction of travel, from north towards east")
    speed: float = value(0.5, "m/s", "speed of the target", ge=0)

    # t [s]; writes target (6): position [m], velocity, acceleration, each north and east.
    @staticmethod
    @kernel
    def evaluate(t: float, k: Any, target: Vector) -> None:
        """Uniform motion."""
        cosine, sine = cos_sin(k.course)
        target[2] = k.speed * cosine
        target[3] = k.speed * sine
        target[0] = k.x + target[2] * t
        target[1] = k.y + target[3] * t
        target[4] = 0.0
        target[5] = 0.0
