"""The power of a sampled signal over frequency."""

from __future__ import annotations

import numpy as np

from podusv_cli.core.kernel import Vector

FEWEST = 4  # samples; of fewer Hann's window leaves one or none


def periodogram(t: Vector, y: Vector) -> tuple[Vector, Vector]:
    """Angular frequencies (m,) [rad/s] of the harmonics, and the signal's mean square in each (m,).

    `y` (n,) are samples at equally spaced times `t` (n,) [s], m is n // 2 + 1. The signal's mean is
    removed. Hann's window keeps a trend or a period that does not fit from leaking into all
    frequencies; it weights the middle of the signal most, and spreads a line over three harmonics.
    Empty for fewer than 4 samples.
    """
    if len(t) < FEWEST:
        return np.zeros(0), np.zeros(0)
    window = np.hanning(len(t))
    # Twice: each harmonic has a mirror image at the negative frequency
    power = 2.0 * np.abs(np.fft.rfft(window * (y - np.mean(y)))) ** 2
    if len(t) % 2 == 0:
        power[-1] *= 0.5  # the fastest harmonic has no mirror image
    rates = 2.0 * np.pi * np.fft.rfftfreq(len(t), (t[-1] - t[0]) / (len(t) - 1))
    return rates, power / (len(t) * np.sum(window**2))
