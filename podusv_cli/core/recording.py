"""What comes out of a simulation: named arrays over time, and how it ended."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, Self

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.signal import Signal

Status = Literal["finished", "diverged", "interrupted"]
# Room for so many numbers: in memory, or on the disk for what memory does not hold.
Allocate = Callable[[int], Vector]
BLOCK = 2**16  # rows that are looked at together; a long run's columns may be longer than memory


def blocks(rows: int, size: int = BLOCK) -> Iterator[slice]:
    """The rows in parts of `size`, the last one shorter."""
    return (slice(first, min(first + size, rows)) for first in range(0, rows, size))


def largest(rows: int, of: Callable[[slice], Vector]) -> float:
    """The largest |.| of what `of` gives for every block of the rows; NaN without any."""
    return float(np.max([np.max(np.abs(of(part))) for part in blocks(rows)] or [np.nan]))


@dataclass(frozen=True)
class Recording:
    """Signals by name, each of shape (rows,) or (rows, ...), with `time` [s] along the rows.

    `fixed` holds arrays that do not run over time, such as network centres, and `about` says what
    every array is. `seen` is what the probe gathered at every step, thinned log or not.
    `message` says how a run ended that did not finish.
    """

    status: Status
    controller: str
    signals: Mapping[str, Vector]
    fixed: Mapping[str, Vector] = field(default_factory=dict)
    seen: Vector | None = None
    message: str = ""
    about: Mapping[str, Signal] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Vector:
        """A signal or fixed array; KeyError where there is none."""
        return self.signals[name] if name in self.signals else self.fixed[name]

    def part(self, rows: slice | Vector) -> Self:
        """Some of the rows, with everything else."""
        return replace(self, signals={n: a[rows] for n, a in self.signals.items()})

    def row_at(self, place: Mapping[str, float]) -> int | None:
        """Index of the first row that is at a place; None where none is, or no log of such places.

        `place` has numbers of signals by name. A row is there where they are reached; the first
        that differs decides. See `Path.passed_by`.
        """
        if not place or not all(name in self for name in place):
            return None
        rows = len(self["time"])
        beyond, equal = np.zeros(rows, dtype=bool), np.ones(rows, dtype=bool)
        for name, least in place.items():
            beyond |= equal & (self[name] > least)
            equal &= self[name] == least
        there = np.flatnonzero(beyond | equal)
        return int(there[0]) if len(there) else None

    def up_to(self, place: Mapping[str, float]) -> Self:
        """The rows up to the first one that is at a place, it included; all where none is."""
        last = self.row_at(place)
        return self if last is None else self.part(slice(last + 1))

    def __contains__(self, name: str) -> bool:
        """Whether there is a signal or fixed array of this name."""
        return name in self.signals or name in self.fixed
