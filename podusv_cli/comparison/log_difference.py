"""Comparison of two recordings, to the last bit: which signals differ, where, and how far."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import Signal

Truths = npt.NDArray[np.bool_]
Place = tuple[int, ...]
ENDINGS = ("status", "controller", "message")


def differing(one: Vector, other: Vector) -> Truths:
    """Where two arrays of one shape differ in any bit, in that shape; two NaN count as equal."""
    equal = _bits(one) == _bits(other)
    return np.asarray(~(equal | (np.isnan(one) & np.isnan(other))))


def _bits(array: Vector) -> npt.NDArray[np.int64]:
    """The numbers as integers with their bits, in the array's shape."""
    return np.ascontiguousarray(array, dtype=np.float64).view(np.int64)


def distances(one: Vector, other: Vector, *, period: float = math.inf) -> Vector:
    """|one - other| for signals (n,), in the shape of both.

    Signals with a `period`, such as headings with 2 pi, have the shorter way round. A distance is 0
    where both are the same to the last bit, and infinite where one is not finite.
    """
    unequal = differing(one, other)
    with np.errstate(all="ignore"):
        straight = np.abs(one - other)
        distance = np.where(unequal, np.minimum(straight, np.abs(period - straight)), 0.0)
    return np.where(np.isfinite(distance), distance, np.inf)


@dataclass(frozen=True)
class Deviation:
    """A number of one recording that differs in the other.

    `signal` is the name, with an index for one of several nodes. `time` [s] is None for a signal
    that is constant in time. `peak` is the signal's largest finite magnitude; `period` that of a
    wrapped angle, else infinite.
    """

    signal: str
    time: float | None
    one: float
    other: float
    peak: float
    period: float = math.inf
    unit: str = ""

    @property
    def gap(self) -> float:
        """As `distances`."""
        one, other = np.array([self.one]), np.array([self.other])
        return float(distances(one, other, period=self.period)[0])

    @property
    def ulps(self) -> int | None:
        """How many floating-point numbers lie between the two; None where one is NaN."""
        if math.isnan(self.one) or math.isnan(self.other):
            return None
        return abs(_rank(self.one) - _rank(self.other))

    @property
    def relative(self) -> float:
        """The gap over the larger magnitude of the two numbers."""
        return _ratio(self.gap, max(abs(self.one), abs(self.other)))

    @property
    def relative_to_peak(self) -> float:
        """The gap over the signal's largest magnitude."""
        return _ratio(self.gap, self.peak)


def _ratio(gap: float, whole: float) -> float:
    """The gap in parts of `whole`; inf where the whole is 0."""
    if gap == 0 or math.isinf(gap):
        return gap
    return gap / whole if whole else math.inf


def _rank(number: float) -> int:
    """Position among all floating-point numbers in order; both zeros are at 0.

    The bits of a positive number, read as an integer, grow with it; a negative one has its sign bit
    removed.
    """
    (bits,) = struct.unpack("<q", struct.pack("<d", number))
    return int(bits) if bits >= 0 else -(bits & 0x7FFF_FFFF_FFFF_FFFF)


@dataclass(frozen=True)
class LogDifference:
    """What two recordings differ in.

    `first` is the earliest deviation; `largest` has the largest of every signal that differs, in
    the order of the log. `rows` counts the rows of each recording, and the rows with a common time,
    which are compared. `reshaped` names signals of different size, `only_one` and `only_other`
    those of one recording only. `endings` are differences of status, controller and message;
    `ends` is when each recording ends [s].
    """

    first: Deviation | None
    largest: tuple[Deviation, ...]
    compared: tuple[str, ...]
    rows: tuple[int, int, int]
    reshaped: tuple[str, ...]
    only_one: tuple[str, ...]
    only_other: tuple[str, ...]
    endings: Mapping[str, tuple[str, str]]
    ends: tuple[float, float]

    @property
    def same(self) -> bool:
        """Whether signals (to the last bit) and endings are the same."""
        parts = (self.largest, self.reshaped, self.only_one, self.only_other, self.endings)
        return not any(parts) and len(set(self.rows)) == 1

    def as_json(self) -> dict[str, Any]:
        """The difference as plain data, for --json and for files."""
        return {
            "same": self.same,
            "rows": list(self.rows),
            "ends": list(self.ends),
            "first": _as_json(self.first) if self.first else None,
            "largest": [_as_json(deviation) for deviation in self.largest],
            "compared": list(self.compared),
            "reshaped": list(self.reshaped),
            "only": [list(self.only_one), list(self.only_other)],
            "endings": {name: list(pair) for name, pair in self.endings.items()},
        }


def _as_json(d: Deviation) -> dict[str, Any]:
    """A deviation as `podusv diff --json` prints it."""
    return {
        "signal": d.signal,
        "time": d.time,
        "values": [d.one, d.other],
        "difference": d.gap,
        "ulps": d.ulps,
        "relative": d.relative,
        "relative_to_peak": d.relative_to_peak,
    }


@dataclass(frozen=True)
class _Pair:
    """A signal in both recordings, at common `times`; None for a signal constant in time."""

    name: str
    one: Vector
    other: Vector
    times: Vector | None
    about: Signal

    @property
    def period(self) -> float:
        """2 pi for a wrapped angle, else infinite."""
        return 2.0 * math.pi if self.about.wrapped else math.inf


def compare(one: Recording, other: Recording) -> LogDifference:
    """Compare the signals of two recordings at their common times."""
    pairs = list(_pair_signals(one, other))
    alike = [pair for pair in pairs if pair.one.shape == pair.other.shape]
    unequal = [pair for pair in alike if differing(pair.one, pair.other).any()]
    names, others = ((*log.signals, *log.fixed) for log in (one, other))
    endings = {name: (getattr(one, name), getattr(other, name)) for name in ENDINGS}
    # The first pair is time.
    shared = len(pairs[0].one)
    return LogDifference(
        first=_first(unequal),
        largest=tuple(_deviation(pair, _place_of_largest(pair)) for pair in unequal),
        compared=tuple(pair.name for pair in alike),
        rows=(len(one["time"]), len(other["time"]), shared),
        reshaped=tuple(pair.name for pair in pairs if pair.one.shape != pair.other.shape),
        only_one=tuple(name for name in names if name not in others),
        only_other=tuple(name for name in others if name not in names),
        endings={name: pair for name, pair in endings.items() if pair[0] != pair[1]},
        ends=(_end(one), _end(other)),
    )


def _end(log: Recording) -> float:
    return float(log["time"][-1]) if len(log["time"]) else 0.0


def _pair_signals(one: Recording, other: Recording) -> Iterator[_Pair]:
    """Time, then the other signals that both have, then the arrays constant in time."""
    times, at_one, at_other = _shared_times(one["time"], other["time"])
    yield _Pair("time", times, other["time"][at_other], times, one.about["time"])
    for name in one.signals:
        if name in other.signals and name != "time":
            yield _Pair(name, one[name][at_one], other[name][at_other], times, one.about[name])
    for name in one.fixed:
        if name in other.fixed:
            yield _Pair(name, one[name], other[name], None, one.about[name])


def _shared_times(one: Vector, other: Vector) -> tuple[Vector, Any, Any]:
    """The common times (n,) [s] of two logs, and their rows in each recording.

    Where logs of one length differ in half of their times or fewer, these are damaged values on one
    grid, and the logs are compared row by row.
    """
    if len(one) == len(other) and 2 * np.count_nonzero(differing(one, other)) <= len(one):
        return one, slice(None), slice(None)
    _, at_one, at_other = np.intersect1d(one, other, return_indices=True)
    return one[at_one], at_one, at_other


def _first(unequal: list[_Pair]) -> Deviation | None:
    """The earliest deviation; at equal times that of the first signal in the log."""
    places = [(pair, _place_of_maximum(differing(pair.one, pair.other))) for pair in unequal]
    if not places:
        return None
    # What is constant in time differs from the start: before all rows.
    pair, place = min(places, key=lambda item: -1 if item[0].times is None else item[1][0])
    return _deviation(pair, place)


def _place_of_largest(pair: _Pair) -> Place:
    """The indices at which two arrays differ most."""
    # Zeros of different sign differ, at a distance of 0; equal numbers must lie below that.
    distance = distances(pair.one, pair.other, period=pair.period)
    return _place_of_maximum(np.where(differing(pair.one, pair.other), distance, -1.0))


def _place_of_maximum(array: Any) -> Place:
    return tuple(int(i) for i in np.unravel_index(np.argmax(array), array.shape))


def _deviation(pair: _Pair, place: Place) -> Deviation:
    """The deviation of two arrays at one place, with the largest finite size of both."""
    inner = place if pair.times is None else place[1:]
    index = f"[{','.join(map(str, inner))}]" if inner else ""
    both = np.abs(np.concatenate([pair.one.ravel(), pair.other.ravel()]))
    return Deviation(
        signal=f"{pair.name}{index}",
        time=None if pair.times is None else float(pair.times[place[0]]),
        one=float(pair.one[place]),
        other=float(pair.other[place]),
        peak=float(both[np.isfinite(both)].max(initial=0.0)),
        period=pair.period,
        unit=pair.about.unit,
    )
