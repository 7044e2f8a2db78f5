"""Comparison of arrays to the last bit."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from podusv_cli.core.kernel import Vector

Truths = npt.NDArray[np.bool_]


def differing(one: Vector, other: Vector) -> Truths:
    """Where two arrays of one shape differ in any bit; two NaN count as equal."""
    equal = _bits(one) == _bits(other)
    return np.asarray(~(equal | (np.isnan(one) & np.isnan(other))))


def _bits(array: Vector) -> npt.NDArray[np.int64]:
    return np.ascontiguousarray(array, dtype=np.float64).view(np.int64)


def distances(one: Vector, other: Vector, *, period: float = math.inf) -> Vector:
    """|one - other|, or the shorter way round a `period`; infinite where one is not finite.

    0 where both are the same to the last bit.
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
    if gap == 0 or math.isinf(gap):
        return gap
    return gap / whole if whole else math.inf


def _rank(number: float) -> int:
    """Position among all floating-point numbers in order; both zeros are at 0."""
    (bits,) = struct.unpack("<q", struct.pack("<d", number))
    return int(bits) if bits >= 0 else -(bits & 0x7FFF_FFFF_FFFF_FFFF)
