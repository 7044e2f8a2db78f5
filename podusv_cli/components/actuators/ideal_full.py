"""The wished-for forces of a fully actuated vessel, within limits where there are any."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from podusv_cli.components.actuators.base import SATURATION, Actuator
from podusv_cli.core.component import value
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal


class IdealFull(Actuator):
    """Surge force, yaw moment and sway force, each cut off at its own limit."""

    kind: Literal["ideal_full"] = "ideal_full"
    feels_motion: ClassVar[bool] = False
    takes_sway: ClassVar[bool] = True
    surge_limit: float = value(1e300, "N", "largest surge force, ahead and astern", gt=0)
    yaw_limit: float = value(1e300, "N m", "largest yaw moment, both ways", gt=0)
    sway_limit: float = value(1e300, "N", "largest sway force, both ways", gt=0)

    @property
    def signals(self) -> tuple[Signal, ...]:
        """The flag."""
        return (SATURATION,)

    @staticmethod
    @kernel
    def drive(demand: Vector, k: Any, tau: Vector, signals: Vector) -> None:
        """Each demand clipped by itself; `saturated` is 1 while any is."""
        tau[0] = min(max(demand[0], -k.surge_limit), k.surge_limit)
        tau[1] = min(max(demand[2], -k.sway_limit), k.sway_limit)
        tau[2] = min(max(demand[1], -k.yaw_limit), k.yaw_limit)
        cut = tau[0] != demand[0] or tau[1] != demand[2] or tau[2] != demand[1]
        signals[0] = 1.0 if cut else 0.0
