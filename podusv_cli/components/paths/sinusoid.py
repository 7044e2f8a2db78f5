"""A target on a sine about a straight line."""

from __future__ import annotations

import math
from typing import Any, Literal

from podusv_cli.components.paths.base import Path
from podusv_cli.core.component import value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel


class Sinusoid(Path):
    """Along `course` from (x, y) at `speed`, and to starboard by amplitude sin(2 pi s/wavelength).

    s is the distance along the course, so the target itself is faster where the sine is steep.
    """

    kind: Literal["sinusoid"] = "sinusoid"
    x: float = value(0.0, "m", "start, north")
    y: float = value(0.0, "m", "start, east")
    course: float = value(0.0, "rad", "direction of the axis, from north towards east")
    speed: float = value(0.5, "m/s", "speed along the axis", ge=0)
    amplitude: float = value(3.0, "m", "largest distance from the axis", ge=0)
    wavelength: float = value(30.0, "m", "length of a period along the axis", gt=0)

    # t [s]; writes target (6): position [m], velocity, acceleration, each north and east.
    @staticmethod
    @kernel
    def evaluate(t: float, k: Any, target: Vector) -> None:
        """Uniform motion along the axis, harmonic motion across it."""
        rate = 2.0 * math.pi * k.speed / k.wavelength
        cosine, sine = cos_sin(rate * t)
        along, across = k.speed * t, k.amplitude * sine
        across_dot, across_ddot = k.amplitude * rate * cosine, -k.amplitude * rate * rate * sine
        north, east = cos_sin(k.course)
        target[0] = k.x + along * north - across * east
        target[1] = k.y + along * east + across * north
        target[2] = k.speed * north - across_dot * east
        target[3] = k.speed * east + across_dot * north
        target[4] = -across_ddot * east
        target[5] = across_ddot * north
