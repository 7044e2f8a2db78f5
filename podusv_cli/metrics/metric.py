"""A metric in one place: what is gathered for it at every step, result, unit and meaning."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.engine.closed_loop import Plan
from podusv_cli.engine.simulate import ClosedLoop


@dataclass(frozen=True)
class Layout:
    """A loop, where its row has what, and what the scenario says about metrics."""

    loop: ClosedLoop
    plan: Plan
    steady_from: float  # s
    settling_radius: float  # m

    def column(self, signal: str) -> int:
        """Where the row has an actuator's signal, of a vector its first number; -1 for nowhere."""
        names = [part.name for part in self.loop.actuator.signals]
        return self.plan.flags + names.index(signal) if signal in names else -1


Result = Callable[[Vector, float], float]


@kernel
def add(seen: Vector, integrals: int, position: int, amount: float) -> None:
    """Add to an integral, and note what the last instant added to it."""
    seen[position] += amount
    seen[integrals + position] = amount


def closed(seen: Vector, integrals: int, step: float) -> Vector:
    """The gathered numbers with integrals up to the last instant, which counts half.

    The engine gives half a weight at the end of the grid only, so where a run was cut short the
    other half of what its last instant added is taken out again.
    """
    whole, added = seen.copy(), seen[integrals : 2 * integrals]
    if not integrals or whole[0] > added[0] == 0.5 * step:
        return whole
    with np.errstate(all="ignore"):  # nothing was added, or a run that diverges
        less = whole[:integrals] - 0.5 * step / added[0] * added
        whole[:integrals] = np.where(np.isinf(whole[:integrals]), np.inf, less)
    return whole


@dataclass(frozen=True)
class Accumulator:
    """What one or several metrics are read from, gathered at every step whatever the log keeps.

    `watch(t, weight, s, row, k, seen)` is a kernel like an observer's, see `engine.simulate`. Its
    `seen` are `size` numbers of its own, 0 at first; where the size is 0 the loop has nothing for
    it. `constants` are what it reads from `k`; names that several use have to mean the same.

    The first `integrals` numbers are integrals over time, made with `add`; the first of them is the
    time itself. They are trapezoidal on the grid of steps: `weight` [s] is that of the instant.
    """

    watch: Callable[..., None]
    size: Callable[[Layout], int]
    constants: Callable[[Layout], dict[str, float]]
    integrals: int = 0


@dataclass(frozen=True)
class Metric:
    """A number that sums up a run; smaller is better for all of them.

    `result` takes what `of` has gathered and the step [s]; NaN where a run ended before the metric
    is defined. A metric without `of` comes from elsewhere. `place` orders tables.
    """

    name: str
    unit: str
    meaning: str
    of: Accumulator | None = None
    result: Result = lambda seen, step: math.nan
    place: int = 100


def ratio(number: float, whole: float) -> float:
    """number/whole, NaN for nothing at all."""
    return float(number / whole) if whole else math.nan


def entry(position: int) -> Result:
    """The gathered number at this position as it is."""
    return lambda seen, step: float(seen[position])


def part(position: int, whole: int) -> Result:
    """One gathered number in parts of another."""
    return lambda seen, step: ratio(seen[position], seen[whole])
