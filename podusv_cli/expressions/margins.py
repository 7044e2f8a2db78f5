"""Comparisons of numbers, or of arrays, with a relative margin.

Infinity is the time of an event that never happens, or a failure; it is larger than any number, and
has no margin.
"""

from __future__ import annotations

import ast
from collections.abc import Callable
from typing import Any

import numpy as np


def below(a: Any, b: Any, margin: float) -> Any:
    """Where a is smaller than b by more than the margin, relative to the larger of the two."""
    with np.errstate(invalid="ignore"):
        return np.subtract(b, a) > around(np.maximum(np.abs(a), np.abs(b)), margin)


def at_most(a: Any, b: Any, margin: float) -> Any:
    """Where a exceeds b by no more than the margin, relative to b."""
    return np.less_equal(a, np.add(b, around(b, margin)))


def around(number: Any, margin: float) -> Any:
    """What the margin allows around a number; nothing around infinity."""
    return margin * np.abs(np.where(np.isfinite(number), number, 0.0))


SIGNS: dict[type[ast.cmpop], Callable[[Any, Any, float], Any]] = {
    ast.Lt: below,
    ast.LtE: at_most,
    ast.Gt: lambda a, b, margin: below(b, a, margin),
    ast.GtE: lambda a, b, margin: at_most(-a, -b, margin),
}
