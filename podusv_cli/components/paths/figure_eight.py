"""A target on a figure eight."""

from __future__ import annotations

import math
from typing import Any, Literal

from podusv_cli.components.paths.base import Path
from podusv_cli.core.component import value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel


class FigureEight(Path):
    """The lemniscate of Gerono about (x, y): x + L/2 sin(w t), y + B/2 sin(2 w t).

    It begins at the crossing; w is 2 pi over the period. The speed is largest at the crossing,
    w hypot(L/2, B), and smallest at the ends of the lobes, w B.
    """

    kind: Literal["figure_eight"] = "figure_eight"
    x: float = value(0.0, "m", "crossing, north")
    y: float = value(0.0, "m", "crossing, east")
    length: float = value(30.0, "m", "extent to north and south together, L", gt=0)
    breadth: float = value(10.0, "m", "extent to east and west together, B", gt=0)
    period: float = value(200.0, "s", "time for both lobes", gt=0)

    # t [s]; writes target (6): position [m], velocity, acceleration, each north and east.
    @staticmethod
    @kernel
    def evaluate(t: float, k: Any, target: Vector) -> None:
        """Two harmonic motions, the eastward one twice as fast."""
        rate = 2.0 * math.pi / k.period
        north, east = 0.5 * k.length, 0.5 * k.breadth
        cosine, sine = cos_sin(rate * t)
        cosine_2, sine_2 = cos_sin(2.0 * rate * t)
        target[0] = k.x + north * sine
        target[1] = k.y + east * sine_2
        target[2] = north * rate * cosine
        target[3] = 2.0 * east * rate * cosine_2
        target[4] = -north * rate * rate * sine
        target[5] = -4.0 * east * rate * rate * sine_2
