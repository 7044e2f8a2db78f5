"""Metrics of the error beyond a law's standoff, and of the position across and along the path."""

from __future__ import annotations

import math
from typing import Any

from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.engine.closed_loop import DISTANCE
from podusv_cli.metrics.metric import Accumulator, Layout, Metric, Result, add, gathered, ratio

# Positions of the gathered numbers: integrals over the run, and over the steady window.
TIME, ABSOLUTE, INTEGRALS = range(3)
ACROSS, ALONG, SETTLED = range(2, 5)


@kernel
def watch(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Gather the integral of |z_e - standoff|."""
    add(seen, INTEGRALS, TIME, weight)
    add(seen, INTEGRALS, ABSOLUTE, weight * abs(row[DISTANCE] - k.standoff))


@kernel
def watch_settled(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Gather the error and the squared path errors over the steady window.

    The window's first instant has half a weight. Across is positive to the right of the target's
    course, along ahead of it. While the target stands still both count as zero.
    """
    if t >= k.steady_from:
        opens = seen[TIME] == 0.0 and t > 0.0
        share = 0.5 * weight if opens else weight
        x, y = s[0] - row[0], s[1] - row[1]
        speed = max(math.sqrt(row[2] * row[2] + row[3] * row[3]), 1e-300)
        across, along = (y * row[2] - x * row[3]) / speed, (x * row[2] + y * row[3]) / speed
        add(seen, SETTLED, ABSOLUTE, share * abs(row[DISTANCE] - k.standoff))
        add(seen, SETTLED, ACROSS, share * across * across)
        add(seen, SETTLED, ALONG, share * along * along)
        add(seen, SETTLED, TIME, share)


def _constants(layout: Layout) -> dict[str, float]:
    approach = layout.loop.controller.approach()
    standoff = approach.standoff if approach else 0.0
    return {"steady_from": layout.steady_from, "standoff": standoff}


def _rms(position: int) -> Result:
    mean = ratio(position, TIME)
    return lambda seen, step: math.sqrt(mean(seen, step))


OVERALL = Accumulator(watch, lambda layout: 2 * INTEGRALS, _constants, INTEGRALS)
STEADY = Accumulator(watch_settled, lambda layout: 2 * SETTLED, _constants, SETTLED)
iae_e = Metric("iae_e", "m s", "integral of |z_e - standoff|", OVERALL, gathered(ABSOLUTE), 2)
e_steady = Metric(
    "e_steady", "m", "mean of |z_e - standoff| over the steady window", STEADY,
    ratio(ABSOLUTE, TIME), 2,
)  # fmt: skip
cross_track_rms = Metric(
    "cross_track_rms", "m", "rms distance from the target across its course, steady window",
    STEADY, _rms(ACROSS), 2,
)  # fmt: skip
along_track_rms = Metric(
    "along_track_rms", "m", "rms distance from the target along its course, steady window",
    STEADY, _rms(ALONG), 2, counts_standoff=True,
)  # fmt: skip
