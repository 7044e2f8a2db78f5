"""Calm water."""

from __future__ import annotations

from typing import ClassVar, Literal

from podusv_cli.components.disturbances.base import Disturbance
from podusv_cli.core.kernel import Vector, kernel


class Calm(Disturbance):
    """No load at all."""

    of_time: ClassVar[bool] = True
    kind: Literal["none"] = "none"

    @staticmethod
    @kernel
    def evaluate(b: Vector) -> None:
        """Zero."""
        b[0] = b[1] = b[2] = 0.0

    def bounds(self) -> tuple[float, float, float]:
        """The bounds of the load: zero."""
        return 0.0, 0.0, 0.0
