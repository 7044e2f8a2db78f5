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

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from podusv_cli.kernels import Vector
from podusv_cli.metrics.table import METRICS

NEAR = 1e-9  # s; times closer than this are the same


class Source(Protocol):
    """What an expression can ask of a run."""

    @property
    def until(self) -> float:
        """The time up to which the run was simulated [s]."""

    @property
    def ending(self) -> str:
        """Why the run did not reach its end, as `diverged at t = 2 s`; empty where it did."""

    def metric(self, name: str) -> float:
        """A metric; NaN where the run has none of this name."""

    def signal(self, name: str) -> Vector:
        """A logged signal; empty where the run has none of this name."""

    def check(self, name: str) -> bool | None:
        """Whether a named property of the run holds; None where that cannot be told."""


Sources = Mapping[str, Source]


class Untold(Exception):
    """A number that the runs do not give; the text says which one, and why."""


@dataclass
class Evidence:
    """What comes to light while a condition is judged.

    `numbers` are those that were compared, by their text, NaN where there is none; `doubts` say
    why something cannot be told.
    """

    numbers: dict[str, float] = field(default_factory=dict)
    doubts: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Reach:
    """How far a run goes; see `Source`."""

    run: str
    until: float
    ending: str


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
        reach = Reach(self.run, run.until, run.ending)
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
        rows = min((len(curve.time) for curve in curves), default=0)
        plain = [
            part.values[:rows] if isinstance(part, Curve) else np.float64(part) for part in got
        ]
        with np.errstate(all="ignore"):
            result = self.operation(*plain)
        if not curves:
            return float(result)
        reaches = tuple(dict.fromkeys(reach for curve in curves for reach in curve.reaches))
        return Curve(curves[0].time[:rows], np.asarray(result), reaches)


@dataclass(frozen=True)
class Rate:
    """The rate of a curve, by differences."""

    part: Term
    curve = True

    def value(self, runs: Sources) -> Quantity:
        """Central differences, one-sided at the ends; NaN for a single sample."""
        got = self.part.value(runs)
        assert isinstance(got, Curve)
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
        """The number; Untold where a run does not cover the window, or did not reach its end."""
        got = self.part.value(runs)
        assert isinstance(got, Curve)
        for reach in got.reaches:
            self._demand(reach)
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


class Condition(Protocol):
    """A part of an expression that holds, does not hold, or cannot be told (None)."""

    def holds(self, runs: Sources, tolerance: float, found: Evidence) -> bool | None:
        """The verdict; adds to `found` what came to light."""


@dataclass(frozen=True)
class Compared:
    """a < b < c, each link judged with the tolerance; `texts` name the parts."""

    parts: tuple[Term, ...]
    signs: tuple[str, ...]
    texts: tuple[str, ...]

    def holds(self, runs: Sources, tolerance: float, found: Evidence) -> bool | None:
        """All links."""
        got = [self._number(i, runs, found) for i in range(len(self.parts))]
        links = range(len(self.signs))
        return every([self._link(i, got[i], got[i + 1], tolerance, found) for i in links])

    def _number(self, position: int, runs: Sources, found: Evidence) -> float:
        """The number at this place, NaN with a doubt where there is none."""
        part, text, number = self.parts[position], self.texts[position], float("nan")
        try:
            value = part.value(runs)
            assert not isinstance(value, Curve)
            number = value
            if not np.isfinite(number):
                found.doubts.append(f"{text} is no finite number")
        except Untold as doubt:
            found.doubts.append(str(doubt))
        if not isinstance(part, Number):
            found.numbers[text] = number
        return number

    def _link(
        self, position: int, a: float, b: float, tolerance: float, found: Evidence
    ) -> bool | None:
        if not (np.isfinite(a) and np.isfinite(b)):
            return None
        answer = LINKS[self.signs[position]](a, b, tolerance)
        if answer is None:
            nearer = f"differ by no more than the tolerance of {tolerance:g}"
            found.doubts.append(f"{self.texts[position]} and {self.texts[position + 1]} {nearer}")
        return answer


@dataclass(frozen=True)
class Checked:
    """check(run)."""

    name: str
    run: str

    def holds(self, runs: Sources, tolerance: float, found: Evidence) -> bool | None:
        """The check's answer."""
        run, text = runs[self.run], f"{self.name}({self.run})"
        answer = run.check(self.name)
        found.numbers[text] = float("nan") if answer is None else float(answer)
        if answer is None:
            found.doubts.append(f"{text}: {self.run} {run.ending}")
        return answer


@dataclass(frozen=True)
class Denied:
    """not a."""

    part: Condition

    def holds(self, runs: Sources, tolerance: float, found: Evidence) -> bool | None:
        """The opposite."""
        answer = self.part.holds(runs, tolerance, found)
        return None if answer is None else not answer


@dataclass(frozen=True)
class Joined:
    """a and b."""

    parts: tuple[Condition, ...]

    def holds(self, runs: Sources, tolerance: float, found: Evidence) -> bool | None:
        """All parts; every part is computed, so that its numbers are shown."""
        return every([part.holds(runs, tolerance, found) for part in self.parts])


def every(answers: Iterable[bool | None]) -> bool | None:
    """False where one is False, else None where one is None, else True."""
    answers = list(answers)
    if any(answer is False for answer in answers):
        return False
    return None if None in answers else True


def _clearly(a: float, b: float, tolerance: float) -> bool | None:
    """a < b by more than the tolerance: True; the other way round: False; closer: cannot tell."""
    margin = tolerance * max(abs(a), abs(b))
    if abs(a - b) <= margin:
        return None if margin else False
    return a < b


def _at_most(a: float, b: float, tolerance: float) -> bool:
    return a <= b + tolerance * abs(b)


# a sign between two numbers, with the claim's relative tolerance
LINKS: dict[str, Callable[[float, float, float], bool | None]] = {
    "<": _clearly,
    ">": lambda a, b, tolerance: _clearly(b, a, tolerance),
    "<=": _at_most,
    ">=": lambda a, b, tolerance: _at_most(b, a, tolerance),
    "==": lambda a, b, tolerance: abs(a - b) <= tolerance * abs(b),
}
REDUCERS: dict[str, Callable[[Vector, Vector], float]] = {
    "max": lambda t, y: float(np.max(y)),
    "min": lambda t, y: float(np.min(y)),
    "mean": lambda t, y: float(np.trapezoid(y, t) / (t[-1] - t[0])) if len(t) > 1 else float(y[0]),
    "final": lambda t, y: float(y[-1]),
    "variation": lambda t, y: float(np.sum(np.abs(np.diff(y)))) if len(t) > 1 else float("nan"),
    "integral": lambda t, y: float(np.trapezoid(y, t)) if len(t) > 1 else float("nan"),
}
MAPPERS: dict[str, tuple[int, Callable[..., Any]]] = {"abs": (1, np.abs), "hypot": (2, np.hypot)}
