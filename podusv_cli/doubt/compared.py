"""The numbers that a claim compares, and how far each is from where the comparison turns."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from podusv_cli.doubt.judged import Judged

Spread = tuple[float, float, float]  # 5, 50 and 95 %; NaN where no draw has the number


class ClaimNumber(NamedTuple):
    """A number of a claim, and where a comparison of it turns.

    It is compared with a limit; against another number it is the ratio of the two. `edges` are the
    limit, or 1, as far as the claim's tolerance moves it; an equality has two, and so has a strict
    comparison, which cannot tell `between` them.
    """

    left: str
    right: str
    edges: tuple[float, ...]
    between: bool = False

    @property
    def text(self) -> str:
        """The number as the claim has it."""
        return f"({self.left}) / ({self.right})" if self.right else self.left

    def of(self, numbers: Mapping[str, float]) -> float:
        """The number among those of a verdict; NaN where it is missing."""
        left, right = (numbers.get(text, math.nan) for text in (self.left, self.right))
        with np.errstate(all="ignore"):
            return float(np.divide(left, right)) if self.right else left

    def spread(self, claim: str, worlds: Sequence[Judged]) -> Spread:
        """The 5, 50 and 95 % quantiles of the claim's number over `worlds`, the draws.

        Draws without the number are left out; NaN where no draw has it.
        """
        drawn = np.array([self.of(world.numbers.get(claim, {})) for world in worlds])
        finite = drawn[np.isfinite(drawn)]
        # Of NaN alone, quantiles are NaN.
        low, middle, high = np.quantile(finite if len(finite) else math.nan, (0.05, 0.5, 0.95))
        return float(low), float(middle), float(high)

    def margin(self, numbers: Mapping[str, float], spread: Spread) -> float:
        """Its distance from the nearest edge, in half-widths of the spread; infinite at 0."""
        (low, _, high), number = spread, self.of(numbers)
        away = min(abs(number - edge) for edge in self.edges)
        return away / (0.5 * (high - low)) if high > low else math.inf

    def turning(self, base: Mapping[str, float]) -> tuple[float, ...]:
        """The edges at which the comparison turns into the opposite of its answer in `base`.

        Those of an equality; of a strict comparison the one beyond which it can tell again.
        """
        own = self.of(base)
        return (max(self.edges, key=lambda edge: abs(edge - own)),) if self.between else self.edges


def compared_numbers(expect: str, tolerance: float = 0.0) -> list[ClaimNumber]:
    """The numbers that an expression compares; a condition such as `finished(run)` is 1 or 0.

    `tolerance` is the claim's.
    """
    tree = ast.parse(expect, mode="eval").body
    links = []
    for node in (node for node in ast.walk(tree) if isinstance(node, ast.Compare)):
        sides = pairwise([node.left, *node.comparators])
        links += [_link(*pair, sign, tolerance) for pair, sign in zip(sides, node.ops, strict=True)]
    return links or [ClaimNumber(ast.unparse(tree), "", (0.5,))]


# What the right side is times where a comparison turns, for a tolerance.
SIDES: dict[type[ast.cmpop], Callable[[float], tuple[float, ...]]] = {
    ast.Eq: lambda t: (1.0 - t, 1.0 + t),
    ast.LtE: lambda t: (1.0 + t,),
    ast.GtE: lambda t: (1.0 - t,),
}


def _strictly(tolerance: float) -> tuple[float, ...]:
    """What the right side is times at both edges of `<` and `>`.

    They cannot tell within a tolerance of the larger number.
    """
    return (1.0 - tolerance, 1.0 / (1.0 - tolerance)) if tolerance else (1.0,)


def _link(left: ast.expr, right: ast.expr, sign: ast.cmpop, tolerance: float) -> ClaimNumber:
    """The number that a comparison is about, and the edges at which its answer turns.

    An edge moves with `tolerance` as the claim's own comparison does.
    """
    factors, between = SIDES.get(type(sign), _strictly)(tolerance), type(sign) not in SIDES
    with suppress(ValueError):  # not a plain number
        limit = float(ast.literal_eval(right))
        # As `expressions.margins`: <= and >= move by a part of the limit's size, < and > by a
        # part of the larger number
        edges = tuple(limit * f if between else limit + (f - 1.0) * abs(limit) for f in factors)
        return ClaimNumber(ast.unparse(left), "", edges, between)
    with suppress(ValueError):
        limit = float(ast.literal_eval(left))
        return ClaimNumber(ast.unparse(right), "", tuple(limit / f for f in factors), between)
    return ClaimNumber(ast.unparse(left), ast.unparse(right), factors, between)
