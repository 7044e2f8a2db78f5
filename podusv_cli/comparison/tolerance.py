"""Comparisons of two numbers with a relative tolerance: True, False, or None for too close to tell.

Infinity is the time of an event that never happens; it is later than any number.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable


def _margin(number: float, tolerance: float) -> float:
    """What the tolerance allows around a number; nothing around infinity."""
    return tolerance * abs(number) if math.isfinite(number) else 0.0


def _less(a: float, b: float, tolerance: float) -> bool | None:
    """True where a is less by more than the tolerance, False where b is, else None."""
    margin = _margin(max(abs(a), abs(b)), tolerance)
    if abs(a - b) <= margin:
        return None if margin else False
    return a < b


def _at_most(a: float, b: float, tolerance: float) -> bool:
    return a <= b + _margin(b, tolerance)


SIGNS: dict[type[ast.cmpop], Callable[[float, float, float], bool | None]] = {
    ast.Lt: _less,
    ast.LtE: _at_most,
    ast.Gt: lambda a, b, tolerance: _less(b, a, tolerance),
    ast.GtE: lambda a, b, tolerance: _at_most(-a, -b, tolerance),
    ast.Eq: lambda a, b, tolerance: abs(a - b) <= _margin(b, tolerance),
}
