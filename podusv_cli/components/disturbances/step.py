"""A load that sets in."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from podusv_cli.components.disturbances.base import Disturbance
from podusv_cli.core.component import value
from podusv_cli.core.kernel import Vector, kernel


class Step(Disturbance):
    """No load before `time`, then a constant one, at once or along a ramp.

    A load that ends again is the sum of two, the second with the opposite sign.
    """

    of_time: ClassVar[bool] = True
    kind: Literal["step"] = "step"
    time: float = value(0.0, "s", "when the load sets in", ge=0)
    ramp: float = value(0.0, "s", "how long it takes to grow to its full size; 0: at once", ge=0)
    b_u: float = value(0.0, "N", "surge force afterwards")
    b_v: float = value(0.0, "N", "sway force afterwards")
    b_r: float = value(0.0, "N m", "yaw moment afterwards")

    def bounds(self) -> tuple[float, float, float]:
        """The bounds [N, N, N m]: the load that has set in."""
        return abs(self.b_u), abs(self.b_v), abs(self.b_r)

    def sets_in(self) -> float:
        """When the load sets in [s]."""
        return self.time

    def jumps(self) -> float:
        """When the load jumps [s]: as it sets in; 0 with a ramp."""
        return 0.0 if self.ramp else self.time

    # t, k.time and k.ramp [s]; writes b (3) [N, N, N m].
    @staticmethod
    @kernel
    def evaluate(t: float, k: Any, b: Vector) -> None:
        """The share of the load that has set in, times the load."""
        share = 1.0 if t >= k.time + k.ramp else 0.0
        if k.time < t < k.time + k.ramp:
            share = (t - k.time) / k.ramp
        b[0], b[1], b[2] = share * k.b_u, share * k.b_v, share * k.b_r
