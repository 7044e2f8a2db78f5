"""Reading between the rows of a table, and between two instants; for kernels."""

from __future__ import annotations

from podusv_cli.core.kernel import Vector, kernel


# t and times (count) in the same unit. The place lies in [low, high) all along; before the first
# time `low` stays 0.
@kernel
def segment(t: float, count: int, times: Vector) -> int:
    """Index of the last of `count` increasing times at or before t, by bisection; 0 before all."""
    low = 0
    high = count
    while high - low > 1:
        middle = (low + high) >> 1  # a register of whole numbers is not divided
        if times[middle] <= t:
            low = middle
        else:
            high = middle
    return low


@kernel
def linear(s: float, before: float, after: float) -> float:
    """The straight line from `before` at s = 0 to `after` at s = 1."""
    return before + s * (after - before)


@kernel
def passing_place(level: float, before: float, after: float) -> float:
    """Where on the straight line from `before` (0) to `after` (1) the level is passed."""
    return (level - before) / (after - before)


# s in [0, 1] is the share of the way; slopes are rates [of `before` a second], hence times
# `length`.
@kernel
def cubic(
    s: float, length: float, before: float, after: float, slope_before: float, slope_after: float
) -> float:
    """Hermite's cubic between two rows that are `length` [s] apart, with these slopes [1/s]."""
    rest = 1.0 - s
    values = (1.0 + 2.0 * s) * rest * rest * before + s * s * (3.0 - 2.0 * s) * after
    return values + length * s * rest * (rest * slope_before - s * slope_after)
