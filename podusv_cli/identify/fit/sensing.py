"""What a log's own values say of its sensors' errors: their size, and whether positions wander."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from podusv_cli.components.estimators.ekf import MOVING
from podusv_cli.core.kernel import Vector
from podusv_cli.identify.fit.march import DELIVERED, VALUES
from podusv_cli.identify.fit.records import FilterLog

FINEST = 1e-4  # of what a sensor measured, its least error
WHITE = 20.0  # third differences of white noise have so many times its variance
DRIFTS = 12.0  # and those of what wanders 12 s_g^2/T_g of the time between values
SPAN = 1.0  # s, or two values: the third differences that are held against those of neighbours
SMOOTH = 15.0  # times so much more those of a motion are where the time between values doubles
PIECE = 15.0  # s of a log, each of which says how much its positions wander
SELDOM = 1e-6  # chance of a white error to look so, below which they do
FEWEST = 8  # pieces of axes; fewer tell nothing
USUAL = 30.0  # s, in which a receiver's error forgets, before the logs are read


def sensor_noise(log: FilterLog) -> Vector:
    """Standard deviations of the sensors' errors, by third differences; 0 where none is measured.

    White noise has third differences of sqrt(20) times its own deviation, a smooth motion small
    ones.
    """
    found = np.zeros(MOVING)
    for i in range(MOVING):
        values = _sensor_values(log, i)[1]
        if len(values) > 10:
            smooth = np.unwrap(values) if i == 2 else values
            noise = np.median(np.abs(np.diff(smooth, 3))) / 0.6745 / math.sqrt(WHITE)
            found[i] = max(noise, FINEST * np.std(smooth))
    return found


@dataclass(frozen=True)
class Wandering:
    """How fast the error of positions wanders by third differences, and how sure that is.

    `rate` is s_g^2/T_g of a first-order Gauss-Markov process [m2/s]; `chance` is the probability
    that a white error has as much.
    """

    rate: float
    chance: float

    @property
    def is_sure(self) -> bool:
        """Whether a white error hardly ever looks so."""
        return self.chance < SELDOM

    @property
    def deviation(self) -> float:
        """s_g of an error that forgets as receivers usually do [m]."""
        return math.sqrt(max(self.rate, 0.0) * USUAL)


def position_wandering(logs: Sequence[FilterLog]) -> Wandering:
    """Whether third differences of positions grow with the time between values.

    Those of a white error do not.

    For values m rows of h apart the mean square of z - 3 z_m + 3 z_2m - z_3m is

        20 sigma^2 of a white error,
        s_g^2 (20 - 30 p + 12 p^2 - 2 p^3) = 12 s_g^2 m h/T_g + ... of one with p = exp(-m h/T_g),
        at least 16 times as much for 2 m as for m of a motion whose turns take more than 5 m h,

    the first by the coefficients' squares, the second by their products at distances 1, 2 and 3,
    the third since a sine of rate w gives (2 sin(w m h/2))^6. So S(M) - S(1) has no white error in
    it, and less (S(2M) - S(M))/15 no motion; what is left is the error that wanders, 12 s_g^2 h/T_g
    times M - 1 - M/15.
    """
    pieces = [p for log in logs for i in range(2) for p in _rates(*_sensor_values(log, i))]
    if len(pieces) < FEWEST:
        return Wandering(0.0, 1.0)
    from scipy.special import stdtr  # slow to import

    mean, spread = float(np.mean(pieces)), float(np.std(pieces, ddof=1))
    if spread == 0.0:  # nothing moves, in a simulator without noise
        return Wandering(mean, 1.0)
    student = mean / spread * math.sqrt(len(pieces))
    return Wandering(mean, float(stdtr(len(pieces) - 1, -student)))


def _sensor_values(log: FilterLog, i: int) -> tuple[Vector, Vector]:
    """Times and values of what a sensor delivered."""
    rows = log.record.rows
    new = rows[:, DELIVERED + i] != 0.0
    return log.times[new], rows[new, VALUES + i]


def _rates(times: Vector, values: Vector) -> list[float]:
    """s_g^2/T_g of each piece of an axis [m2/s]."""
    if len(times) < 10:
        return []
    h = float(np.median(np.diff(times)))
    far = max(2, round(SPAN / h))
    apart = far - 1.0 - far / SMOOTH
    squares = [_thirds(times, values, m, h) for m in (1, far, 2 * far)]
    ends = np.linspace(times[0], times[-1], max(1, round((times[-1] - times[0]) / PIECE)) + 1)
    rates = []
    for begin, end in pairwise(ends):
        own = [s[(t >= begin) & (t < end)] for t, s in squares]
        if all(len(s) for s in own):
            near, wide, wider = (float(np.mean(s)) for s in own)
            rates.append((wide - near - (wider - wide) / SMOOTH) / (DRIFTS * h * apart))
    return rates


def _thirds(times: Vector, values: Vector, m: int, h: float) -> tuple[Vector, Vector]:
    """Squared third differences of values m apart, where none is missing, and their times."""
    ends, reach = np.arange(3 * m, len(times)), 3 * m
    whole = np.abs(times[ends] - times[ends - reach] - reach * h) < 0.5 * h
    ends = ends[whole]
    d = values[ends] - 3.0 * values[ends - m] + 3.0 * values[ends - 2 * m] - values[ends - reach]
    return times[ends - reach], d * d
