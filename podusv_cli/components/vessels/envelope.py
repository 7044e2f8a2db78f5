"""What motion a vessel's numbers hold for."""

from __future__ import annotations

import math

import numpy as np

from podusv_cli.core.component import Component, value
from podusv_cli.core.kernel import Vector

AT_REST = 0.1  # of `speed`; slower than this a hull has any drift angle


class Envelope(Component):
    """The motion through the water in which a vessel's inertia and damping are to be trusted."""

    source: str = value("", "", "where the numbers come from")
    speed: float = value(..., "m/s", "largest speed", gt=0)
    drift: float = value(
        ...,
        "rad",
        f"largest drift angle |atan2(v, |u|)|, above {AT_REST:g} of the largest speed",
        gt=0,
        le=math.pi,
    )
    yaw_rate: float = value(..., "rad/s", "largest yaw rate, either way", gt=0)

    def shares(self, u: Vector, v: Vector, r: Vector) -> dict[str, Vector]:
        """Speed, drift angle and yaw rate over their limits, by name, each (n,) without unit.

        `u`, `v` [m/s] and `r` [rad/s] are (n,). At hardly any speed the drift angle counts as 0.
        """
        speed = np.hypot(u, v) / self.speed
        drift = np.where(speed > AT_REST, np.abs(np.arctan2(v, np.abs(u))) / self.drift, 0.0)
        return {"speed": speed, "drift": drift, "yaw_rate": np.abs(r) / self.yaw_rate}
