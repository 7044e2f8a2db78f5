"""A target on an ellipse, with the heading of its course."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

from podusv_cli.components.paths.base import Path
from podusv_cli.core.component import value
from podusv_cli.core.elementary import arctangent, cos_sin
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import PSI_D


class Ellipse(Path):
    """About (x, y): L/2 cos(phi) along `angle`, B/2 sin(phi) across it, phi = 2 pi t/period.

    The speed is largest where it passes the short axis, and smallest at the ends of the long one.
    The heading is that of the course, and grows by a whole turn each period.
    """

    kind: Literal["ellipse"] = "ellipse"
    heads: ClassVar[bool] = True
    x: float = value(0.0, "m", "centre, north")
    y: float = value(0.0, "m", "centre, east")
    length: float = value(10.0, "m", "extent along `angle`, L", gt=0)
    breadth: float = value(6.0, "m", "extent across it, B", gt=0)
    angle: float = value(0.0, "rad", "direction of L, from north to east")
    period: float = value(120.0, "s", "time for one round", gt=0)
    turn: Literal["starboard", "port"] = value("starboard", "", "sense of rotation seen from above")

    # target (10): position [m], its rates, the distance, which is not this kernel's, heading [rad].
    @staticmethod
    @kernel
    def evaluate(t: float, k: Any, target: Vector) -> None:
        """Harmonic motions along and across, turned by `angle`; the course of that."""
        side = 1.0 - 2.0 * k.turn
        rate, a, b = side * 2.0 * math.pi / k.period, 0.5 * k.length, 0.5 * k.breadth
        c, s = cos_sin(rate * t)
        cos_angle, sin_angle = cos_sin(k.angle)
        for order in range(3):  # position, velocity, acceleration
            along, across = a * c, b * s
            if order == 1:
                along, across = -a * rate * s, b * rate * c
            elif order == 2:
                along, across = -a * rate * rate * c, -b * rate * rate * s
            target[2 * order] = along * cos_angle - across * sin_angle
            target[2 * order + 1] = along * sin_angle + across * cos_angle
        target[0] += k.x
        target[1] += k.y
        # The course is phi and a right angle, but for what lies within a right angle of it.
        beside, ahead = (a - b) * s * c, a * s * s + b * c * c
        square = a * a * s * s + b * b * c * c
        target[PSI_D] = k.angle + rate * t + side * 0.5 * math.pi + arctangent(beside, ahead)
        target[PSI_D + 1] = rate * a * b / square
        growth = -2.0 * rate * rate * a * b * (a * a - b * b) * s * c
        target[PSI_D + 2] = growth / (square * square)
