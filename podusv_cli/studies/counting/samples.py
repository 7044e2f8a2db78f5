"""The statistics of claims, and what each is computed from in one cell: counts or values."""

from __future__ import annotations

import ast
import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.expressions.margins import SIGNS
from podusv_cli.expressions.reading import function, number, refuse
from podusv_cli.expressions.walk import Condition
from podusv_cli.studies.counting import statistics
from podusv_cli.studies.counting.expressions import OverLaws
from podusv_cli.studies.counting.runs import Mask
from podusv_cli.studies.counting.statistics import Interval


@dataclass(frozen=True)
class Sample(ABC):
    """The draws of one cell: how many, and in how many of them a number is unknown.

    In a share's comparisons of two laws, `both_failed` and `close` count the draws in which both
    failed, and those in which they differ by no more than the margin. Of two shares, `differ`
    counts the draws in which exactly one of the two conditions holds.
    """

    cell: str
    n: int
    unknown: int
    both_failed: int = field(default=0, kw_only=True)
    close: int = field(default=0, kw_only=True)
    differ: int = field(default=0, kw_only=True)
    has_margin: ClassVar[bool]  # of the bound that the statistic is compared with

    @abstractmethod
    def interval(self, level: float) -> Interval:
        """The statistic with its interval; `level` is the confidence, as 0.95."""

    @abstractmethod
    def draws_needed(
        self, sign: ast.cmpop, bound: float, margin: float, level: float
    ) -> int | None:
        """Draws that would decide a comparison if they continue like these; None: none would.

        `bound` is the other side, `margin` how far beyond it counts, `level` the confidence.
        """

    def holds(self, sign: ast.cmpop, bound: float, margin: float, level: float) -> bool | None:
        """Whether the comparison holds at both ends of the interval, at none, or else (None).

        `bound`, `margin` and `level` as in `draws_needed`. None as well where there are no draws.
        """
        span, margin = self.interval(level), margin if self.has_margin else 0.0
        ends = [bool(SIGNS[type(sign)](end, bound, margin)) for end in (span.low, span.high)]
        return ends[0] if self.n and ends[0] == ends[1] else None


@dataclass(frozen=True)
class Share(Sample):
    """A share of draws: those in which something held. The margin is inside what held."""

    yes: int
    has_margin = False

    def interval(self, level: float) -> Interval:
        """Clopper and Pearson's interval at this level."""
        if not self.n:
            return Interval(math.nan, 0.0, 1.0)
        return statistics.share(self.yes, self.n, level, self.unknown)

    def draws_needed(
        self, sign: ast.cmpop, bound: float, margin: float, level: float
    ) -> int | None:
        """As if the share stayed as it is."""
        return statistics.draws_for_share(self.yes / self.n, bound, level) if self.n else None


@dataclass(frozen=True)
class Discordant(Sample):
    """Two conditions in the same draws: the first alone, of the draws in which one is alone.

    Below one half where the first has the smaller share. Under equal shares the number is
    binomial, which makes McNemar's test exact (McNemar 1947; Agresti, "Categorical Data
    Analysis", section 10.1).
    """

    first: int
    has_margin = False

    def interval(self, level: float) -> Interval:
        """Clopper and Pearson's interval at this level; undecided draws could be in either part."""
        if not self.differ + self.unknown:
            return Interval(math.nan, 0.0, 1.0)
        return statistics.share(self.first, self.differ + self.unknown, level, self.unknown)

    def draws_needed(
        self, sign: ast.cmpop, bound: float, margin: float, level: float
    ) -> int | None:
        """As if the shares of draws with one alone stayed as they are: scaled up to all draws."""
        if not self.differ:
            return None
        more = statistics.draws_for_share(self.first / self.differ, bound, level)
        return more and math.ceil(more * self.n / self.differ)


@dataclass(frozen=True)
class Quantile(Sample):
    """A quantile of one value for each draw."""

    values: Vector
    q: float
    has_margin = True

    def interval(self, level: float) -> Interval:
        """The interval at this level, between two of the values: valid for any distribution."""
        if not self.n:
            return Interval(math.nan, -math.inf, math.inf)
        return statistics.quantile(self.values, self.q, level)

    def draws_needed(
        self, sign: ast.cmpop, bound: float, margin: float, level: float
    ) -> int | None:
        """As if the share of values within the bound stayed as it is.

        A quantile at share q lies below a bound if, and only if, a share q of the values does.
        """
        if not self.n:
            return None
        held = float(np.mean(SIGNS[type(sign)](self.values, bound, margin)))
        upper = isinstance(sign, (ast.Lt, ast.LtE))
        return statistics.draws_for_share(held, self.q if upper else 1.0 - self.q, level)


SHARE, FAILURES, QUANTILE, MEDIAN = "share", "failures", "quantile", "median"
ALONE = "alone"  # of two shares; `claims` writes it for a comparison of them
# Statistics: from the call and a walk over runs to the sample of a cell, among its used draws.
Sampler = Callable[[str, int, Mask], Sample]


def _condition(call: ast.Call, walk: OverLaws) -> Condition:
    """In which draws (cells, draws) the condition holds whose share is wanted.

    That is the argument of `share`, or for `failures(law)` that the law's run is no success.
    """
    if function(call) == FAILURES:
        return Condition.known_everywhere(~walk.runs.success(walk.only(call)))
    return walk.condition(_arguments(call, 1, "one condition, as in share(a.iae < b.iae)")[0])


def _share(call: ast.Call, walk: OverLaws) -> Sampler:
    """A sampler that counts, in one cell, the draws in which a condition holds."""
    held = _condition(call, walk)

    def sample(label: str, cell: int, used: Mask) -> Share:
        """The count in a cell among the draws `used` (draws,); unknown where it is undecided."""

        # Of a mask (cells, draws).
        def count(where: Mask) -> int:
            return int(np.sum(where[cell] & used))

        unknown = count(~held.yes & ~held.no)
        failed, close = (sum(map(count, masks)) for masks in (walk.both_failed, walk.close))
        n, yes = int(used.sum()), count(held.yes)
        return Share(label, n, unknown, yes, both_failed=failed, close=close)

    return sample


def _discordant(call: ast.Call, walk: OverLaws) -> Sampler:
    """A sampler that counts, in one cell, the draws in which only one of two conditions holds."""
    first, second = (_condition(share, walk) for share in call.args if isinstance(share, ast.Call))

    def sample(label: str, cell: int, used: Mask) -> Discordant:
        """The count in a cell among the draws `used` (draws,), and those that are undecided."""

        def count(where: Mask) -> int:
            return int(np.sum(where[cell] & used))

        decided = (first.yes | first.no) & (second.yes | second.no)
        alone, other = count(first.yes & second.no), count(first.no & second.yes)
        return Discordant(label, int(used.sum()), count(~decided), alone, differ=alone + other)

    return sample


def _quantile(call: ast.Call, walk: OverLaws) -> Sampler:
    return _at_share(*part_of(call, DRAWS), walk)


class Wording(NamedTuple):
    """What messages call a run, a number and a ratio of numbers."""

    each: str
    number: str
    ratio: str


DRAWS = Wording("draw", "a.iae", "a.iae / b.iae")


def part_of(call: ast.Call, wording: Wording) -> tuple[ast.expr, float]:
    """The expression that a median or quantile is taken of, and its share from 0 to 1.

    `wording` has the examples for messages. Raises ExpressionError.
    """
    if function(call) == MEDIAN:
        wanted = f"one number of each {wording.each}, as in median({wording.ratio})"
        return _arguments(call, 1, wanted)[0], statistics.MEDIAN
    example = f"quantile({wording.number}, 0.95)"
    node, share = _arguments(call, 2, f"a number of each {wording.each} and a share: {example}")
    if not 0.0 < number(share) < 1.0:
        refuse(call, f"the share must lie between 0 and 1, as in {example}")
    return node, number(share)


def _at_share(node: ast.expr, q: float, walk: OverLaws) -> Sampler:
    """A sampler for the quantile at share `q` (0 to 1) of the expression `node` over the draws."""
    values = walk.side(node)

    def sample(label: str, cell: int, used: Mask) -> Quantile:
        """The quantile in a cell over the draws `used` (draws,), failures as infinity."""
        chosen = values[cell][used]
        return Quantile(label, len(chosen), int(np.isnan(chosen).sum()), chosen, q)

    return sample


def _arguments(call: ast.Call, count: int, wanted: str) -> list[ast.expr]:
    """The arguments of a call. Raises ExpressionError unless there are `count`."""
    if len(call.args) != count:
        refuse(call, f"{function(call)} takes {wanted}")
    return call.args


STATISTICS: dict[str, Callable[[ast.Call, OverLaws], Sampler]] = {
    SHARE: _share,
    FAILURES: _share,
    QUANTILE: _quantile,
    MEDIAN: _quantile,
}
SAMPLERS = STATISTICS | {ALONE: _discordant}
