"""Metrics that hold an estimator's errors against the covariance that it believes in.

Y. Bar-Shalom, X. R. Li, T. Kirubarajan, "Estimation with Applications to Tracking and Navigation",
Wiley 2001, section 5.4: the squared error over its covariance (NEES) of a consistent filter has
the mean 6 for a state of six numbers, the squared innovation over its variance (NIS) the mean 1
for every measured value that is taken in by itself.
"""

from __future__ import annotations

import math
from typing import Any

from podusv_cli.components.estimators.base import mean_squared_innovation
from podusv_cli.core.kernel import Vector, kernel, scratch, tail
from podusv_cli.core.kinematics import wrap
from podusv_cli.metrics.metric import Accumulator, Measured, Metric, add, ratio
from podusv_cli.metrics.spans import ANEW, WITHIN

TIME, SQUARE, INTEGRALS = range(3)
SIX = 6
OPENED = 2 * INTEGRALS
BEFORE = OPENED + 1  # sums, then numbers of innovations as the window opened
NOW = BEFORE + 2 * SIX
SIZE = NOW + 2 * SIX


# packed: the upper triangle, row by row, of a matrix (order, order). Writes lower (6, 6). Entry (j,
# i) of the triangle stands at order j - j (j - 1)/2 + i - j.
@kernel
def factor(packed: Vector, order: int, lower: Vector) -> bool:
    """Cholesky factor of the first six rows of a packed upper triangle; whether there is one."""
    for i in range(SIX):
        for j in range(i + 1):
            total = packed[order * j - j * (j - 1) // 2 + i - j]
            for c in range(j):
                total -= lower[SIX * i + c] * lower[SIX * j + c]
            if i == j and not total > 0.0:
                return False
            lower[SIX * i + j] = math.sqrt(total) if i == j else total / lower[SIX * j + j]
    return True


# error (6) is overwritten; lower (6, 6) as `factor` writes it. With P = L L^T it is |L^-1 error|^2.
# It is solved from the first row on.
@kernel
def normalised_square(error: Vector, lower: Vector) -> float:
    """error^T P^-1 error, with the factor of P."""
    square = 0.0
    for i in range(SIX):
        for c in range(i):
            error[i] -= lower[SIX * i + c] * error[c]
        error[i] /= lower[SIX * i + i]
        square += error[i] * error[i]
    return square


# Arguments as those of `spans.all_kernels`; changes `seen`. Squares of innovations are sums over
# the run, so those at the window's start (BEFORE) are taken off at the end.
@kernel
def watch(t: float, weight: float, steady: float, s: Vector, k: Any, seen: Vector) -> None:
    """Gather squared errors and squared innovations over the steady window.

    An error without a positive definite covariance is infinite.
    """
    if steady == ANEW:
        seen[OPENED] = seen[TIME] = seen[SQUARE] = 0.0
    if steady >= WITHIN:
        at, order = int(k.estimate), int(k.order)
        after = at + int(k.covariance) + order * (order + 1) // 2
        if seen[OPENED] == 0.0:
            seen[OPENED] = 1.0
            for i in range(2 * SIX):
                seen[BEFORE + i] = s[after + i]
        for i in range(2 * SIX):
            seen[NOW + i] = s[after + i]
        error, lower = scratch(6), scratch(36)
        for i in range(SIX):
            error[i] = s[at + i] - s[i]
        error[2] = wrap(error[2])
        sound = factor(tail(s, at + int(k.covariance)), order, lower)
        if t > 0.0:  # at the start the covariance is 0
            add(seen, INTEGRALS, TIME, weight)
            add(
                seen,
                INTEGRALS,
                SQUARE,
                weight * (normalised_square(error, lower) if sound else math.inf),
            )


def _size(layout: Measured) -> int:
    """How many numbers are gathered; none where the estimator has no covariance."""
    return SIZE if layout.plan.estimate and layout.loop.estimator.covariance[1] else 0


def _constants(layout: Measured) -> dict[str, float]:
    """Where in the states the estimate is, and where in it its covariance, of how many numbers."""
    at, order = layout.loop.estimator.covariance
    return {"estimate": float(layout.plan.estimate), "covariance": float(at), "order": float(order)}


def _nis(seen: Vector, step: float) -> float:
    """The mean squared innovation over its variance, from gathered numbers."""
    gained = seen[NOW:SIZE] - seen[BEFORE:NOW]
    return mean_squared_innovation(gained[:SIX], gained[SIX:])


OF = Accumulator(watch, _size, _constants, INTEGRALS)
nees = Metric(
    "nees",
    "1",
    "mean squared error of the estimate over its covariance, steady window; 6 where "
    "the filter is consistent",
    OF,
    ratio(SQUARE, TIME),
    place=7,
    words="consistency of the estimate (NEES)",
)
nis = Metric(
    "nis",
    "1",
    "mean squared innovation over its variance, steady window; 1 where the filter is consistent",
    OF,
    _nis,
    place=7,
    words="consistency of the innovation (NIS)",
)
