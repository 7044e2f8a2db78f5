"""Torsethaugen's spectrum of a wind sea and a swell together, for seas of full size.

Torsethaugen (1996): Model for a doubly peaked wave spectrum, SINTEF STF22 A96204; seen in
cybergalactic/MSS, torsetSpectrum.m. It was fitted to measurements of the North Sea, in metres and
seconds, and does not scale to models. There each peak is scaled by a fit of its integral, which
leaves the significant height 0.6 to 1.7 % too large; here by the integral itself.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from podusv_cli.components.disturbances import spectra
from podusv_cli.components.disturbances.spectra import GRAVITY, SMALLEST, power
from podusv_cli.core.kernel import Vector
from podusv_cli.core.portable import exponential

HIGHEST = 20.0  # m, podusv's limit: no such sea was measured
DEVELOPED = 6.6  # s/m^(1/3): fully developed seas have the period 6.6 Hs^(1/3)
STEEPEST, LONGEST = 2.0, 25.0  # s/sqrt(m) of the steepest sea, s of the longest swell
WHOLE = spectra.growing_edges(0.1, 100.0, 2000)  # of a peak's frequency


class Peak(NamedTuple):
    """Significant height [m], period [s] and shape of one of the two peaks."""

    height: float
    period: float
    gamma: float
    n: float
    m: float

    def shape(self, ratio: Vector) -> Vector:
        """Density (n,) over the ratio to the peak's frequency (n,), before it is scaled."""
        width = np.where(ratio < 1.0, 0.07, 0.09)
        bell = exponential(np.maximum(-0.5 * ((ratio - 1.0) / width) ** 2, SMALLEST))
        fall = exponential(np.maximum(-self.n / self.m * power(ratio, -self.m), SMALLEST))
        return power(ratio, -self.n) * fall * power(np.full_like(bell, self.gamma), bell)

    @property
    def whole(self) -> float:
        """The integral of the shape."""
        return _whole(self)

    def density(self, rate: Vector) -> Vector:
        """Density [m2 s] of this peak at `rate` [rad/s], both (n,)."""
        per_rate = self.period / (2.0 * math.pi)
        scale = self.height**2 / 16.0 * per_rate / self.whole
        return np.asarray(scale * self.shape(np.maximum(rate * per_rate, 1e-3)))


@lru_cache(maxsize=16)
def _whole(peak: Peak) -> float:
    """The integral of a peak's shape over the ratio to its frequency, by bins."""
    return math.fsum(spectra.in_bins(peak.shape, WHOLE))


def _power(x: float, exponent: float) -> float:
    """x^exponent by podusv's own logarithm, with the same bits on all machines."""
    # 0 has no logarithm, by which `power` is computed
    return float(power(np.array([x]), exponent)[0]) if x else 0.0


def _e(x: float) -> float:
    """e^x by podusv's own exponential, with the same bits on all machines."""
    return float(exponential(np.array([max(x, SMALLEST)]))[0])


def _gamma(height: float, steepness: float) -> float:
    """Peakedness by height [m] and steepness; 1 of a sea so low that the fit would leave a dip."""
    return max(35.0 * (1.0 + 3.5 * _e(-height)) * _power(steepness, 0.857), 1.0)


def peaks(height: float, period: float) -> tuple[Peak, Peak]:
    """The peak at `period` [s], and the other one: a swell, or where that is one, a wind sea.

    `height` is the significant height [m] of the whole sea. The numbers are those of the fit, see
    the module's text. A period shorter than the fully developed sea's is a wind sea's.
    """
    developed, n = DEVELOPED * _power(height, 1.0 / 3.0), 0.5 * math.sqrt(height) + 3.2
    if period < developed:
        # 0 of a developed sea, 1 of the steepest; the younger the sea, the more of it is swell
        young = (developed - period) / (developed - STEEPEST * math.sqrt(height))
        share = 0.3 * _e(-((young / 0.5) ** 2)) + 0.7
        steepness = 2.0 * math.pi / GRAVITY * share * height / period**2
        first = Peak(share * height, period, _gamma(height, steepness), n, 4.0)
        rest = math.sqrt(1.0 - share**2) * height  # energies add up, so squares of heights do
        return first, Peak(rest, developed + 2.0, 1.0, n, 4.0)
    old = (period - developed) / (LONGEST - developed)  # 0 of a developed sea, 1: the longest swell
    share = 0.4 * _e(-((old / 0.3) ** 2)) + 0.6
    steepness = 2.0 * math.pi / GRAVITY * height / developed**2
    first = Peak(share * height, period, _gamma(height, steepness) * (1.0 + 6.0 * old), n, 4.0)
    rest = math.sqrt(1.0 - share**2) * height
    # The wind sea's period follows from its height and the level of its tail; 1 s stands for it
    other = Peak(rest, 1.0, 1.0, n, 4.0 * (1.0 - 0.7 * _e(-height / 3.0)))
    level = 0.08 * (1.0 - _e(-height / 3.0)) * _power(0.4, n)
    return first, other._replace(
        period=_power(rest**2 / (16.0 * level * other.whole), 1.0 / (n - 1.0))
    )


def torsethaugen(rate: Vector, height: float, peak: float) -> Vector:
    """Density (n,) [m2 s] of the surface elevation at `rate` (n,) [rad/s].

    `height` is the significant height [m], `peak` the rate of the first peak [rad/s].
    """
    both = peaks(height, 2.0 * math.pi / peak)
    return np.asarray(sum(part.density(rate) for part in both if part.height > 0.0))
