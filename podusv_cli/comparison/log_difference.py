"""Two recordings side by side: where they part, and how far."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from podusv_cli.comparison.bit_difference import Deviation, differing, gaps
from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import Signal

Place = tuple[int, ...]
ENDINGS = ("status", "controller", "message")


@dataclass(frozen=True)
class Logs:
    """What two recordings differ in.

    `first` is the earliest deviation, `largest` has one for every signal that differs, in the order
    of the log. `rows` counts the rows of both and those of the same time, which are the ones
    compared. `reshaped` names signals of another size, `only_one` and `only_other` those that one
    recording alone has; `endings` has what differs of status, controller and message.
    """

    first: Deviation | None
    largest: tuple[Deviation, ...]
    compared: tuple[str, ...]
    rows: tuple[int, int, int]
    reshaped: tuple[str, ...]
    only_one: tuple[str, ...]
    only_other: tuple[str, ...]
    endings: Mapping[str, tuple[str, str]]

    @property
    def same(self) -> bool:
        """Whether both hold the same signals, each the same to the last bit, and ended alike."""
        unlike = (self.largest, self.reshaped, self.only_one, self.only_other, self.endings)
        return not any(unlike) and len(set(self.rows)) == 1

    def as_json(self) -> dict[str, Any]:
        """The same as plain data."""
        return {
            "same": self.same,
            "rows": list(self.rows),
            "first": _as_json(self.first) if self.first else None,
            "largest": [_as_json(deviation) for deviation in self.largest],
            "compared": list(self.compared),
            "reshaped": list(self.reshaped),
            "only": [list(self.only_one), list(self.only_other)],
            "endings": {name: list(pair) for name, pair in self.endings.items()},
        }


def _as_json(d: Deviation) -> dict[str, Any]:
    return {
        "signal": d.signal, "time": d.time, "values": [d.one, d.other], "difference": d.gap,
        "ulps": d.ulps, "relative": d.relative, "relative_to_peak": d.of_peak,
    }  # fmt: skip


@dataclass(frozen=True)
class _Row:
    """A signal over the rows that both recordings have, and when they are; None: at no time."""

    name: str
    one: Vector
    other: Vector
    times: Vector | None
    about: Signal

    @property
    def period(self) -> float:
        """2 pi for an angle that is wrapped."""
        return 2.0 * math.pi if self.about.wrapped else math.inf


def compare(one: Recording, other: Recording) -> Logs:
    """Compare what two recordings have in common, at the times that they have in common."""
    rows = list(_paired(one, other))
    alike = [row for row in rows if row.one.shape == row.other.shape]
    apart = [row for row in alike if differing(row.one, row.other).any()]
    names, others = _names(one), _names(other)
    shared = len(rows[0].one)
    return Logs(
        first=_first(apart),
        largest=tuple(_deviation(row, _place_of_largest(row)) for row in apart),
        compared=tuple(row.name for row in alike),
        rows=(len(one["time"]), len(other["time"]), shared),
        reshaped=tuple(row.name for row in rows if row.one.shape != row.other.shape),
        only_one=tuple(name for name in names if name not in others),
        only_other=tuple(name for name in others if name not in names),
        endings=_endings(one, other),
    )


def _names(recording: Recording) -> tuple[str, ...]:
    return (*recording.signals, *recording.fixed)


def _endings(one: Recording, other: Recording) -> dict[str, tuple[str, str]]:
    pairs = {name: (getattr(one, name), getattr(other, name)) for name in ENDINGS}
    return {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}


def _paired(one: Recording, other: Recording) -> Iterator[_Row]:
    """Time, then the other signals that both have, then what is fixed."""
    times, at_one, at_other = _shared_times(one["time"], other["time"])
    yield _Row("time", times, other["time"][at_other], times, one.about["time"])
    for name in one.signals:
        if name in other.signals and name != "time":
            yield _Row(name, one[name][at_one], other[name][at_other], times, one.about[name])
    for name in one.fixed:
        if name in other.fixed:
            yield _Row(name, one[name], other[name], None, one.about[name])


def _shared_times(one: Vector, other: Vector) -> tuple[Vector, Any, Any]:
    """The times that both have, and which rows those are.

    Logs of one length that differ in a few times only are one grid, damaged: row goes with row.
    """
    if len(one) == len(other) and 2 * np.count_nonzero(differing(one, other)) <= len(one):
        return one, slice(None), slice(None)
    _, at_one, at_other = np.intersect1d(one, other, return_indices=True)
    return one[at_one], at_one, at_other


def _first(apart: list[_Row]) -> Deviation | None:
    """The earliest deviation; of those at the same time the one that the log has first."""
    found = [(row, _place_of_first(row)) for row in apart]
    if not found:
        return None
    row, place = min(found, key=lambda item: -1 if item[0].times is None else item[1][0])
    return _deviation(row, place)


def _place_of_first(row: _Row) -> Place:
    return _place(row, differing(row.one, row.other), np.argmax)


def _place_of_largest(row: _Row) -> Place:
    # Zeros of different sign are no distance apart, but they differ.
    apart = differing(row.one, row.other)
    distances = gaps(row.one, row.other, period=row.period)
    return _place(row, np.where(apart, distances, -1.0), np.argmax)


def _place(row: _Row, of: Any, choose: Callable[[Any], Any]) -> Place:
    return tuple(int(i) for i in np.unravel_index(choose(of), row.one.shape))


def _deviation(row: _Row, place: Place) -> Deviation:
    inner = place if row.times is None else place[1:]
    index = f"[{','.join(map(str, inner))}]" if inner else ""
    both = np.abs(np.concatenate([row.one.ravel(), row.other.ravel()]))
    return Deviation(
        signal=f"{row.name}{index}",
        time=None if row.times is None else float(row.times[place[0]]),
        one=float(row.one[place]), other=float(row.other[place]),
        peak=float(both[np.isfinite(both)].max(initial=0.0)), period=row.period,
        unit=row.about.unit,
    )  # fmt: skip
