"""Metrics of the error of the estimate that the law is given; runs without sensors have none."""

from __future__ import annotations

import math
from typing import Any

from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.metrics.metric import Accumulator, Measured, Metric, Result, add

TIME, POSITION, HEADING, VELOCITY, YAW_RATE, INTEGRALS = range(6)
SIZE = 2 * INTEGRALS


@kernel
def watch(weight: float, s: Vector, k: Any, seen: Vector) -> None:
    """Gather the squared errors of the estimate."""
    at = int(k.estimate)
    x, y, psi = s[at] - s[0], s[at + 1] - s[1], s[at + 2] - s[2]
    u, v, r = s[at + 3] - s[3], s[at + 4] - s[4], s[at + 5] - s[5]
    add(seen, INTEGRALS, TIME, weight)
    add(seen, INTEGRALS, POSITION, weight * (x * x + y * y))
    add(seen, INTEGRALS, HEADING, weight * psi * psi)
    add(seen, INTEGRALS, VELOCITY, weight * (u * u + v * v))
    add(seen, INTEGRALS, YAW_RATE, weight * r * r)


def _size(layout: Measured) -> int:
    return SIZE if layout.plan.estimate else 0


def _constants(layout: Measured) -> dict[str, float]:
    return {"estimate": float(layout.plan.estimate)}


def _rms(position: int) -> Result:
    return lambda seen, step: math.sqrt(seen[position] / seen[TIME]) if seen[TIME] else math.nan


OF = Accumulator(watch, _size, _constants, INTEGRALS)
position = Metric(
    "estimate_position_rms", "m", "rms distance between estimated and true position", OF,
    _rms(POSITION), place=7,
    words="error of the estimated position, rms", headline=True,
)  # fmt: skip
heading = Metric(
    "estimate_heading_rms",
    "rad",
    "rms error of the estimated heading",
    OF,
    _rms(HEADING),
    place=7,
    words="error of the estimated heading, rms",
)
velocity = Metric(
    "estimate_velocity_rms", "m/s", "rms error of the estimated velocity, surge and sway together",
    OF, _rms(VELOCITY), place=7,
    words="error of the estimated velocity, rms",
)  # fmt: skip
yaw_rate = Metric(
    "estimate_yaw_rate_rms",
    "rad/s",
    "rms error of the estimated yaw rate",
    OF,
    _rms(YAW_RATE),
    place=7,
    words="error of the estimated yaw rate, rms",
)
