"""What laws reach over all of their searches: the result of a search is a random number, too.

Repeats of a search differ in the tuner's random numbers alone. In each fresh draw a law counts by
the median over its searches. The interval of a ratio of two laws is the percentile bootstrap over
searches and draws together: both are drawn with replacement, the draws for all laws alike (B.
Efron and R. Tibshirani, "An Introduction to the Bootstrap", Chapman and Hall 1993, section 13.3).
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np
import numpy.typing as npt
import pandas as pd

from podusv_cli.core.kernel import Vector

SAMPLES = 1000
COLUMNS = ["a", "b", "ratio", "ratio_low", "ratio_high"]


def ratios(runs: Mapping[str, Vector], level: float, seed: int) -> pd.DataFrame:
    """Every pair of laws: the median over draws of a/b, with its interval.

    `runs` are numbers of each law, shape (search, draw), infinite for a run that failed. Draws in
    which both failed are left out.
    """
    random = np.random.default_rng(seed)
    draws = next(iter(runs.values())).shape[1] if runs else 0
    met = random.integers(max(draws, 1), size=(SAMPLES, draws))
    typical = {law: np.median(table, axis=0) for law, table in runs.items()}
    resampled = {law: _resampled(table, met, random) for law, table in runs.items()}
    ends = 50.0 * (1.0 - level), 50.0 * (1.0 + level)
    rows = []
    for a, b in combinations(runs, 2):
        sampled = _typical_ratio(resampled[a], resampled[b])
        low, high = np.percentile(sampled, ends, method="inverted_cdf")  # of infinity, too
        rows.append((a, b, _typical_ratio(typical[a], typical[b]), low, high))
    return pd.DataFrame(rows, columns=COLUMNS)


def _resampled(table: Vector, met: npt.NDArray[np.int64], random: np.random.Generator) -> Vector:
    """For each sample, the medians over searches drawn with replacement, in the draws it has."""
    searches = random.integers(len(table), size=(SAMPLES, len(table)))
    return np.stack([np.median(table[i][:, d], axis=0) for i, d in zip(searches, met, strict=True)])


def _typical_ratio(a: Vector, b: Vector) -> Vector:
    """The median of a/b over draws, the last axis; NaN where both failed in all of them."""
    with np.errstate(invalid="ignore", divide="ignore"):
        each = a / b
    each = np.where(np.isnan(each).all(axis=-1, keepdims=True), 1.0, each)
    return np.asarray(np.nanmedian(each, axis=-1))


def places(pairs: pd.DataFrame, laws: list[str]) -> dict[str, tuple[int, int]]:
    """The least and the largest rank that each law may have, where its intervals leave it open."""
    found = {}
    for law in laws:
        first, second = pairs[pairs.a == law], pairs[pairs.b == law]
        worse = int((first.ratio_low > 1.0).sum() + (second.ratio_high < 1.0).sum())
        better = int((first.ratio_high < 1.0).sum() + (second.ratio_low > 1.0).sum())
        found[law] = 1 + worse, len(laws) - better
    return found
