"""Metrics that a scenario names: the error over a window of the path, settling to a radius."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

from podusv_cli.core.kernel import Vector, kernel, tail
from podusv_cli.engine.step.layout import DISTANCE
from podusv_cli.metrics.metric import Accumulator, Metric, Result, standoff_of

NAMED = "NAME"  # stands for a scenario's word in the name of a metric
NEAR = 1e-9  # s; an instant this near to an end of a window belongs to it
# Positions of what is gathered: the instant before; then each window, and then each radius.
NOW, LAST, EACH = range(3)
FROM, TO, LENGTH, SQUARE, LARGEST, BEYOND, WINDOW = range(7)
CROSSED, BEFORE, DISTANCE_BEFORE, SETTLING = range(4)
RADIUS = 1 + SETTLING  # the radius itself, and what `settle` gathers

Windows = tuple[tuple[str, tuple[float, float]], ...]  # from and to [s]
Radii = tuple[tuple[str, float], ...]  # m
NONE: tuple[Windows, Radii] = ((), ())


# t [s], z_e [m]; `before` [s] and `z_e_before` [m] are of the last instant; `own` are this window's
# numbers in seen.
@kernel
def window(
    t: float, z_e: float, standoff: float, before: float, z_e_before: float, own: Vector
) -> None:
    """Gather z_e^2 from one instant to the next, both in the window, and the largest errors."""
    if t >= own[FROM] - NEAR and t <= own[TO] + NEAR:
        if t > 0.0 and before >= own[FROM] - NEAR:
            own[LENGTH] += t - before
            own[SQUARE] += 0.5 * (t - before) * (z_e * z_e + z_e_before * z_e_before)
        own[LARGEST] = max(own[LARGEST], z_e)
        own[BEYOND] = max(own[BEYOND], abs(z_e - standoff))


# t [s], z_e and radius [m]; changes seen from `at` on.
@kernel
def settle(t: float, z_e: float, radius: float, at: int, seen: Vector) -> None:
    """Gather when z_e last came within the radius, by a straight line between two instants.

    The numbers stand from `at` on, 0 before the run. The time is infinite while z_e is beyond.
    """
    if z_e > radius:
        seen[at + CROSSED] = math.inf
    elif seen[at + CROSSED] == math.inf:
        before, beyond = seen[at + BEFORE], seen[at + DISTANCE_BEFORE] - radius
        seen[at + CROSSED] = before + (t - before) * beyond / (beyond + radius - z_e)
    seen[at + BEFORE], seen[at + DISTANCE_BEFORE] = t, z_e


# Arguments as those of `spans.all_kernels`. Changes `seen`: time and z_e of the last instant, then
# windows, then radii.
@kernel
def watch(t: float, row: Vector, k: Any, seen: Vector) -> None:
    """Gather over each window, and when z_e last came within each radius.

    Their numbers are data in `seen`, not in the code: one kernel serves any windows and radii.
    """
    z_e, at = row[DISTANCE], EACH
    for _ in range(int(k.own_windows)):
        window(t, z_e, k.standoff, seen[NOW], seen[LAST], tail(seen, at))
        at += WINDOW
    for _ in range(int(k.own_radii)):
        settle(t, z_e, seen[at], at + 1, seen)
        at += RADIUS
    seen[NOW], seen[LAST] = t, z_e


def settled_from(crossed: float) -> float:
    """When z_e last came within a radius [s]; NaN where it is beyond at the end of the run."""
    return float(crossed) if crossed < math.inf else math.nan


ERROR_RMS = Metric(
    f"error_{NAMED}_rms",
    "m",
    "rms of z_e over a window that `metrics.windows` names",
    place=2,
    counts_standoff=True,
)
ERROR_MAX = Metric(
    f"error_{NAMED}_max",
    "m",
    "largest z_e in a window that `metrics.windows` names",
    place=2,
    counts_standoff=True,
)
BEYOND_MAX = Metric(
    f"e_{NAMED}_max",
    "m",
    "largest |z_e - standoff| in a window that `metrics.windows` names",
    place=2,
)
SETTLED = Metric(
    f"settling_time_{NAMED}",
    "s",
    "time from which z_e stays within a radius of `metrics.radii`",
    place=2,
    happens=True,
    counts_standoff=True,
)


def _over(to: float, at: int, number: Callable[[Vector], float]) -> Result:
    """A number of the window that stands at this place; NaN for a run that ended before it."""
    return lambda seen, step: number(seen[at : at + WINDOW]) if seen[NOW] >= to - NEAR else math.nan


def _rms(own: Vector) -> float:
    """The root of the mean square [m] of a window's own numbers; NaN for one of no length."""
    return math.sqrt(own[SQUARE] / own[LENGTH]) if own[LENGTH] else math.nan


def _at(position: int) -> Callable[[Vector], float]:
    """What a window's numbers have at a position; NaN for a window that no instant was in."""
    return lambda own: float(own[position]) if own[LENGTH] else math.nan


def _name_metric(
    template: Metric, name: str, meaning: str, of: Accumulator, result: Result, words: str
) -> Metric:
    """The metric `template` of a family under the name that a scenario asked for."""
    return replace(
        template,
        name=template.name.replace(NAMED, name),
        meaning=meaning,
        accumulator=of,
        result=result,
        words=words,
    )


def _of_window(name: str, start: float, to: float, of: Accumulator, at: int) -> tuple[Metric, ...]:
    """The metrics of the window `name`, from `start` to `to` [s].

    Its numbers stand from `at` on among those of the accumulator `of`.
    """
    span = f"from {start:g} s to {to:g} s"
    rms, largest, beyond = (_over(to, at, f) for f in (_rms, _at(LARGEST), _at(BEYOND)))
    return (
        _name_metric(ERROR_RMS, name, f"rms of z_e {span}", of, rms, f"rms distance {span}"),
        _name_metric(
            ERROR_MAX, name, f"largest z_e {span}", of, largest, f"largest distance {span}"
        ),
        _name_metric(
            BEYOND_MAX,
            name,
            f"largest |z_e - standoff| {span}",
            of,
            beyond,
            f"largest error beyond the standoff {span}",
        ),
    )


def _of_radius(name: str, radius: float, of: Accumulator, at: int) -> Metric:
    """The metric of the `radius` [m] called `name`.

    Its numbers stand from `at` on among those of the accumulator `of`.
    """
    meaning = f"time from which z_e stays within {radius:g} m"
    return _name_metric(
        SETTLED,
        name,
        meaning,
        of,
        lambda seen, step: settled_from(seen[at + 1 + CROSSED]),
        f"within {radius:g} m after",
    )


@cache  # a probe finds an accumulator's numbers by the accumulator itself
def accumulator(windows: Windows, radii: Radii) -> Accumulator:
    """What gathers for these windows [s] and radii [m]; also for none, so the code is the same."""
    # The first numbers carry the ends and the radii: they are data of the run, not of the code
    blank = [0.0] * EACH
    of_windows = [x for _, ends in windows for x in (*ends, *[0.0] * (WINDOW - 2))]
    of_radii = [x for _, radius in radii for x in (radius, *[0.0] * SETTLING)]
    first = (*blank, *of_windows, *of_radii)
    counts = {"own_windows": float(len(windows)), "own_radii": float(len(radii))}
    return Accumulator(
        watch,
        lambda layout: len(first),
        lambda layout: standoff_of(layout) | counts,
        differing=("standoff",),
        of_target=True,
        first=first,
    )


@cache
def metrics_of_windows(windows: Windows, radii: Radii) -> dict[str, Metric]:
    """The metrics of these windows and radii, by name, with places in `accumulator`'s numbers."""
    of, after = accumulator(windows, radii), EACH + WINDOW * len(windows)
    metrics = [
        metric
        for i, (name, ends) in enumerate(windows)
        for metric in _of_window(name, *ends, of, EACH + WINDOW * i)
    ]
    metrics += [
        _of_radius(name, radius, of, after + RADIUS * i) for i, (name, radius) in enumerate(radii)
    ]
    return {metric.name: metric for metric in metrics}


def find(name: str, known: Mapping[str, Metric]) -> Metric | None:
    """The metric of this name; None for no metric.

    A name that a scenario chose, as `error_approach_rms`, fits the family `error_NAME_rms`.
    """
    word = "[a-z][a-z0-9_]*"
    fits = (m for m in known.values() if re.fullmatch(m.name.replace(NAMED, word), name))
    return known.get(name) or next(fits, None)
