"""The turning circle: steering at one angle from a straight approach on."""

from __future__ import annotations

import math
from typing import Any, Literal

from podusv_cli.components.controllers.manoeuvre import Manoeuvre, steered
from podusv_cli.core.component import value
from podusv_cli.core.kernel import Vector, kernel


class TurningCircle(Manoeuvre):
    """Steers at `angle` to starboard from `execute` on (IMO MSC.137(76), 35 deg)."""

    kind: Literal["turning_circle"] = "turning_circle"
    angle: float = value(
        math.radians(35.0), "rad", "angle of the thrust to starboard", gt=0, le=0.5 * math.pi
    )

    @staticmethod
    @kernel
    def law(t: float, k: Any, tau: Vector, signals: Vector) -> None:
        """Straight, then at the angle."""
        steered(k.angle if t >= k.execute else 0.0, k, tau, signals)
