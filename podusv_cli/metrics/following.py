"""Metrics of a path that is followed without a timetable: how near, how far, how long."""

from __future__ import annotations

import math
from typing import Any

from podusv_cli.components.paths.legs import E_CT, PLACES
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.metrics.metric import Accumulator, Measured, Metric, add, gathered, ratio
from podusv_cli.metrics.spans import ANEW, WITHIN

# Positions of the gathered numbers: integrals over the run, then what is no integral.
TIME, ABSOLUTE, SQUARE, LATE, LATE_ERROR, INTEGRALS = range(6)
LARGEST = 2 * INTEGRALS
SIZE = LARGEST + 1
DONE, ARRIVED, OF_WAY_SIZE = range(3)


# Arguments as those of `spans.all_kernels`; changes `seen`.
@kernel
def watch(t: float, weight: float, steady: float, s: Vector, k: Any, seen: Vector) -> None:
    """Gather the cross-track error."""
    error = abs(s[int(k.place) + E_CT])
    add(seen, INTEGRALS, TIME, weight)
    add(seen, INTEGRALS, ABSOLUTE, weight * error)
    add(seen, INTEGRALS, SQUARE, weight * error * error)
    if steady == ANEW:
        seen[LATE] = seen[LATE_ERROR] = 0.0
    late = weight if steady >= WITHIN else 0.0
    add(seen, INTEGRALS, LATE, late)
    add(seen, INTEGRALS, LATE_ERROR, late * error)
    seen[LARGEST] = max(seen[LARGEST], error)


# Arguments as those of `spans.all_kernels`; changes `seen`.
@kernel
def watch_way(t: float, s: Vector, k: Any, seen: Vector) -> None:
    """Gather how many of the path's parts are done."""
    done = s[int(k.done_at)]
    if done >= k.parts and seen[DONE] < 1.0:
        seen[ARRIVED] = t
    seen[DONE] = done / k.parts


def _constants(layout: Measured) -> dict[str, float]:
    """Where the place on the path is in the states."""
    return {"place": float(layout.plan.place)}


def _parts(layout: Measured) -> dict[str, float]:
    """The place that counts legs or stations, and how many there are; none of other paths."""
    names = {signal.name for signal in layout.loop.path.places}
    first = [*layout.loop.passed_by(1.0).items()][:1]
    return {name: parts for name, parts in first if name in names and parts > 0.0}


def _way_constants(layout: Measured) -> dict[str, float]:
    """Where that place is in the states, and how many parts the path has."""
    names = [signal.name for signal in layout.loop.path.places]
    ((name, parts),) = _parts(layout).items()
    return {"done_at": float(layout.plan.place + names.index(name)), "parts": parts}


def _rms(seen: Vector, step: float) -> float:
    """Root of the mean squared cross-track error [m]; NaN over no time."""
    return math.sqrt(seen[SQUARE] / seen[TIME]) if seen[TIME] else math.nan


def _size(layout: Measured) -> int:
    """How many numbers are gathered; none where no law follows a path with a cross-track error."""
    places = layout.loop.path.places[: len(PLACES)]
    # Legs whose last waypoint is held have one place more behind these
    follows = places == PLACES and layout.loop.controller.aims()
    return SIZE if follows else 0


OF = Accumulator(watch, _size, _constants, INTEGRALS)
OF_WAY = Accumulator(watch_way, lambda layout: OF_WAY_SIZE * bool(_parts(layout)), _way_constants)
e_ct_integral = Metric(
    "e_ct_integral",
    "m s",
    "integral of the cross-track error's size",
    OF,
    gathered(ABSOLUTE),
    place=1,
    words="cross-track error, integrated",
    headline=True,
)
e_ct_rms = Metric(
    "e_ct_rms",
    "m",
    "rms of the cross-track error",
    OF,
    _rms,
    place=1,
    words="cross-track error, rms",
)
e_ct_max = Metric(
    "e_ct_max",
    "m",
    "largest cross-track error, which begins anew at each change of legs, with up to `acceptance`",
    OF,
    lambda seen, step: float(seen[LARGEST]),
    place=1,
    words="largest cross-track error",
    headline=True,
)
e_ct_steady = Metric(
    "e_ct_steady",
    "m",
    "mean of the cross-track error's size over the steady window",
    OF,
    ratio(LATE_ERROR, LATE),
    place=1,
    words="steady cross-track error",
    headline=True,
)
path_time = Metric(
    "path_time",
    "s",
    "time at which all legs are done, within `acceptance` of the last waypoint, or all stations",
    OF_WAY,
    lambda seen, step: float(seen[ARRIVED]) if seen[DONE] == 1.0 else math.nan,
    place=1,
    happens=True,
    words="path done after",
    headline=True,
)
path_done = Metric(
    "path_done",
    "1",
    "share of the legs or stations that are done at the end",
    OF_WAY,
    lambda seen, step: float(seen[DONE]),
    place=1,
    margin=True,
    words="share of the path done",
    headline=True,
)
