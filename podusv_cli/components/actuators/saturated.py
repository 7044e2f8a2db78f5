"""Force and moment within limits."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from podusv_cli.components.actuators.base import SATURATION, Actuator
from podusv_cli.core.component import value
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal


class Saturated(Actuator):
    """Surge force and yaw moment cut off at limits that are the same ahead and astern."""

    kind: Literal["saturated"] = "saturated"
    feels_motion: ClassVar[bool] = False
    cuts: ClassVar[bool] = True
    surge_limit: float = value(8.0, "N", "largest surge force, ahead and astern", gt=0)
    yaw_limit: float = value(2.5, "N m", "largest yaw moment, both ways", gt=0)

    @property
    def signals(self) -> tuple[Signal, ...]:
        """The flag that tells whether a limit is reached."""
        return (SATURATION,)

    def limits(self) -> tuple[float, ...]:
        """The limits of surge force [N] and yaw moment [N m], as they are given."""
        return self.surge_limit, self.yaw_limit

    # demand (2) [N, N m], limits in N and N m; writes tau (3) [N, N, N m] and signals (1).
    @staticmethod
    @kernel
    def drive(demand: Vector, k: Any, tau: Vector, signals: Vector) -> None:
        """Each demand clipped by itself; `saturated` is 1 while either is."""
        tau[0] = min(max(demand[0], -k.surge_limit), k.surge_limit)
        tau[1] = 0.0
        tau[2] = min(max(demand[1], -k.yaw_limit), k.yaw_limit)
        signals[0] = 1.0 if tau[0] != demand[0] or tau[2] != demand[1] else 0.0
