"""A path that waves about a straight line."""

from __future__ import annotations

import math
from typing import Any, Literal

from podusv_cli.plugin import Path, Vector, kernel, value


class Lawn(Path):
    """A sine about a line that leads north."""

    kind: Literal["lawn"] = "lawn"
    speed: float = value(0.5, "m/s", "speed along the line", gt=0)
    width: float = value(4.0, "m", "amplitude of the sine", ge=0)
    length: float = value(40.0, "m", "length of a wave", gt=0)

    @staticmethod
    @kernel
    def evaluate(t: float, k: Any, target: Vector) -> None:
        """Position, velocity and acceleration."""
        omega = 2.0 * math.pi * k.speed / k.length
        target[0], target[2], target[4] = k.speed * t, k.speed, 0.0
        target[1] = k.width * math.sin(omega * t)
        target[3] = k.width * omega * math.cos(omega * t)
        target[5] = -k.width * omega * omega * math.sin(omega * t)
