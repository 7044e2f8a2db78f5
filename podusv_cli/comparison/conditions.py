"""Conditions of claims: what holds, what does not, what cannot be told and why."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from podusv_cli.comparison.expressions import Curve, Number, Sources, Term, Untold


@dataclass
class Evidence:
    """What comes to light while a condition is judged.

    `numbers` are those that were compared, by their text, NaN where there is none; `doubts` say
    why something cannot be told.
    """

    numbers: dict[str, float] = field(default_factory=dict)
    doubts: list[str] = field(default_factory=list)


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
    ">=": lambda a, b, tolerance: _at_most(-a, -b, tolerance),
    "==": lambda a, b, tolerance: abs(a - b) <= tolerance * abs(b),
}
