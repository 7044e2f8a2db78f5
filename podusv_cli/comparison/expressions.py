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
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from podusv_cli.kernels import Vector


class Source(Protocol):
    """What an expression can ask of a run."""

    def metric(self, name: str) -> float:
        """A metric; NaN where the run has none of this name."""

    def signal(self, name: str) -> Vector:
        """A logged signal; empty where the run has none of this name."""

    def check(self, name: str) -> bool:
        """Whether a named property of the run holds."""


Sources = Mapping[str, Source]
Numbers = dict[str, float]  # what was computed on the way, by its text


@dataclass(frozen=True)
class Curve:
    """A signal over time."""

    time: Vector
    values: Vector


Quantity = float | Curve


class Term(Protocol):
    """A part of an expression that has a value."""

    @property
    def curve(self) -> bool:
        """Whether the value is a curve."""

    def value(self, runs: Sources) -> Quantity:
        """A number, or a curve where `curve` says so."""


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
        return runs[self.run].metric(self.name)


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
        return Curve(run.signal("time")[: len(values)], values)


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
        plain = [part.values if isinstance(part, Curve) else part for part in got]
        times = [part.time for part in got if isinstance(part, Curve)]
        if times:
            rows = min(len(time) for time in times)
            plain = [part[:rows] if isinstance(part, np.ndarray) else part for part in plain]
            return Curve(times[0][:rows], np.asarray(self.operation(*plain)))
        with np.errstate(all="ignore"):
            return float(np.float64(self.operation(*map(np.float64, plain))))


@dataclass(frozen=True)
class Rate:
    """The rate of a curve, by differences."""

    part: Term
    curve = True

    def value(self, runs: Sources) -> Quantity:
        """Central differences, one-sided at the ends; empty for fewer than two samples."""
        got = self.part.value(runs)
        assert isinstance(got, Curve)
        if len(got.values) < 2:
            return Curve(got.time[:0], got.values[:0])
        return Curve(got.time, np.gradient(got.values, got.time))


@dataclass(frozen=True)
class Reduced:
    """A curve summed up in a number, over the run or a part of it."""

    reducer: Callable[[Vector, Vector], float]
    part: Term
    window: tuple[float, float] | None
    curve = False

    def value(self, runs: Sources) -> Quantity:
        """The number; NaN where the run does not cover the window."""
        got = self.part.value(runs)
        assert isinstance(got, Curve)
        t, y = got.time, got.values
        if self.window and len(t):
            if t[-1] < self.window[1] - 1e-9:
                return float("nan")
            inside = (t >= self.window[0] - 1e-9) & (t <= self.window[1] + 1e-9)
            t, y = t[inside], y[inside]
        return self.reducer(t, y) if len(y) else float("nan")


class Condition(Protocol):
    """A part of an expression that holds, does not hold, or cannot be told (None)."""

    def holds(self, runs: Sources, tolerance: float, numbers: Numbers) -> bool | None:
        """The verdict; adds what was computed to `numbers`."""


@dataclass(frozen=True)
class Compared:
    """a < b < c, each link judged with the tolerance; `texts` name the parts in `numbers`."""

    parts: tuple[Term, ...]
    signs: tuple[str, ...]
    texts: tuple[str, ...]

    def holds(self, runs: Sources, tolerance: float, numbers: Numbers) -> bool | None:
        """All links."""
        values = [part.value(runs) for part in self.parts]
        got = [value for value in values if isinstance(value, float)]
        shown = zip(self.texts, self.parts, got, strict=True)
        numbers.update({text: v for text, part, v in shown if not isinstance(part, Number)})
        return every(
            LINKS[sign](a, b, tolerance) if np.isfinite(a) and np.isfinite(b) else None
            for sign, a, b in zip(self.signs, got[:-1], got[1:], strict=True)
        )


@dataclass(frozen=True)
class Checked:
    """check(run)."""

    name: str
    run: str

    def holds(self, runs: Sources, tolerance: float, numbers: Numbers) -> bool | None:
        """The check's answer."""
        answer = runs[self.run].check(self.name)
        numbers[f"{self.name}({self.run})"] = float(answer)
        return answer


@dataclass(frozen=True)
class Denied:
    """not a."""

    part: Condition

    def holds(self, runs: Sources, tolerance: float, numbers: Numbers) -> bool | None:
        """The opposite."""
        answer = self.part.holds(runs, tolerance, numbers)
        return None if answer is None else not answer


@dataclass(frozen=True)
class Joined:
    """a and b."""

    parts: tuple[Condition, ...]

    def holds(self, runs: Sources, tolerance: float, numbers: Numbers) -> bool | None:
        """All parts; every part is computed, so that its numbers are shown."""
        return every([part.holds(runs, tolerance, numbers) for part in self.parts])


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
    "variation": lambda t, y: float(np.sum(np.abs(np.diff(y)))),
    "integral": lambda t, y: float(np.trapezoid(y, t)),
}
MAPPERS: dict[str, tuple[int, Callable[..., Any]]] = {"abs": (1, np.abs), "hypot": (2, np.hypot)}
CHECKS = ("finished", "underactuated")
