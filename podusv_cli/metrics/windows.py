"""Metrics that a scenario names: the error over a window of the path, settling to a radius."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

from podusv_cli.core.kernel import Vector, kernel, specialise
from podusv_cli.engine.step.layout import DISTANCE
from podusv_cli.metrics.metric import Accumulator, Metric, Result, standoff_of

NAMED = "NAME"  # stands for a scenario's word in the name of a metric
NEAR = 1e-9  # s; an instant this near to an end of a window belongs to it
FROM, TO, RADIUS = math.inf, math.inf, 0.0  # placeholders of one window [s] and one radius [m]
LENGTH, SQUARE, LARGEST, BEYOND, NOW, LAST, WINDOW = range(7)
CROSSED, BEFORE, DISTANCE_BEFORE, SETTLING = range(4)

Windows = tuple[tuple[str, tuple[float, float]], ...]  # from and to [s]
Radii = tuple[tuple[str, float], ...]  # m
NONE: tuple[Windows, Radii] = ((), ())


@kernel
def window(t: float, row: Vector, k: Any, seen: Vector) -> None:
    """Gather z_e^2 from one instant to the next, both in the window, and the largest errors."""
    z_e = row[DISTANCE]
    if t >= FROM - NEAR and t <= TO + NEAR:
        if t > 0.0 and seen[NOW] >= FROM - NEAR:
            seen[LENGTH] += t - seen[NOW]
            seen[SQUARE] += 0.5 * (t - seen[NOW]) * (z_e * z_e + seen[LAST] * seen[LAST])
        seen[LARGEST] = max(seen[LARGEST], z_e)
        seen[BEYOND] = max(seen[BEYOND], abs(z_e - k.standoff))
    seen[NOW], seen[LAST] = t, z_e


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


@kernel
def within(t: float, row: Vector, seen: Vector) -> None:
    """Gather when z_e last came within the radius."""
    settle(t, row[DISTANCE], RADIUS, 0, seen)


def settled_from(crossed: float) -> float:
    """When z_e last came within a radius [s]; NaN where it is beyond at the end of the run."""
    return float(crossed) if crossed < math.inf else math.nan


ERROR_RMS = Metric(
    f"error_{NAMED}_rms", "m", "rms of z_e over a window that `metrics.windows` names",
    place=2, counts_standoff=True,
)  # fmt: skip
ERROR_MAX = Metric(
    f"error_{NAMED}_max", "m", "largest z_e in a window that `metrics.windows` names",
    place=2, counts_standoff=True,
)  # fmt: skip
BEYOND_MAX = Metric(
    f"e_{NAMED}_max",
    "m",
    "largest |z_e - standoff| in a window that `metrics.windows` names",
    place=2,
)
SETTLED = Metric(
    f"settling_time_{NAMED}", "s", "time from which z_e stays within a radius of `metrics.radii`",
    place=2, happens=True, counts_standoff=True,
)  # fmt: skip


def _over(to: float, number: Callable[[Vector], float]) -> Result:
    """A number of a window; NaN for a run that ended before it."""
    return lambda seen, step: number(seen) if seen[NOW] >= to - NEAR else math.nan


def _rms(seen: Vector) -> float:
    return math.sqrt(seen[SQUARE] / seen[LENGTH]) if seen[LENGTH] else math.nan


def _named(
    template: Metric, name: str, meaning: str, of: Accumulator, result: Result, words: str
) -> Metric:  # fmt: skip
    return replace(
        template, name=template.name.replace(NAMED, name), meaning=meaning, accumulator=of,
        result=result, words=words,
    )  # fmt: skip


def _of_window(name: str, start: float, to: float) -> tuple[Metric, ...]:
    watch = specialise(window, f"window_{name}", FROM=start, TO=to)
    of = Accumulator(
        watch, lambda layout: WINDOW, standoff_of, differing=("standoff",), of_target=True
    )
    span = f"from {start:g} s to {to:g} s"
    largest = _over(to, lambda seen: float(seen[LARGEST]) if seen[LENGTH] else math.nan)
    beyond = _over(to, lambda seen: float(seen[BEYOND]) if seen[LENGTH] else math.nan)
    return (
        _named(
            ERROR_RMS, name, f"rms of z_e {span}", of, _over(to, _rms), f"rms distance {span}"
        ),
        _named(ERROR_MAX, name, f"largest z_e {span}", of, largest, f"largest distance {span}"),
        _named(
            BEYOND_MAX, name, f"largest |z_e - standoff| {span}", of, beyond,
            f"largest error beyond the standoff {span}",
        ),
    )  # fmt: skip


def _of_radius(name: str, radius: float) -> Metric:
    watch = specialise(within, f"within_{name}", RADIUS=radius)
    of = Accumulator(watch, lambda layout: SETTLING, lambda layout: {}, of_target=True)
    meaning = f"time from which z_e stays within {radius:g} m"
    return _named(
        SETTLED, name, meaning, of, lambda seen, step: settled_from(seen[CROSSED]),
        f"within {radius:g} m after",
    )  # fmt: skip


@cache  # an accumulator's numbers are found by the accumulator itself
def named(windows: Windows, radii: Radii) -> dict[str, Metric]:
    """The metrics of these windows and radii, by name."""
    metrics = [metric for name, ends in windows for metric in _of_window(name, *ends)]
    metrics += [_of_radius(name, radius) for name, radius in radii]
    return {metric.name: metric for metric in metrics}


def find(name: str, known: Mapping[str, Metric]) -> Metric | None:
    """The metric of this name, of which a scenario may have chosen a part; None for no metric."""
    word = "[a-z][a-z0-9_]*"
    fits = (m for m in known.values() if re.fullmatch(m.name.replace(NAMED, word), name))
    return known.get(name) or next(fits, None)
