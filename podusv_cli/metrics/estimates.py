"""Metrics of the error of the estimate that the law is given; runs without sensors have none."""

from __future__ import annotations

import math
from typing import Any

from podusv_cli.core.kernel import Vector, kernel, scratch, tail
from podusv_cli.metrics.metric import Accumulator, Measured, Metric, Result, add

TIME, POSITION, HEADING, VELOCITY, YAW_RATE, INTEGRALS = range(6)
SIZE = 2 * INTEGRALS


# given (6) the estimate, s (6) the truth; writes square (4) [m2, rad2, m2/s2, rad2/s2].
@kernel
def square_errors(given: Vector, s: Vector, square: Vector) -> None:
    """The squared errors of an estimate: position, heading, velocity, yaw rate."""
    x, y, psi = given[0] - s[0], given[1] - s[1], given[2] - s[2]
    u, v, r = given[3] - s[3], given[4] - s[4], given[5] - s[5]
    square[0] = x * x + y * y
    square[1] = psi * psi
    square[2] = u * u + v * v
    square[3] = r * r


# Arguments as those of `spans.all_kernels`; changes `seen`. before and after (4) are the squares on
# both sides of a jump.
@kernel
def watch(weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Gather the squared errors of the estimate, where it jumps the mean of both sides.

    With the side after a delivery alone, the trapezoidal sum has an error of the order of the step.
    """
    before, after = scratch(4), scratch(4)
    square_errors(tail(row, int(k.before)), s, before)
    square_errors(tail(s, int(k.estimate)), s, after)
    add(seen, INTEGRALS, TIME, weight)
    for i in range(4):
        add(seen, INTEGRALS, POSITION + i, weight * 0.5 * (before[i] + after[i]))


def _size(layout: Measured) -> int:
    """How many numbers are gathered; none where the law is given the state itself."""
    return SIZE if layout.plan.estimate else 0


def _constants(layout: Measured) -> dict[str, float]:
    """Where the estimate is in the states, and that before a delivery in the row."""
    plan = layout.plan
    return {"estimate": float(plan.estimate), "before": float(plan.columns)}


def _rms(position: int) -> Result:
    """The result that is the root of the mean of a gathered integral; NaN over no time."""
    return lambda seen, step: math.sqrt(seen[position] / seen[TIME]) if seen[TIME] else math.nan


OF = Accumulator(watch, _size, _constants, INTEGRALS)
position = Metric(
    "estimate_position_rms",
    "m",
    "rms distance between estimated and true position",
    OF,
    _rms(POSITION),
    place=7,
    words="error of the estimated position, rms",
    headline=True,
)
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
    "estimate_velocity_rms",
    "m/s",
    "rms error of the estimated velocity, surge and sway together",
    OF,
    _rms(VELOCITY),
    place=7,
    words="error of the estimated velocity, rms",
)
yaw_rate = Metric(
    "estimate_yaw_rate_rms",
    "rad/s",
    "rms error of the estimated yaw rate",
    OF,
    _rms(YAW_RATE),
    place=7,
    words="error of the estimated yaw rate, rms",
)
