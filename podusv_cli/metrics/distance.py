"""Metrics of the distance z_e to the target, as a whole, beyond a standoff, across and along."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.engine.step.layout import DISTANCE
from podusv_cli.metrics.metric import (
    Accumulator,
    Measured,
    Metric,
    Result,
    add,
    gathered,
    ratio,
    standoff_of,
)
from podusv_cli.metrics.spans import ANEW, WITHIN
from podusv_cli.metrics.windows import CROSSED, SETTLING, settle, settled_from

# Positions of the gathered numbers: integrals over the run, and over the steady window.
TIME, ABSOLUTE, ERROR, SQUARE, TIMED, INTEGRALS = range(6)
RADIUS = 2 * INTEGRALS
ACROSS, ALONG, SETTLED = range(3, 6)


# Arguments as those of `spans.all_kernels`; changes `seen`. TIMED is for errors weighted with the
# time.
@kernel
def watch(t: float, weight: float, row: Vector, k: Any, seen: Vector) -> None:
    """Gather integrals of z_e and |z_e - standoff|, and when z_e came within a radius."""
    z_e = row[DISTANCE]
    add(seen, INTEGRALS, TIME, weight)
    add(seen, INTEGRALS, ABSOLUTE, weight * z_e)
    add(seen, INTEGRALS, ERROR, weight * abs(z_e - k.standoff))
    add(seen, INTEGRALS, SQUARE, weight * z_e * z_e)
    add(seen, INTEGRALS, TIMED, weight * t * z_e)
    settle(t, z_e, k.settling_radius, RADIUS, seen)


# Arguments as those of `spans.all_kernels`; changes `seen`.
@kernel
def watch_settled(
    t: float, weight: float, steady: float, s: Vector, row: Vector, k: Any, seen: Vector
) -> None:
    """Gather z_e, the error and the squared path errors over the steady window.

    The window's first instant has half a weight. Across is positive to the right of the target's
    course, along ahead of it. While the target stands still both count as zero.
    """
    if steady == ANEW:
        for i in range(2 * SETTLED):
            seen[i] = 0.0
    if steady >= WITHIN:
        opens = seen[TIME] == 0.0 and t > 0.0
        share = 0.5 * weight if opens else weight
        x, y = s[0] - row[0], s[1] - row[1]
        speed = max(math.sqrt(row[2] * row[2] + row[3] * row[3]), 1e-300)
        across, along = (y * row[2] - x * row[3]) / speed, (x * row[2] + y * row[3]) / speed
        add(seen, SETTLED, TIME, share)
        add(seen, SETTLED, ABSOLUTE, share * row[DISTANCE])
        add(seen, SETTLED, ERROR, share * abs(row[DISTANCE] - k.standoff))
        add(seen, SETTLED, ACROSS, share * across * across)
        add(seen, SETTLED, ALONG, share * along * along)


def _constants(layout: Measured) -> dict[str, float]:
    """The standoff [m] and the settling radius [m]."""
    return standoff_of(layout) | {"settling_radius": layout.settling_radius}


def _rmse(seen: Vector, step: float) -> float:
    """Root of the mean square over the time; NaN before any time is over."""
    return math.sqrt(seen[SQUARE] / seen[TIME]) if seen[TIME] else math.nan


def _settling_time(seen: Vector, step: float) -> float:
    """When z_e last came within the settling radius [s]; NaN where it is beyond at the end."""
    return settled_from(seen[RADIUS + CROSSED])


def _rms(position: int) -> Result:
    """The result that is the root of the mean of a gathered integral."""
    mean = ratio(position, TIME)
    return lambda seen, step: math.sqrt(mean(seen, step))


_of_target = partial(Accumulator, differing=("standoff",), of_target=True)
OF = _of_target(watch, lambda layout: RADIUS + SETTLING, _constants, INTEGRALS)
OF_SETTLED = _of_target(watch_settled, lambda layout: 2 * SETTLED, _constants, SETTLED)
iae = Metric(
    "iae",
    "m s",
    "integral of z_e",
    OF,
    gathered(ABSOLUTE),
    place=1,
    counts_standoff=True,
    symbol=r"\int z_e\,\mathrm{d}t",
    words="distance to the target, integrated",
)
ise = Metric(
    "ise",
    "m2 s",
    "integral of z_e^2",
    OF,
    gathered(SQUARE),
    place=1,
    counts_standoff=True,
    symbol=r"\int z_e^2\,\mathrm{d}t",
    words="squared distance to the target, integrated",
)
iae_of_optimum = Metric(
    "iae_of_optimum",
    "1",
    "iae over that of the optimum of the same task",
    place=1,
    counts_standoff=True,
    words="integrated distance over that of the optimum",
    headline=True,
)
ise_of_optimum = Metric(
    "ise_of_optimum",
    "1",
    "ise over that of the optimum of the same task",
    place=1,
    counts_standoff=True,
    words="integrated squared distance over that of the optimum",
)
OF_OPTIMUM = {"iae": iae_of_optimum, "ise": ise_of_optimum}  # known to comparisons only
itae = Metric(
    "itae",
    "m s2",
    "integral of t z_e",
    OF,
    gathered(TIMED),
    place=1,
    counts_standoff=True,
    symbol=r"\int t\,z_e\,\mathrm{d}t",
    words="distance to the target times time, integrated",
)
rmse = Metric(
    "rmse",
    "m",
    "root of the mean of z_e^2",
    OF,
    _rmse,
    place=1,
    counts_standoff=True,
    symbol=r"\mathrm{rms}(z_e)",
    words="distance to the target, rms",
)
z_e_steady = Metric(
    "z_e_steady",
    "m",
    "mean of z_e over the steady window",
    OF_SETTLED,
    ratio(ABSOLUTE, TIME),
    place=1,
    counts_standoff=True,
    words="steady distance to the target",
)
settling_time = Metric(
    "settling_time",
    "s",
    "time from which z_e stays within the settling radius",
    OF,
    _settling_time,
    place=1,
    happens=True,
    counts_standoff=True,
    words="settled after",
    headline=True,
)
iae_e = Metric(
    "iae_e",
    "m s",
    "integral of |z_e - standoff|",
    OF,
    gathered(ERROR),
    place=2,
    words="tracking error, integrated",
    headline=True,
)
e_steady = Metric(
    "e_steady",
    "m",
    "mean of |z_e - standoff| over the steady window",
    OF_SETTLED,
    ratio(ERROR, TIME),
    place=2,
    words="steady tracking error",
    headline=True,
)
cross_track_rms = Metric(
    "cross_track_rms",
    "m",
    "rms distance from the target across its course, steady window",
    OF_SETTLED,
    _rms(ACROSS),
    place=2,
    words="steady error across the course, rms",
)
along_track_rms = Metric(
    "along_track_rms",
    "m",
    "rms distance from the target along its course, steady window",
    OF_SETTLED,
    _rms(ALONG),
    place=2,
    counts_standoff=True,
    words="steady error along the course, rms",
)
