"""A target that stays, with a heading: what dynamic positioning holds."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from podusv_cli.components.paths.base import Path, Point
from podusv_cli.core.component import value
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import PSI_D


class Hold(Path):
    """One pose, from the beginning to the end."""

    kind: Literal["hold"] = "hold"
    heads: ClassVar[bool] = True
    rests: ClassVar[bool] = True
    x: float = value(0.0, "m", "position, north")
    y: float = value(0.0, "m", "position, east")
    psi: float = value(0.0, "rad", "heading")

    def waypoints(self) -> tuple[Point, ...]:
        """The point at which the target stays [m]."""
        return ((self.x, self.y),)

    # target (10): position [m], its rates, the distance, which is not this kernel's, heading [rad].
    @staticmethod
    @kernel
    def evaluate(k: Any, target: Vector) -> None:
        """The pose; all rates are 0."""
        target[0], target[1] = k.x, k.y
        target[2] = target[3] = target[4] = target[5] = 0.0
        target[PSI_D] = k.psi
        target[PSI_D + 1] = target[PSI_D + 2] = 0.0
