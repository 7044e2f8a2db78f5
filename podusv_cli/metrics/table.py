"""All metrics, and one kernel that gathers for all of them at every step."""

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
from podusv_cli.metrics.metric import Accumulator, Layout, Metric, close_integrals

_found = registry.named("podusv_cli.metrics", Metric).values()
METRICS: dict[str, Metric] = {m.name: m for m in sorted(_found, key=lambda m: m.place)}

CLOCKED = tuple(m.name for m in _found if m.unit == "ns")  # measured times, which never repeat

Parts = tuple[tuple[Accumulator, int], ...]
COUNT = 0  # placeholder: how many numbers `first_kernel` gathers


@kernel
def first_kernel(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Placeholder of the first accumulator's kernel; does nothing after the last one."""


@kernel
def other_kernels(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Placeholder of the other accumulators' kernel."""


def chained(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Call the first kernel, then the others."""
    first_kernel(t, weight, s, row, k, seen)
    other_kernels(t, weight, s, row, k, tail(seen, COUNT))


@cache
def _watch(parts: Parts) -> Callable[..., None]:
    """One kernel that calls those of all parts, each with the numbers that follow the last's."""
    if not parts:
        return first_kernel
    (first, count), *others = parts
    kernels = {"first_kernel": first.watch, "other_kernels": _watch(tuple(others))}
    return specialise(chained, "metrics", COUNT=count, **kernels)  # type: ignore[no-any-return]


@dataclass(frozen=True)
class Metrics(Observer):
    """An observer for `engine.simulate` that gathers the numbers of all metrics."""

    parts: Parts = ()
    step: float = 0.0

    def summary(self, seen: Vector) -> dict[str, float]:
        """Metrics by name; NaN where a run ended before one is defined."""
        if not seen.any():  # no instant at all
            seen = np.full_like(seen, np.nan)
        ends = np.cumsum([size for _, size in self.parts])[:-1]
        own = {
            part: close_integrals(numbers, part.integrals, self.step)
            for (part, _), numbers in zip(self.parts, np.split(seen, ends), strict=True)
        }
        return {
            metric.name: metric.result(own[metric.accumulator], self.step)
            for metric in METRICS.values()
            if metric.accumulator in own
        }

    def summaries(self, seen: Vector) -> dict[str, Vector]:
        """Metrics by name, with one number per run, from rows of gathered numbers (`Batch.seen`).

        NaN where a run ended before a metric is defined; all NaN for a run that never began.
        """
        each = [self.summary(row) for row in seen]
        names = self.summary(np.full(self.size, np.nan))
        return {name: np.array([metrics[name] for metrics in each]) for name in names}


def observer(
    loop: ClosedLoop, grid: TimeGrid, *, steady_fraction: float, settling_radius: float
) -> Metrics:
    """The observer of all metrics that this loop has."""
    layout = Layout(loop, loop.layout(grid), grid.last_part(steady_fraction), settling_radius)
    accumulators = dict.fromkeys(m.accumulator for m in METRICS.values() if m.accumulator)
    parts = tuple((part, part.size(layout)) for part in accumulators if part.size(layout))
    constants: dict[str, float] = {}
    for part, _ in parts:
        for name, number in part.constants(layout).items():
            if constants.setdefault(name, number) != number:
                raise ValueError(f"two accumulators use {name!r} for different numbers")
    return Metrics(_watch(parts), constants, sum(size for _, size in parts), parts, grid.step)
