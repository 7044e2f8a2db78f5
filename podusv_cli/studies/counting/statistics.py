"""Statistics of a study: intervals that hold for any distribution, win rates, Holm's correction.

Metrics are smaller-is-better. A failed run is +inf. NaN is a number that nobody knows: it may lie
anywhere, so it widens an interval, and in an estimate it counts as the worst. All intervals are
two-sided: each side misses with a probability of at most (1 - level) / 2. Functions work along the
last axis. docs/claims.md gives the sources.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import inf, nan, sqrt
from typing import Any, NamedTuple, Self

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.expressions.margins import below

MOST = 1_000_000_000  # draws; beyond this `draws_for_share` gives up
MEDIAN = 0.5


class Interval(NamedTuple):
    """An estimate and the ends of its interval: numbers, or arrays of them."""

    estimate: Any
    low: Any
    high: Any

    @classmethod
    def of(cls, row: Any, name: str) -> Self:
        """The interval of the number `name` in a row of a table.

        Its columns are those that `columns` names.
        """
        return cls(row[name], row[f"{name}_low"], row[f"{name}_high"])

    def columns(self, name: str) -> dict[str, Any]:
        """The number and the ends by the names of their columns."""
        return {name: self.estimate, f"{name}_low": self.low, f"{name}_high": self.high}

    def __format__(self, form: str) -> str:
        """`0.12 [0.1, 0.14]`, as `text` gives it."""
        return self.text(form)

    def text(self, form: str = "", infinite: str = "failed") -> str:
        """`0.12 [0.1, 0.14]`, or the estimate alone where there is no interval.

        `form` is a format as `.3g`; with a % at its end the numbers are shares, printed in percent.
        An empty `form` is `.5g`. `infinite` is the word for an estimate or end of +inf. Where both
        ends print like the estimate, the words "no spread" take their place.
        """
        estimate, low, high = self._texts(form, infinite)
        whole = estimate + self._percent(form)
        if np.isnan(self.low):
            return whole
        if not low == estimate == high:
            return f"{whole} [{low}, {high}]"
        # The word for infinity says enough: "failed, no spread" would say no more.
        return whole if np.isinf(self.estimate) else f"{whole}, no spread"

    def ends(self, form: str, infinite: str = "failed") -> str:
        """`0.1 to 0.14`, one of both where they print the same, `-` without an interval."""
        _, low, high = self._texts(form, infinite)
        ends = low if low == high else f"{low} to {high}"
        return "-" if np.isnan(self.low) else ends + self._percent(form)

    @staticmethod
    def _percent(form: str) -> str:
        return " %" if form.endswith("%") else ""

    def _texts(self, form: str, infinite: str) -> list[str]:
        """Estimate, low and high as text.

        `form` and `infinite` as in `text`, without the % sign itself.
        """
        factor, form = (100.0, form[:-1]) if form.endswith("%") else (1.0, form)
        return [digits(factor * number, form or ".5g", infinite) for number in self]


def digits(number: float, form: str = ".5g", infinite: str = "failed") -> str:
    """A number of a study as text in the format `form`: a dash for NaN.

    `infinite` is the word for +inf (a failed run makes it so); -inf is an interval without lower
    limit.
    """
    if np.isnan(number):
        return "-"
    if np.isinf(number):
        return infinite if number > 0.0 else "no limit"
    # -0.0 would have its sign.
    return f"{number:{form}}" if number else "0"


def share(yes: Any, n: Any, level: float, unknown: Any = 0) -> Interval:
    """A probability, from how often it happened in n draws: Clopper and Pearson's exact interval.

    `yes` of `n` draws had it, and of `unknown` draws nobody knows: numbers, or arrays of one shape.
    `level` is the confidence, as 0.95. The estimate counts unknown draws as no. The low end counts
    them as no as well, the high end as yes.
    """
    from scipy.special import betaincinv  # slow to import

    tail, n, most = (1.0 - level) / 2.0, np.asarray(n, float), np.add(yes, unknown)
    # Both branches of `where` are computed: betaincinv has no value at 0 of n and at n of n.
    with np.errstate(all="ignore"):
        low = np.where(np.equal(yes, 0), 0.0, betaincinv(yes, n - yes + 1.0, tail))
        high = np.where(np.equal(most, n), 1.0, betaincinv(most + 1.0, n - most, 1.0 - tail))
        return Interval(np.divide(yes, n)[()], low[()], high[()])


def quantile(values: Vector, q: float, level: float) -> Interval:
    """The q-quantile of `values` (n,), between two of the sorted values.

    The interval is valid for any distribution. The estimate is the smallest value that a share q of
    the values does not exceed. An end is infinite where there are too few values for one. `level`
    is the confidence, as 0.95.
    """
    return quantiles(values, (q,), level)[0]


def quantiles(values: Vector, shares: Sequence[float], level: float) -> list[Interval]:
    """Quantiles of `values` (n,) at each of `shares` (0 to 1), with intervals of this level.

    `values` is sorted once for all of them, and `level` is the confidence. NaN counts as +inf for
    the estimate and the high end, and as -inf for the low end: an unknown value could be either.
    """
    n = values.shape[-1]
    unknown = np.isnan(values).any()
    high = np.sort(np.where(np.isnan(values), inf, values), axis=-1)
    low = np.sort(np.where(np.isnan(values), -inf, values), axis=-1) if unknown else high
    return [
        Interval(
            _at(high, _middle(n, q)),
            _at(low, _rank(n, q, level)),
            _at(high, n + 1 - _rank(n, 1.0 - q, level)),
        )
        for q in shares
    ]


def _middle(n: int, q: float) -> int:
    """The rank (from 1) of the q-quantile's estimate: the smallest whose share of n is q or more.

    The factor keeps rounding in q * n, as in 0.07 * 100 > 7, from raising the rank by one.
    """
    return min(max(int(np.ceil(q * n * (1.0 - 1e-12))), 1), n)


@cache
def _rank(n: int, q: float, level: float) -> int:
    """The rank (from 1) of the lower end of the q-quantile's interval; 0 where n is too small.

    It is the largest r for which r - 1 or fewer of `n` draws lie below the quantile with a
    probability of at most (1 - level) / 2. `q` is from 0 to 1, `level` the confidence.
    """
    from scipy.special import bdtr  # slow to import

    tail = (1.0 - level) / 2.0
    return bisect_right(range(1, n + 1), tail, key=lambda r: float(bdtr(r - 1, n, q)))


def _at(ordered: Vector, rank: int) -> Any:
    """The value of this rank, from 1, in `ordered` (n,); infinite for a rank that is not there."""
    n = ordered.shape[-1]
    if 1 <= rank <= n:
        return ordered[..., rank - 1][()]
    return np.full(ordered.shape[:-1], inf if rank > n else -inf)[()]


@dataclass(frozen=True)
class Pairs:
    """How often one law's metric is below the other's in the same draw by more than the margin.

    `ties` are all other pairs, those in which both failed among them. Where a number is `unknown`
    there is no pair.
    """

    n: int
    wins: int
    losses: int
    both_failed: int
    unknown: int

    @property
    def ties(self) -> int:
        """Pairs without a winner."""
        return self.n - self.wins - self.losses - self.unknown

    def win_rate(self, level: float) -> Interval:
        """The share of draws in which the first law wins, at this level; a tie is no win."""
        return share(self.wins, self.n, level, self.unknown)

    def loss_rate(self, level: float) -> Interval:
        """The share of draws in which the second law wins, at this level."""
        return share(self.losses, self.n, level, self.unknown)


def pairs(a: Vector, b: Vector, margin: float) -> Pairs:
    """Compare one metric of two laws that met the same draws; less is better.

    `a` and `b` (draws,) are its values: inf for a failed run, NaN for an unknown one. Values that
    differ by at most `margin`, relative to the larger of the two, are a tie.
    """
    wins, losses = below(a, b, margin), below(b, a, margin)
    failed, unknown = np.isposinf(a) & np.isposinf(b), np.isnan(a) | np.isnan(b)
    return Pairs(len(a), *(int(where.sum()) for where in (wins, losses, failed, unknown)))


def ratios(a: Vector, b: Vector) -> Vector:
    """a / b (draws,), defined where runs failed, too.

    Equal values, also two failures or two zeros, have 1. The ratio is inf where only a failed, and
    0 where only b did.
    """
    with np.errstate(all="ignore"):
        return np.where(np.equal(a, b), 1.0, np.where(np.isposinf(a), inf, a / b))


def draws_for_share(estimate: float, bound: float, level: float) -> int | None:
    """How many draws it takes until a share's interval leaves out `bound`.

    The share is taken to stay as it is. `estimate` and `bound` are shares from 0 to 1, `level` is
    the confidence. None where no number of draws would do: the estimate lies on the bound, or more
    than MOST draws are needed.
    """
    from scipy.special import betainc  # slow to import

    # Mirrored, so that only the lower end of the interval has to pass the bound.
    if estimate < bound:
        estimate, bound = 1.0 - estimate, 1.0 - bound
    tail = (1.0 - level) / 2.0

    def decides(n: int) -> bool:
        yes = estimate * n
        return bool(betainc(yes, n - yes + 1.0, bound) <= tail)

    # A difference of rounding alone, such as 0.95 of 1 - 0.05.
    if estimate - bound <= 1e-12:
        return None
    # More draws of the same share decide more, so halving finds the first count.
    count = 1 + bisect_left(range(1, MOST + 1), True, key=decides)
    return count if count <= MOST else None


def holm(decides: Callable[[int, float], bool], count: int, level: float) -> list[float]:
    """The level of each of `count` claims by Holm's step-down procedure.

    `decides(i, level)` says whether claim i is decided by intervals of this level. The claims
    that are still open share 1 - level equally; each that is decided leaves more to the others.
    The probability that any claim is decided wrongly is then at most 1 - level.
    """
    levels, left = [level] * count, list(range(count))
    while left:
        each = 1.0 - (1.0 - level) / len(left)
        for i in left:
            levels[i] = each
        undecided = [i for i in left if not decides(i, each)]
        # Nothing more is decided, so the level of those that are left cannot become easier.
        if len(undecided) == len(left):
            break
        left = undecided
    return levels


def ranks(values: Vector) -> Vector:
    """Ranks (n,) from 1; equal values, failures (+inf) among them, share their mean rank."""
    _, places, counts = np.unique(values, return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(counts) - (counts - 1) / 2.0)[places])


def centre_ranks(values: Vector) -> Vector:
    """Ranks (n,) less their mean: whole numbers of halves, whose sums of products are exact."""
    return ranks(values) - (len(values) + 1) / 2.0


def rank_correlations(quantities: Mapping[str, Vector], metric: Vector) -> dict[str, float]:
    """Spearman's rank correlation of a metric (draws,) with every quantity, by name.

    A quantity (draws,) is given as `centre_ranks` makes it, once for all metrics. Draws without the
    metric (NaN) are left out. NaN where one of the two does not vary.
    """
    known = ~np.isnan(metric)
    y, whole = centre_ranks(metric[known]), bool(known.all())
    # Where no draw is left out, the ranks of all draws serve as they are.
    return {
        name: _cosine(x if whole else centre_ranks(x[known]), y) for name, x in quantities.items()
    }


def _cosine(x: Vector, y: Vector) -> float:
    square = float(x @ x) * float(y @ y)
    return float(x @ y) / sqrt(square) if square > 0.0 else nan


def by_chance(n: int, level: float) -> float:
    """The rank correlation that two unrelated quantities stay within, on either side, in `n` draws.

    It is the normal approximation z / sqrt(n - 1) at this `level`, as 0.95; 1 where n is too small.
    """
    from scipy.special import ndtri  # slow to import

    return min(float(ndtri((1.0 + level) / 2.0)) / np.sqrt(n - 1.0), 1.0) if n > 1 else 1.0
