"""Two arrays compared to the last bit."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from podusv_cli.core.kernel import Vector

Truths = npt.NDArray[np.bool_]


def differing(one: Vector, other: Vector) -> Truths:
    """Where arrays of one shape differ in any bit; two NaN count as equal."""
    alike = _bits(one) == _bits(other)
    return np.asarray(~(alike | (np.isnan(one) & np.isnan(other))))


def _bits(array: Vector) -> npt.NDArray[np.int64]:
    return np.ascontiguousarray(array, dtype=np.float64).view(np.int64)


def gaps(one: Vector, other: Vector, *, period: float = math.inf) -> Vector:
    """|one - other|, infinite where only one of them is a finite number; 0 where they agree.

    Of numbers that are the same a `period` further on, it is the shorter way round.
    """
    apart = differing(one, other)
    with np.errstate(all="ignore"):
        straight = np.abs(one - other)
        distance = np.where(apart, np.minimum(straight, np.abs(period - straight)), 0.0)
    return np.where(np.isfinite(distance), distance, np.inf)


@dataclass(frozen=True)
class Deviation:
    """A number of a signal and what stands in its place in the other recording.

    `signal` has an index for one of several nodes, and `unit` is its unit. `time` [s] is None for
    what does not run over time. `peak` is the signal's largest finite magnitude; `period` that of a
    wrapped angle.
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
        """|one - other|, the shorter way round; infinite where one is no finite number."""
        straight = abs(self.one - self.other)
        distance = min(straight, abs(self.period - straight))
        return distance if math.isfinite(distance) else math.inf

    @property
    def ulps(self) -> int | None:
        """How many floating-point numbers apart; None where one is NaN."""
        if math.isnan(self.one) or math.isnan(self.other):
            return None
        return abs(_rank(self.one) - _rank(self.other))

    @property
    def relative(self) -> float:
        """The gap in parts of the larger of the two numbers."""
        return _part(self.gap, max(abs(self.one), abs(self.other)))

    @property
    def of_peak(self) -> float:
        """The gap in parts of the signal's largest magnitude."""
        return _part(self.gap, self.peak)


def _part(gap: float, whole: float) -> float:
    if gap == 0 or math.isinf(gap):
        return gap
    return gap / whole if whole else math.inf


def _rank(number: float) -> int:
    """Place among all floating-point numbers; both zeros have place 0."""
    (bits,) = struct.unpack("<q", struct.pack("<d", number))
    return int(bits) if bits >= 0 else -(bits & 0x7FFF_FFFF_FFFF_FFFF)
