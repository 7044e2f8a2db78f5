"""A log averaged over bins of some seconds, in which its motion shows."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.core.kernel import Vector
from podusv_cli.identify.logs.reading import LogTable, Marks, Whole

BIN = 1.0  # s, over which values are averaged; at least that of VALUES_A_BIN
VALUES_A_BIN = 3
GAP_BINS = 4.0  # at most, that a gap takes
FAST = 0.95  # quantile of the speed that counts as the fastest
MOVING = 0.2  # of that, above which a course says something
JUMP = 5.0  # times that, above which a position has jumped
RADIANS, DEGREES = 2.0 * math.pi, 360.0  # a full turn


@dataclass(frozen=True)
class BinnedMotion:
    """A log averaged over bins of some seconds; what moved the boat, and its top speed [m/s].

    The top speed is infinite where nobody knows it.
    """

    table: LogTable
    actuator: Actuator | None = None
    top_speed: float = math.inf

    @cached_property
    def width(self) -> float:
        """Of a bin [s]."""
        times = self.table.times[np.isfinite(self.table.columns["x"])]
        usual = float(np.median(np.diff(times))) if len(times) > 1 else BIN
        return max(BIN, VALUES_A_BIN * usual)

    @cached_property
    def _bins(self) -> Whole:
        # Some empty bins stand for a gap of any length: a clock may jump from 0 to a date.
        spans = np.minimum(np.diff(self.table.times), GAP_BINS * self.width)
        return np.asarray(np.cumsum(np.append(0.0, spans)) // self.width, np.int64)

    def time(self, number: int) -> float:
        """The middle of a bin [s]."""
        first = int(np.searchsorted(self._bins, number))
        return float(self.table.times[first]) + 0.5 * self.width

    def mean(self, name: str, values: Vector | None = None) -> Vector:
        """Of a quantity in each bin, NaN where it has no value there."""
        values = self.table.columns[name] if values is None else values
        known = np.isfinite(values)
        size = int(self._bins[-1]) + 1
        counts = np.bincount(self._bins[known], minlength=size)
        sums = np.bincount(self._bins[known], values[known], minlength=size)
        return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)

    def rate(self, means: Vector) -> Vector:
        """How fast a quantity changes, by the bins on either side."""
        if len(means) < 2:
            return np.full(len(means), np.nan)
        return np.asarray(np.gradient(means, self.width))

    def turned_angles(self) -> Vector:
        """The mean angle in each bin by which the yaw rate says that the boat has turned [rad]."""
        known = np.isfinite(self.table.columns["r"])
        rates, times = self.table.columns["r"][known], self.table.times[known]
        angles = np.full_like(self.table.times, np.nan)
        angles[known] = np.cumsum(
            0.5 * (rates + np.roll(rates, 1)) * np.diff(times, prepend=times[:1])
        )
        return self.mean("r", angles)

    def heading(self, turn: float = RADIANS) -> Vector:
        """Of each bin, in the log's own numbers, of which `turn` make a full turn."""
        values = self.table.columns["psi"].copy()
        known = np.isfinite(values)
        values[known] = np.unwrap(values[known], period=turn)
        return self.mean("psi", values) * (RADIANS / turn)

    @cached_property
    def first_heading(self) -> float:
        """In the log's own numbers."""
        psi = self.table.columns["psi"]
        return float(psi[np.isfinite(psi)][0])

    @cached_property
    def velocity(self) -> Vector:
        """Over ground, north + 1j east [m/s], by positions."""
        return self.rate(self.mean("x")) + 1j * self.rate(self.mean("y"))

    @cached_property
    def fastest(self) -> float:
        """The speed that hardly any bin exceeds [m/s]."""
        speeds = np.abs(self.velocity)
        known = np.isfinite(speeds)
        return float(np.quantile(speeds[known], FAST)) if known.any() else 0.0

    @cached_property
    def own_speed(self) -> float:
        """The size of the log's own u that hardly any row exceeds [m/s]; 0 where it has none."""
        speeds = np.abs(self.table.columns.get("u", np.zeros(1)))
        return float(np.nanquantile(speeds, FAST)) if np.isfinite(speeds).any() else 0.0

    @cached_property
    def moving(self) -> Marks:
        """The bins in which the course of the track says something."""
        speed = np.abs(self.velocity)
        return np.asarray((speed > MOVING * self.fastest) & (speed < JUMP * self.fastest))
