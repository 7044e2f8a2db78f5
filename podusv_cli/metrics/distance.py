"""Metrics of the distance z_e to the target."""

from __future__ import annotations

import math
from typing import Any

from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.engine.closed_loop import DISTANCE
from podusv_cli.metrics.metric import Accumulator, Layout, Metric, add, gathered, ratio

# Positions of the gathered numbers.
TIME, ABSOLUTE, SQUARE, TIMED, INTEGRALS = range(5)
OUTSIDE, NOW, SIZE = range(2 * INTEGRALS, 2 * INTEGRALS + 3)
SETTLED = 2  # integrals over the steady window: TIME, ABSOLUTE


@kernel
def watch(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Gather integrals of z_e, and when it was last outside the settling radius."""
    z_e = row[DISTANCE]
    if t == 0.0:
        seen[OUTSIDE] = -1.0  # not outside so far
    add(seen, INTEGRALS, TIME, weight)
    add(seen, INTEGRALS, ABSOLUTE, weight * z_e)
    add(seen, INTEGRALS, SQUARE, weight * z_e * z_e)
    add(seen, INTEGRALS, TIMED, weight * t * z_e)
    seen[NOW] = t
    if z_e > k.settling_radius:
        seen[OUTSIDE] = t


@kernel
def watch_settled(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Gather the integral of z_e over the steady window, whose first instant has half a weight."""
    if t >= k.steady_from:
        opens = seen[TIME] == 0.0 and t > 0.0
        share = 0.5 * weight if opens else weight
        add(seen, SETTLED, ABSOLUTE, share * row[DISTANCE])
        add(seen, SETTLED, TIME, share)


def _constants(layout: Layout) -> dict[str, float]:
    return {"steady_from": layout.steady_from, "settling_radius": layout.settling_radius}


def _rmse(seen: Vector, step: float) -> float:
    return math.sqrt(seen[SQUARE] / seen[TIME]) if seen[TIME] else math.nan


def _settling_time(seen: Vector, step: float) -> float:
    inside_from = float(seen[OUTSIDE]) + step if seen[OUTSIDE] >= 0.0 else 0.0
    return inside_from if inside_from < seen[NOW] + 0.5 * step else math.nan


OF = Accumulator(watch, lambda layout: SIZE, _constants, INTEGRALS)
OF_SETTLED = Accumulator(watch_settled, lambda layout: 2 * SETTLED, _constants, SETTLED)
iae = Metric(
    "iae", "m s", "integral of z_e", OF, gathered(ABSOLUTE), 1, counts_standoff=True,
    symbol=r"\int z_e\,\mathrm{d}t",
)  # fmt: skip
ise = Metric(
    "ise", "m2 s", "integral of z_e^2", OF, gathered(SQUARE), 1, counts_standoff=True,
    symbol=r"\int z_e^2\,\mathrm{d}t",
)  # fmt: skip
itae = Metric(
    "itae", "m s2", "integral of t z_e", OF, gathered(TIMED), 1, counts_standoff=True,
    symbol=r"\int t\,z_e\,\mathrm{d}t",
)  # fmt: skip
rmse = Metric(
    "rmse", "m", "root of the mean of z_e^2", OF, _rmse, 1, counts_standoff=True,
    symbol=r"\mathrm{rms}(z_e)",
)  # fmt: skip
z_e_steady = Metric(
    "z_e_steady", "m", "mean of z_e over the steady window", OF_SETTLED, ratio(ABSOLUTE, TIME), 1,
    counts_standoff=True,
)  # fmt: skip
settling_time = Metric(
    "settling_time", "s", "time from which z_e stays within the settling radius", OF,
    _settling_time, 1, happens=True, counts_standoff=True,
)  # fmt: skip
