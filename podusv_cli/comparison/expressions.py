"""The small language in which a claim is put: parsed, checked, computed; never run as Python.

    max(abs(proposed.tau_u)) == 300
    proposed.iae < li.iae < pid.iae
    mean(proposed.z_e, 200, 310) / mean(pid.z_e, 200, 310) < 0.5
    finished(proposed) and not finished(pid)

`run.metric` is a metric, `run.signal` a logged signal. `abs`, `rate` and `hypot` turn signals into
signals; `max`, `min`, `mean`, `final`, `variation` and `integral` turn a signal into a number,
over the whole run or between two times [s]. `==` means near, within the claim's tolerance.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.signal import Signal
from podusv_cli.metrics.table import METRICS

NEAR = 1e-9  # s; times closer than this are the same


class Source(Protocol):
    """What an expression can ask of a run."""

    @property
    def until(self) -> float:
        """The time up to which the run was simulated [s]."""

    @property
    def every(self) -> int:
        """How many steps a logged instant is after the one before; 1 where each is logged."""

    @property
    def ending(self) -> str:
        """Why the run did not reach its end, as `diverged at t = 2 s`; empty where it did."""

    @property
    def about(self) -> Mapping[str, Signal]:
        """What the run logs."""

    def metric(self, name: str) -> float:
        """A metric; NaN where the run has none of this name."""

    def signal(self, name: str) -> Vector:
        """A logged signal; empty where the run has none of this name."""

    def check(self, name: str) -> bool | None:
        """Whether a named property of the run holds; None where that cannot be told."""


Sources = Mapping[str, Source]


class Untold(Exception):
    """A number that the runs do not give; the text says which one, and why."""


@dataclass(frozen=True)
class Reach:
    """How far a run goes, and how much of it is logged; see `Source`."""

    run: str
    until: float
    ending: str
    every: int

    def thinned(self, text: str) -> Untold:
        """The doubt about what this text asks of a log that leaves steps out."""
        return Untold(
            f"{text}: {self.run} logs one step in {self.every} only, and nobody knows what was in "
            "between; log each (log.every: 1), or use a metric, which sees every step"
        )


@dataclass(frozen=True)
class Curve:
    """A signal over time, made from the signals of these runs."""

    time: Vector
    values: Vector
    reaches: tuple[Reach, ...]


Quantity = float | Curve


class Term(Protocol):
    """A part of an expression that has a value."""

    @property
    def curve(self) -> bool:
        """Whether the value is a curve."""

    def value(self, runs: Sources) -> Quantity:
        """A number, or a curve where `curve` says so. Raises Untold."""


@dataclass(frozen=True)
class Number:
    """A number written down."""

    number: float
    curve = False

    def value(self, runs: Sources) -> Quantity:
        """The number."""
        return self.number


@dataclass(frozen=True)
class MetricOf:
    """run.metric."""

    run: str
    name: str
    curve = False

    def value(self, runs: Sources) -> Quantity:
        """The metric."""
        run = runs[self.run]
        number = run.metric(self.name)
        if np.isnan(number):
            meaning = f"this run has none ({METRICS[self.name].meaning})"
            why = f"{self.run} {run.ending}" if run.ending else meaning
            raise Untold(f"{self.run}.{self.name}: {why}")
        return number


@dataclass(frozen=True)
class SignalOf:
    """run.signal."""

    run: str
    name: str
    curve = True

    def value(self, runs: Sources) -> Quantity:
        """The signal over the run's time."""
        run = runs[self.run]
        values = run.signal(self.name)
        if not len(values):
            raise Untold(f"{self.run}.{self.name}: {self.run} {run.ending or 'does not log it'}")
        reach = Reach(self.run, run.until, run.ending, run.every)
        return Curve(run.signal("time")[: len(values)], values, (reach,))


@dataclass(frozen=True)
class Applied:
    """An operation on numbers and curves, point by point."""

    operation: Callable[..., Any]
    parts: tuple[Term, ...]

    @property
    def curve(self) -> bool:
        """Whether any part is a curve."""
        return any(part.curve for part in self.parts)

    def value(self, runs: Sources) -> Quantity:
        """The operation's result, on the time of the curves."""
        got = [part.value(runs) for part in self.parts]
        curves = [part for part in got if isinstance(part, Curve)]
        times = _shared(curves)
        plain = [_at(part, times) if isinstance(part, Curve) else np.float64(part) for part in got]
        with np.errstate(all="ignore"):
            result = self.operation(*plain)
        if not curves:
            return float(result)
        reaches = tuple(dict.fromkeys(reach for curve in curves for reach in curve.reaches))
        return Curve(times, np.asarray(result), reaches)


def _shared(curves: list[Curve]) -> Vector:
    """The first curve's times, as far as all curves go."""
    if not curves or not all(len(curve.time) for curve in curves):
        return np.zeros(0)
    times: Vector = curves[0].time
    return np.asarray(times[times <= min(curve.time[-1] for curve in curves)])


def _at(curve: Curve, times: Vector) -> Vector:
    """The curve at these times; logs of other intervals are interpolated."""
    if np.array_equal(curve.time[: len(times)], times):
        return curve.values[: len(times)]
    return np.asarray(np.interp(times, curve.time, curve.values))


@dataclass(frozen=True)
class Rate:
    """The rate of a curve, by differences."""

    part: Term
    curve = True

    def value(self, runs: Sources) -> Quantity:
        """Central differences, one-sided at the ends; NaN for a single sample."""
        got = self.part.value(runs)
        assert isinstance(got, Curve)
        for reach in got.reaches:
            if reach.every > 1:
                raise reach.thinned("rate")
        if len(got.values) < 2:
            return Curve(got.time, got.values * np.nan, got.reaches)
        return Curve(got.time, np.gradient(got.values, got.time), got.reaches)


@dataclass(frozen=True)
class Reduced:
    """A curve summed up in a number, over the run or a part of it."""

    reducer: Callable[[Vector, Vector], float]
    part: Term
    window: tuple[float, float] | None
    text: str
    curve = False

    def value(self, runs: Sources) -> Quantity:
        """The number; Untold where a run does not cover the window, or did not reach its end.

        Of a thinned log only the end of the run is known, where that is logged.
        """
        got = self.part.value(runs)
        assert isinstance(got, Curve)
        for reach in got.reaches:
            self._demand(reach)
            at_end = self.reducer is final and not self.window
            if reach.every > 1 and not (at_end and abs(got.time[-1] - reach.until) <= NEAR):
                raise reach.thinned(self.text)
        t, y = got.time, got.values
        if self.window:
            inside = (t >= self.window[0] - NEAR) & (t <= self.window[1] + NEAR)
            t, y = t[inside], y[inside]
        if not len(y):
            raise Untold(f"{self.text}: nothing is logged in this window")
        return self.reducer(t, y)

    def _demand(self, reach: Reach) -> None:
        """What is not there must not be summed up as if it were nothing."""
        short = reach.until < self.window[1] - NEAR if self.window else bool(reach.ending)
        if short:
            why = reach.ending or f"ends at {reach.until:g} s"
            raise Untold(f"{self.text}: {reach.run} {why}")


def final(t: Vector, y: Vector) -> float:
    """The last value."""
    return float(y[-1])


REDUCERS: dict[str, Callable[[Vector, Vector], float]] = {
    "max": lambda t, y: float(np.max(y)),
    "min": lambda t, y: float(np.min(y)),
    "mean": lambda t, y: float(np.trapezoid(y, t) / (t[-1] - t[0])) if len(t) > 1 else float(y[0]),
    "final": final,
    "variation": lambda t, y: float(np.sum(np.abs(np.diff(y)))) if len(t) > 1 else float("nan"),
    "integral": lambda t, y: float(np.trapezoid(y, t)) if len(t) > 1 else float("nan"),
}
MAPPERS: dict[str, tuple[int, Callable[..., Any]]] = {"abs": (1, np.abs), "hypot": (2, np.hypot)}
