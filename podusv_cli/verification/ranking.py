"""Whether the ranking of runs by a metric is independent of the step and exceeds the errors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

from podusv_cli.verification.richardson import StepEstimate


@dataclass(frozen=True)
class Ranking:
    """Labels sorted by a metric, smallest first, at each of the three steps.

    `equal` are neighbours with the same numbers at all steps; `close` are neighbours that differ by
    less than the sum of their errors.
    """

    orders: tuple[tuple[str, ...], ...]
    close: tuple[tuple[str, str], ...]
    equal: tuple[tuple[str, str], ...] = ()

    @property
    def same(self) -> bool:
        """Whether the order is the same at all steps."""
        return len(set(self.orders)) == 1

    @property
    def converged(self) -> bool:
        """Whether the order is the same at all steps, and beyond the errors."""
        return self.same and not self.close


def ranking(estimates: Mapping[str, StepEstimate]) -> Ranking | None:
    """The ranking by one metric, its estimates by label; None where fewer than two have it."""
    known = {label: e for label, e in estimates.items() if not e.undefined}
    if len(known) < 2:
        return None
    # Smallest first, NaN last; equal numbers in the order given.
    values = [{label: e.values[i] for label, e in known.items()} for i in range(3)]
    orders = tuple(tuple(sorted(v, key=lambda run: (math.isnan(v[run]), v[run]))) for v in values)
    pairs = tuple(pairwise(orders[0]))
    equal = tuple((a, b) for a, b in pairs if known[a].values == known[b].values)
    close = tuple(
        (a, b) for a, b in pairs if (a, b) not in equal and _too_close(known[a], known[b])
    )
    return Ranking(orders, close, equal)


def _too_close(a: StepEstimate, b: StepEstimate) -> bool:
    """Whether two laws differ by less than the errors of their numbers."""
    gap, errors = abs(a.values[0] - b.values[0]), a.error + b.error
    # Not `gap <= errors`, which is false where a number of one of them is NaN
    return errors > 0.0 and not gap > errors
