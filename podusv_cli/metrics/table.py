"""Every metric of this room, and one kernel that gathers at every step what they need."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from podusv_cli.core import registry
from podusv_cli.core.kernel import Vector, kernel, specialise, tail
from podusv_cli.engine.grid import TimeGrid
from podusv_cli.engine.simulate import ClosedLoop, Observer
from podusv_cli.metrics.metric import Accumulator, Layout, Metric, closed

_found = registry.named("podusv_cli.metrics", Metric).values()
METRICS: dict[str, Metric] = {m.name: m for m in sorted(_found, key=lambda m: m.place)}

CLOCKED = tuple(m.name for m in _found if m.unit == "ns")  # a clock's readings; they never repeat

Parts = tuple[tuple[Accumulator, int], ...]
COUNT = 0  # stands for how many numbers `here` gathers


@kernel
def here(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Stands for the first accumulator's kernel; does nothing behind the last one."""


@kernel
def rest(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Stands for the kernel of the other accumulators."""


def both(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Take in one instant."""
    here(t, weight, s, row, k, seen)
    rest(t, weight, s, row, k, tail(seen, COUNT))


@cache
def _watch(parts: Parts) -> Callable[..., None]:
    """One kernel for all parts; each sees the numbers behind those of the parts before it."""
    if not parts:
        return here
    (first, count), *others = parts
    rest_of_them = _watch(tuple(others))
    return specialise(both, "metrics", here=first.watch, rest=rest_of_them, COUNT=count)  # type: ignore[no-any-return]


@dataclass(frozen=True)
class Metrics(Observer):
    """An observer for `engine.simulate`, with what it gathers and the step [s]."""

    parts: Parts = ()
    step: float = 0.0

    def summary(self, seen: Vector) -> dict[str, float]:
        """Metrics by name from what was gathered; NaN where a run ended before one is defined."""
        if not seen.any():  # no instant at all
            seen = np.full_like(seen, np.nan)
        ends = np.cumsum([size for _, size in self.parts])[:-1]
        own = {
            part: closed(numbers, part.integrals, self.step)
            for (part, _), numbers in zip(self.parts, np.split(seen, ends), strict=True)
        }
        return {
            metric.name: metric.result(own[metric.of], self.step)
            for metric in METRICS.values()
            if metric.of in own
        }

    def summaries(self, seen: Vector) -> dict[str, Vector]:
        """Metrics by name, one number a run, from rows of what was gathered (`Batch.seen`).

        NaN where a run ended before a metric is defined, and throughout for one that never began.
        """
        each = [self.summary(row) for row in seen]
        names = self.summary(np.full(self.size, np.nan))
        return {name: np.array([metrics[name] for metrics in each]) for name in names}


def observer(
    loop: ClosedLoop, grid: TimeGrid, *, steady_fraction: float, settling_radius: float
) -> Metrics:
    """What gathers all metrics of this loop's runs."""
    layout = Layout(loop, loop.layout(grid), grid.last_part(steady_fraction), settling_radius)
    accumulators = dict.fromkeys(metric.of for metric in METRICS.values() if metric.of)
    parts = tuple((part, part.size(layout)) for part in accumulators if part.size(layout))
    constants: dict[str, float] = {}
    for part, _ in parts:
        for name, number in part.constants(layout).items():
            if constants.setdefault(name, number) != number:
                raise ValueError(f"two accumulators mean different numbers by {name!r}")
    return Metrics(_watch(parts), constants, sum(size for _, size in parts), parts, grid.step)
