"""Metrics: name, unit and meaning, what is gathered at every step, and the result."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields

import numpy as np

from podusv_cli.core.about import MetricAbout
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.recording import Recording
from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.engine.step.layout import Layout


@dataclass(frozen=True)
class Measured:
    """A loop, the columns of its rows, and the scenario's settings of metrics."""

    loop: ClosedLoop
    plan: Layout
    steady_from: float  # s
    settling_radius: float  # m
    steady_fraction: float

    def column(self, signal: str) -> int:
        """Column of an actuator's signal, of a vector its first number; -1 if there is none."""
        names = [part.name for part in self.loop.actuator.signals_with]
        return self.plan.flags + names.index(signal) if signal in names else -1


Result = Callable[[Vector, float], float]


def standoff_of(layout: Measured) -> dict[str, float]:
    """The distance to the target that the law keeps on purpose, as a constant of a kernel."""
    approach = layout.loop.controller.approach()
    return {"standoff": approach.standoff if approach else 0.0}


# Changes seen at `position`; amounts of the last instant lie `integrals` numbers behind.
@kernel
def add(seen: Vector, integrals: int, position: int, amount: float) -> None:
    """Add to an integral, and store the amount as that of the last instant."""
    seen[position] += amount
    seen[integrals + position] = amount


def close_integrals(seen: Vector, integrals: int, step: float) -> Vector:
    """The gathered numbers (a copy), with half a weight for the last instant of a run cut short.

    The engine gives half a weight only to the last instant of the grid. `seen` (numbers,) is of a
    run, or (numbers, runs) of several; `step` in s.
    """
    whole, added = seen.copy(), seen[integrals : 2 * integrals]
    if integrals:
        # The very first integral is the time, so its last amount tells the last instant's weight
        # A run of its first instant alone has half a weight, too, but no time before it
        at_end = (whole[0] > added[0]) & (added[0] == 0.5 * step)
        sums = whole[:integrals]
        with np.errstate(all="ignore"):  # nothing was added, or the run diverged
            less = np.where(np.isinf(sums), np.inf, sums - 0.5 * step / added[0] * added)
        whole[:integrals] = np.where(at_end, sums, less)
    return whole


@dataclass(frozen=True, eq=False)
class Accumulator:
    """Numbers gathered at every step, logged or not, from which metrics are computed.

    The kernel `watch(t, weight, steady, s, row, k, seen)` is called like a probe's, see
    `Probe`, up to the end of a path that has one (`spans`). `steady` is 1 in the steady window, 0
    before it, and 2 where the window begins anew: what was gathered of it is void. Its `seen` are
    `size` numbers, at first those of `first` and then 0; with size 0 it is left out. It reads
    `constants` from `k`; a name used by several accumulators must have one value. Every run of a
    batch has constants of its own, and the same size. Runs march side by side only with runs of
    equal constants, but for those named in `differing`.

    `of_target`: what is gathered is about the distance to a target. Neither a manoeuvring trial nor
    a path that is followed has one; it is left out there.

    The first `integrals` numbers are integrals over time, made with `add`; the very first is the
    time itself. They are trapezoidal sums over the steps: `weight` [s] is that of the instant.
    """

    watch: Callable[..., None]
    size: Callable[[Measured], int]
    constants: Callable[[Measured], dict[str, float]]
    integrals: int = 0
    differing: tuple[str, ...] = ()
    of_target: bool = False
    first: tuple[float, ...] = ()


@dataclass(frozen=True)
class Metric(MetricAbout):
    """A number that characterises a run; smaller is better for all but a `margin`.

    `result` takes the accumulator's numbers and the step [s], and is NaN for a run that ended
    before the metric is defined. `of_log`, in place of both, is a plain function of the log of a
    run that is over; studies, searches and benches keep no logs, and leave it out. A metric with
    neither is measured beside the runs.
    `place` orders tables. `happens`: the metric is the time of an event, and NaN for a whole run
    means that it never happened. `counts_standoff`: a standoff that a law keeps on purpose makes it
    worse, so that nobody is marked best where there is one. A `margin` is better the larger it is,
    and infinite where nothing is too much; nobody is marked best. `symbol` is LaTeX for a formula,
    "" where words say it better.

    `words` name it in a table, by default its meaning. A `headline` is one of the few numbers that
    a reader sees first.
    """

    accumulator: Accumulator | None = None
    result: Result = lambda seen, step: math.nan
    of_log: Callable[[Recording], float] | None = field(default=None, kw_only=True)

    @property
    def ends_with_path(self) -> bool:
        """Whether it may be gathered on a path that has an end, and then ends there."""
        gathered_there = self.accumulator is not None and not self.accumulator.of_target
        return gathered_there or self.of_log is not None

    @property
    def about(self) -> MetricAbout:
        """The metric without its functions."""
        return MetricAbout(**{own.name: getattr(self, own.name) for own in fields(MetricAbout)})


def gathered(position: int) -> Result:
    """The result that is the number gathered at this position."""
    return lambda seen, step: float(seen[position])


def ratio(position: int, whole: int) -> Result:
    """The result that is the number gathered at `position` over that at `whole`; NaN over 0."""
    return lambda seen, step: float(seen[position] / seen[whole]) if seen[whole] else math.nan
