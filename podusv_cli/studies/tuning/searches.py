"""What laws reach over all of their searches: the result of a search is a random number, too.

Repeats of a search differ in the tuner's random numbers alone. A search counts by the median of a
metric over the fresh draws, a law by the median of its searches. The intervals of the ratios of
all pairs hold together: searches and draws are drawn with replacement, the draws for all laws
alike, and the largest deviation of all pairs, in standard deviations, sets their width (B. Efron
and R. Tibshirani, "An Introduction to the Bootstrap", Chapman and Hall 1993, chapter 8; J. Romano
and M. Wolf, Econometrica 73 (2005), for the largest deviation).
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np
import numpy.typing as npt
import pandas as pd

from podusv_cli.core.kernel import Vector

SAMPLES = 2000
COLUMNS = ["a", "b", "ratio", "ratio_low", "ratio_high"]


def ratios(runs: Mapping[str, Vector], level: float, seed: int) -> pd.DataFrame:
    """Every pair of laws: the ratio a/b of what they reach, with intervals that hold together.

    `runs` are numbers of each law, shape (search, draw), infinite for a run that failed. A pair of
    which a sample is not finite has no interval, unless all samples are infinite on one side.
    """
    random = np.random.default_rng(seed)
    draws = next(iter(runs.values())).shape[1] if runs else 1
    met = random.integers(draws, size=(SAMPLES, draws))
    reached = {law: float(np.median(np.median(table, axis=1))) for law, table in runs.items()}
    samples = {law: _sampled(table, met, random) for law, table in runs.items()}
    pairs = list(combinations(runs, 2))
    with np.errstate(invalid="ignore", divide="ignore"):
        logs = [np.log(reached[a]) - np.log(reached[b]) for a, b in pairs]
        spread = [np.log(samples[a]) - np.log(samples[b]) for a, b in pairs]
        width = _width([s - f for s, f in zip(spread, logs, strict=True)], level)
    rows = [
        (*pair, np.exp(ratio) if np.isfinite(ratio) else _sided(ratio), *_ends(ratio, each, width))
        for pair, ratio, each in zip(pairs, logs, spread, strict=True)
    ]
    return pd.DataFrame(rows, columns=COLUMNS)


def _sampled(table: Vector, met: npt.NDArray[np.int64], random: np.random.Generator) -> Vector:
    """What a law reaches in each sample of its searches and of the draws."""
    searches = random.integers(len(table), size=(SAMPLES, len(table)))
    by_search = np.stack([np.median(runs[met], axis=1) for runs in table], axis=1)
    return np.asarray(np.median(np.take_along_axis(by_search, searches, axis=1), axis=1))


def _width(off: list[Vector], level: float) -> float:
    """How many standard deviations the largest deviation of all pairs stays within."""
    sure = [one / one.std() for one in off if np.isfinite(one).all() and one.std() > 0.0]
    return float(np.quantile(np.max(np.abs(sure), axis=0), level)) if sure else 0.0


def _sided(ratio: float) -> float:
    """A ratio of which one side, or both, failed."""
    return 1.0 if np.isnan(ratio) else float(np.exp(ratio))


def _ends(ratio: float, spread: Vector, width: float) -> tuple[float, float]:
    if np.isfinite(spread).all():
        half = width * spread.std()
        return float(np.exp(ratio - half)), float(np.exp(ratio + half))
    if np.isposinf(spread).all() or np.isneginf(spread).all():
        return float(np.exp(ratio)), float(np.exp(ratio))
    return 0.0, np.inf


def places(pairs: pd.DataFrame, laws: list[str]) -> dict[str, tuple[int, int]]:
    """The least and the largest rank that each law may have, where its intervals leave it open."""
    ranks = {}
    for law in laws:
        first, second = pairs[pairs.a == law], pairs[pairs.b == law]
        worse = int((first.ratio_low > 1.0).sum() + (second.ratio_high < 1.0).sum())
        better = int((first.ratio_high < 1.0).sum() + (second.ratio_low > 1.0).sum())
        ranks[law] = 1 + worse, len(laws) - better
    return ranks
