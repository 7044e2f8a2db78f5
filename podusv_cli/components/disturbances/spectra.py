"""Spectra of waves and gusts, and sums of cosines that have them.

All spectra are one-sided: their integral is the variance. What is drawn is a function of seed and
component, and only plain arithmetic is used, so that all numbers have the same bits on every
machine.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Literal, NamedTuple

import numpy as np

from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import LANES, Vector, kernel
from podusv_cli.core.portable import by_lines, exponential, logarithm
from podusv_cli.core.random_words import uniforms

GRAVITY = 9.81  # m/s2
WATER = 1025.0  # kg/m3, sea water
SMALLEST = -700.0  # below, e^x is nothing
FAR = 1000.0  # times a rate is its peak, where there is nothing left of a spectrum
# Components in one round of a loop, two registers full: the compiler writes out a loop over one of
# them number by number.
GROUP = 2 * LANES
SAMPLES = 16  # of a spectrum in every bin, at least
ALL_SAMPLES = 800  # in all bins, at least: few are wide, and a peak is narrow
FINE = 4096  # steps in which a spectrum is added up
NORSOK_N = 0.468  # the exponent n of the NORSOK gust spectrum
HARRIS_LENGTH = 1800.0  # m
SHARES = np.linspace(0.0, 1.0, 513)  # of the way from -pi/2 to pi/2
Period = Literal["peak", "mean", "zero_crossing"]
Density = Callable[[Vector], Vector]


class Cosines(NamedTuple):
    """amplitude cos(rate t + phase), one entry a component; rates in rad/s."""

    rate: Vector
    amplitude: Vector
    phase: Vector


def power(x: Vector, exponent: float | Vector) -> Vector:
    """x^exponent for positive x (n,), by podusv's own exp and log: the same bits everywhere."""
    return exponential(np.maximum(exponent * logarithm(x), SMALLEST))


def jonswap(rate: Vector, height: float, peak: float, gamma: float) -> Vector:
    """Density (n,) [m2 s] of the surface elevation at `rate` (n,) [rad/s].

    `height` is the significant height [m], `peak` the rate of the peak [rad/s]. With gamma = 1 it
    is the ITTC's modified Pierson-Moskowitz spectrum A rate^-5 exp(-B rate^-4) with B = 1.25
    peak^4 and A = B height^2 / 4, which for periods of the peak is 1948 and 487: the published
    1949 and 487 are these, rounded. Seen in cybergalactic/MSS, waveSpectrum.m, types 3 to 5 and 7
    (after DNV-RP-C205): alpha = (5/16) height^2 peak^4 / g^2, sigma 0.07 below and 0.09 above the
    peak, and the factor 1 - 0.287 ln gamma, which keeps the height.
    """
    ratio = np.minimum(peak / rate, FAR)
    fourth = ratio * ratio * ratio * ratio
    smooth = 0.3125 * height * height * fourth / rate
    smooth = smooth * exponential(np.maximum(-1.25 * fourth, SMALLEST))
    away = (rate - peak) / (np.where(rate <= peak, 0.07, 0.09) * peak)
    log_gamma = float(logarithm(np.array([gamma]))[0])
    bell = exponential(np.maximum(-0.5 * away * away, SMALLEST))
    return np.asarray((1.0 - 0.287 * log_gamma) * smooth * exponential(log_gamma * bell))


@cache
def peak_period(gamma: float, period: Period, lowest: float = 0.3, highest: float = 300.0) -> float:
    """The peak's period as a multiple of another period of the same sea, by moments m_n.

    The moments are those of the band between `lowest` and `highest`, in terms of the peak's rate.
    Mean: 2 pi m0/m1. Zero-crossing: 2 pi sqrt(m0/m2). `gamma` is the JONSWAP peakedness.
    """
    if period == "peak":
        return 1.0
    edges = growing_edges(max(lowest, 1.0 / FAR), highest, 4000)
    rate, width = (edges[1:] + edges[:-1]) / 2.0, np.diff(edges)
    # Any height and a peak at 1 rad/s will do: the height cancels, and the peak's period is 2 pi
    energy = jonswap(rate, 4.0, 1.0, gamma) * width
    m0, m1, m2 = (math.fsum(moment) for moment in (energy, energy * rate, energy * rate * rate))
    return m1 / m0 if period == "mean" else math.sqrt(m2 / m0)


def norsok(frequency: Vector, speed: float, height: float) -> Vector:
    """Density (n,) [m2/s2/Hz] of the wind speed at `frequency` (n,) [Hz], `height` [m] up.

    `speed` is the mean over an hour 10 m above the sea [m/s]. Froya spectrum of NORSOK N-003; seen
    in the crate ndspec 0.1.1, froya.rs, and in a second program, which agree.
    """
    z, u = np.array([height / 10.0]), np.array([speed / 10.0])
    x = 172.0 * frequency * power(z, 2.0 / 3.0) * power(u, -0.75)
    scale = 320.0 * u * u * power(z, 0.45)
    return np.asarray(scale * power(1.0 + power(x, NORSOK_N), -5.0 / (3.0 * NORSOK_N)))


def harris(frequency: Vector, speed: float, drag: float) -> Vector:
    """Density (n,) [m2/s2/Hz] of the wind speed at `frequency` (n,) [Hz], at every height alike.

    `speed` is the mean 10 m above the sea [m/s], `drag` the surface's drag coefficient. Seen in a
    public program with NORSOK's spectrum beside it; both are those of Fossen's handbook.
    """
    x = HARRIS_LENGTH * frequency / speed
    return np.asarray(4.0 * drag * HARRIS_LENGTH * speed * power(2.0 + x * x, -5.0 / 6.0))


def in_bins(density: Density, edges: Vector) -> Vector:
    """The variance (n - 1,) in each bin between neighbouring edges (n,) [Hz or rad/s].

    `density` gives the spectrum per unit of the edges; by the midpoint rule in every bin.
    """
    width = np.diff(edges)
    count = max(SAMPLES, math.ceil(ALL_SAMPLES / len(width)))
    places = (np.arange(count) + 0.5) / count
    samples = density(edges[:-1] + places[:, None] * width)
    # Python's sum adds row by row; numpy's would be free in the order of the additions
    return np.asarray(sum(samples) * width / count)


def as_given(count: int, seed: int, stream: str) -> Vector:
    """Factors (count,) on the variance of `count` components: 1."""
    return np.ones(count)


def rayleigh(count: int, seed: int, stream: str) -> Vector:
    """Factors (count,) on the variance of components whose amplitudes are Rayleigh-distributed.

    `stream` names the random numbers of `seed`. They are exponential variates of mean 1. With them
    a sum of cosines is a sample of a Gaussian process, and its variance scatters from seed to seed
    as that of a sea does; with the same amplitudes for every seed it hardly does (Tucker, Challenor
    and Carter 1984).
    """
    return np.asarray(-logarithm(1.0 - uniforms((seed, stream, "amplitude"), 0, count)))


AMPLITUDES = {"deterministic": as_given, "random": rayleigh}
Amplitudes = Literal["random", "deterministic"]


def resolving(variance: Vector, edges: Vector, duration: float) -> int:
    """How many components leave a Gaussian process's scatter to sums over `duration` [s].

    The variance of such a sum scatters by the sum of all v^2, with v of each bin; that of the
    process by the integral of S^2 over the duration, the sum of all v^2 over bin's width and
    duration. They are equal where the bins, weighted by S^2, are 1/duration wide.

    `variance` (n,) is that of each bin, `edges` (n + 1,) are in Hz, `duration` in s.
    """
    wide = np.sum(variance**2) / np.sum(variance**2 / np.diff(edges))
    return math.ceil(len(variance) * duration * wide)


def cosines(variance: Vector, edges: Vector, seed: int, stream: str, amplitudes: str) -> Cosines:
    """One component a bin: its rate uniform in the bin, its phase [rad] uniform in a turn.

    `variance` (n,) is that of each bin, `edges` (n + 1,) set the unit of the rates. `stream` names
    the random numbers of `seed`; `amplitudes` is a key of `AMPLITUDES`.

    Its amplitude is sqrt(2 variance), so that the sum has the variance of all bins together, or
    drawn with that mean square. Rates that are drawn have no common period, so the sum does not
    repeat itself.
    """
    count = len(variance)
    variance = variance * AMPLITUDES[amplitudes](count, seed, stream)
    inside = uniforms((seed, stream, "rate"), 0, count)
    rate = edges[:-1] + np.diff(edges) * inside
    phase = 2.0 * math.pi * uniforms((seed, stream, "phase"), 0, count)
    return Cosines(rate, np.sqrt(2.0 * variance), phase)


def even_edges(low: float, high: float, count: int) -> Vector:
    """Edges (count + 1,) of `count` bins of one width, from `low` to `high` [Hz or rad/s]."""
    return np.linspace(low, high, count + 1)


def sea_edges(density: Density, low: float, high: float, count: int) -> Vector:
    """Edges (count + 1,) [rad/s] of bins that elevation, velocity and acceleration share evenly.

    From `low` to `high` [rad/s]; `density` is the elevation's spectrum [m2 s]. Each bin has the
    same share of S/m0 + rate^2 S/m2 + rate^4 S/m4. By the energy S alone the few bins of the tail
    would be so wide that velocities, and the drift of hulls that reflect short waves only, scatter
    twice as much as a sea's.
    """
    fine = np.linspace(low, high, FINE + 1)
    rate = (fine[:-1] + fine[1:]) / 2.0
    square, values = rate * rate, density(rate)
    sums = (np.cumsum(part) for part in (values, values * square, values * square * square))
    shares = np.concatenate([[0.0], sum(each / each[-1] for each in sums) / 3.0])
    return by_lines(np.linspace(0.0, 1.0, count + 1), shares, fine)


def growing_edges(low: float, high: float, count: int) -> Vector:
    """Edges (count + 1,) from `low` to `high`, each bin wider than the last by the same factor."""
    ends = logarithm(np.array([low, high]))
    return exponential(np.linspace(ends[0], ends[1], count + 1))


def whole_groups(count: int) -> int:
    """`count` rounded up to whole groups of components."""
    return -(-count // GROUP) * GROUP


@kernel
def clear_sums(count: int, sums: Vector) -> None:
    """Set all partial sums to 0."""
    for i in range(count):
        sums[i] = 0.0


def directions(spreading: int, count: int, seed: int, stream: str) -> Vector:
    """Departures (count,) [rad] of the components from the mean direction, drawn by `seed`.

    `stream` names the random numbers of `seed`. Their density is cos^(2 spreading) within a quarter
    turn to either side; spreading 0: none.
    With spreading 1 it is that of cybergalactic/MSS, waveDirectionalSpectrum.m.
    """
    if spreading == 0:
        return np.zeros(count)
    angles = math.pi * (SHARES - 0.5)
    shares = _shares(spreading)
    return by_lines(uniforms((seed, stream, "direction"), 0, count), shares, angles)


@cache
def _shares(spreading: int) -> Vector:
    """The share of cos^(2 spreading) up to each of the angles (angles,), by Simpson's rule.

    The angles go from -pi/2 to pi/2 as `SHARES` does; the shares from 0 to 1.
    """
    # Simpson's rule needs the middle of every piece as well
    fine = math.pi * (np.linspace(0.0, 1.0, 2 * len(SHARES) - 1) - 0.5)
    base = np.maximum([cos_sin(angle)[0] for angle in fine.tolist()], 0.0)
    density = np.ones_like(base)
    for _ in range(2 * spreading):
        density = density * base
    parts = density[:-2:2] + 4.0 * density[1::2] + density[2::2]
    shares = np.concatenate([[0.0], np.cumsum(parts)])
    return np.asarray(shares / shares[-1])
