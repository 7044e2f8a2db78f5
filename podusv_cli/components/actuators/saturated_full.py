"""Surge force, sway force and yaw moment within limits."""

from __future__ import annotations

from typing import Any, Literal

from podusv_cli.components.actuators.base import SATURATION
from podusv_cli.components.actuators.full import FullActuator
from podusv_cli.core.component import value
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal


class SaturatedFull(FullActuator):
    """Three loads, each cut off at a limit of its own that is the same both ways.

    The default limits are those that papers give CyberShip II as a fully actuated ship; its own
    thrusters make less sway force (docs/actuators.md).
    """

    kind: Literal["saturated_full"] = "saturated_full"
    surge_limit: float = value(2.0, "N", "largest surge force, ahead and astern", gt=0)
    yaw_limit: float = value(1.5, "N m", "largest yaw moment, both ways", gt=0)
    sway_limit: float = value(2.0, "N", "largest sway force, both ways", gt=0)

    @property
    def signals(self) -> tuple[Signal, ...]:
        """The flag that tells whether a limit is reached."""
        return (SATURATION,)

    def limits(self) -> tuple[float, ...]:
        """The limits of surge force [N], yaw moment [N m] and sway force [N], as they are given."""
        return self.surge_limit, self.yaw_limit, self.sway_limit

    # demand (3) [N, N m, N], limits in N and N m; writes tau (3) [N, N, N m] and signals (1).
    @staticmethod
    @kernel
    def drive(demand: Vector, k: Any, tau: Vector, signals: Vector) -> None:
        """Each demand clipped by itself; `saturated` is 1 while any is."""
        tau[0] = min(max(demand[0], -k.surge_limit), k.surge_limit)
        tau[1] = min(max(demand[2], -k.sway_limit), k.sway_limit)
        tau[2] = min(max(demand[1], -k.yaw_limit), k.yaw_limit)
        cut = tau[0] != demand[0] or tau[1] != demand[2] or tau[2] != demand[1]
        signals[0] = 1.0 if cut else 0.0
