"""Order and error of a number from its values at three steps, each half of the one before.

If a number has an error C h^p, its values differ by a - b = C h^p (1 - 2^-p) and b - c = 2^-p of
that, so p = log2(|a - b|/|b - c|), and the error at the first step is (a - b)/(1 - 2^-p)
(Richardson). Where the differences do not shrink like this, no order is given and the error is four
times the largest difference. Where they shrink faster than the integrator's order allows, as for a
peak between two instants, no order is given either, and the error is their sum.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

LEAST_ORDER = 0.5  # below this the differences hardly shrink
LARGEST_ORDER = 5.0  # RK4 has order 4
ROUNDING = 1e-12  # relative to the scale; smaller differences are rounding errors
# In the number's own unit (m, N, J, ...). A picometre is what rounding leaves of a place 1 km away
# after thousands of steps; what is that near to 0 has no relative error.
FLOOR = 1e-12
SAFETY = 4.0  # error over the largest difference, where there is no order


@dataclass(frozen=True)
class StepEstimate:
    """A number at three steps, its order of convergence (NaN: none), and its error at the first.

    `scale` is the reference of the relative error: the number itself, or a length for a position.
    An error up to `floor` is none.
    """

    values: tuple[float, float, float]
    order: float
    error: float
    scale: float
    floor: float = FLOOR

    @property
    def relative(self) -> float:
        """The error over the scale; 0 where the error is within the floor."""
        if self.error <= self.floor:
            return 0.0
        return self.error / self.scale if self.scale else math.inf

    def converged(self, tolerance: float) -> bool:
        """Whether the relative error is within the tolerance; false where it is unknown."""
        return self.relative <= tolerance

    def sufficient(self, tolerance: float) -> float:
        """The part of the first step at which the error is within the tolerance: error ~ h^order.

        NaN without an order, 1 where it is within it already.
        """
        if self.converged(tolerance):
            return 1.0
        return float((tolerance / self.relative) ** (1.0 / self.order))

    @property
    def undefined(self) -> bool:
        """Whether the number is NaN at all steps, as a settling time never reached."""
        return all(math.isnan(value) for value in self.values)


def estimate(values: Sequence[float], floor: float = FLOOR) -> StepEstimate:
    """Order and error of a number from its values at the three steps; all may be NaN.

    An error up to `floor`, in the number's unit, is none.
    """
    a, b, c = values
    if all(math.isnan(value) for value in values):
        return StepEstimate((a, b, c), math.nan, 0.0, 0.0)
    return replace(_estimate((a, b, c), abs(a - b), abs(b - c), abs(a)), floor=floor)


def estimate_position(positions: Sequence[np.ndarray], length: float) -> StepEstimate:
    """Order and error of a point; `values` are distances [m] to the point of the finest run.

    `positions` (2,) [m] are those at the three steps, `length` [m] the scale of the relative error.
    """
    a, b, c = positions
    coarse, fine = math.dist(a, b), math.dist(b, c)
    return _estimate((math.dist(a, c), fine, math.dist(c, c)), coarse, fine, length)


def _estimate(
    values: tuple[float, float, float], coarse: float, fine: float, scale: float
) -> StepEstimate:
    """Order and error of three values with steps h, h/2, h/4.

    `coarse` and `fine` are the sizes of their differences, `scale` that of the number itself.
    """
    if not math.isfinite(coarse + fine):
        return StepEstimate(values, math.nan, math.inf, scale)
    # Below this a difference is rounding; it also keeps the logarithm from a difference of 0
    negligible = ROUNDING * max(scale, coarse, fine)
    if max(coarse, fine) <= negligible:
        return StepEstimate(values, math.nan, max(coarse, fine), scale)
    order = math.log2(max(coarse, negligible) / max(fine, negligible))
    if order < LEAST_ORDER:
        return StepEstimate(values, math.nan, SAFETY * max(coarse, fine), scale)
    if order > LARGEST_ORDER:
        return StepEstimate(values, math.nan, coarse + fine, scale)
    return StepEstimate(values, order, coarse / (1.0 - 2.0**-order), scale)
