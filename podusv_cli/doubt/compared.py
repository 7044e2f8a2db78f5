"""The numbers that a claim compares, and how far each is from where the comparison turns."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from podusv_cli.doubt.judged import Judged

Spread = tuple[float, float, float]  # 5, 50 and 95 %; NaN where no draw has the number


class ClaimNumber(NamedTuple):
    """A number of a claim, and where a comparison of it turns.

    It is compared with a limit; against another number it is the ratio of the two. `edges` are the
    limit, or 1, as far as the claim's tolerance moves it; an equality has two.
    """

    left: str
    right: str
    edges: tuple[float, ...]

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
        """Its spread over the draws that have it."""
        drawn = np.array([self.of(world.numbers.get(claim, {})) for world in worlds])
        finite = drawn[np.isfinite(drawn)]
        low, middle, high = np.quantile(finite if len(finite) else math.nan, (0.05, 0.5, 0.95))
        return float(low), float(middle), float(high)

    def margin(self, numbers: Mapping[str, float], spread: Spread) -> float:
        """Its distance from the nearest edge, in half-widths of the spread; infinite at 0."""
        low, _, high = spread
        return self.away(numbers) / (0.5 * (high - low)) if high > low else math.inf

    def away(self, numbers: Mapping[str, float]) -> float:
        """Its distance from the nearest edge, in its own unit; infinite where it is missing."""
        away = min(abs(self.of(numbers) - edge) for edge in self.edges)
        return away if math.isfinite(away) else math.inf


def compared(expect: str, tolerance: float = 0.0) -> list[ClaimNumber]:
    """What an expression compares; a condition such as `finished(run)` is 1 or 0."""
    tree = ast.parse(expect, mode="eval").body
    links = []
    for node in (node for node in ast.walk(tree) if isinstance(node, ast.Compare)):
        sides = pairwise([node.left, *node.comparators])
        links += [_link(*pair, sign, tolerance) for pair, sign in zip(sides, node.ops, strict=True)]
    return links or [ClaimNumber(ast.unparse(tree), "", (0.5,))]


# By how many tolerances the right side may be larger or smaller where a comparison turns.
SIDES: dict[type[ast.cmpop], tuple[float, ...]] = {
    ast.Eq: (-1.0, 1.0), ast.LtE: (1.0,), ast.GtE: (-1.0,),
}  # fmt: skip


def _link(left: ast.expr, right: ast.expr, sign: ast.cmpop, tolerance: float) -> ClaimNumber:
    """The tolerance is that of the right side, as `docs/claims.md` has it."""
    factors = tuple(1.0 + side * tolerance for side in SIDES.get(type(sign), (0.0,)))
    with suppress(ValueError):  # not a plain number
        limit = float(ast.literal_eval(right))
        edges = (limit + (factor - 1.0) * abs(limit) for factor in factors)
        return ClaimNumber(ast.unparse(left), "", tuple(edges))
    with suppress(ValueError):
        limit = float(ast.literal_eval(left))
        return ClaimNumber(ast.unparse(right), "", tuple(limit / factor for factor in factors))
    return ClaimNumber(ast.unparse(left), ast.unparse(right), factors)
