"""What laws reach over all of their searches: the result of a search is a random number, too.

A search counts by the median of a metric over the fresh draws, a law by the median of its searches.
Searches differ in the tuner's random numbers and in the draws that they were trained on. The
intervals of the ratios of all pairs hold together: training sets are drawn with replacement, for
all laws alike, then the searches of each, for every law anew, and the fresh draws, for all laws
alike; the largest deviation of all pairs, in standard deviations, sets their width (B. Efron
and R. Tibshirani, "An Introduction to the Bootstrap", Chapman and Hall 1993, chapter 8; J. Romano
and M. Wolf, Econometrica 73 (2005), for the largest deviation).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
import numpy.typing as npt
import pandas as pd

from podusv_cli.core.kernel import Vector

SAMPLES = 2000  # of the bootstrap: 50 lie beyond either end of a 95 % interval
COLUMNS = ["a", "b", "ratio", "ratio_low", "ratio_high"]
Indices = npt.NDArray[np.int64]


@dataclass(frozen=True)
class LawRatios:
    """All pairs of laws: the logarithms of their ratios a/b, and of those in every sample."""

    pairs: tuple[tuple[str, str], ...]
    ratios: Vector  # (pair,)
    samples: Vector  # (pair, sample)
    level: float

    @cached_property
    def _off(self) -> Vector:
        """The samples' deviations from the ratio, in standard deviations; (pair, sample).

        Only pairs whose samples are all finite and differ.
        """
        with np.errstate(invalid="ignore"):
            off = self.samples - self.ratios[:, None]
        sure = [gaps / gaps.std() for gaps in off if np.isfinite(gaps).all() and gaps.std() > 0.0]
        return np.asarray(sure)

    @cached_property
    def _width(self) -> float:
        """How many standard deviations the largest deviation of all pairs stays within."""
        largest = np.abs(self._off).max(axis=0, initial=0.0)
        return float(np.quantile(largest, self.level)) if len(self._off) else 0.0

    def table(self) -> pd.DataFrame:
        """The ratio of every pair with an interval; all intervals hold together, at `level`."""
        rows = [
            (
                *pair,
                np.exp(ratio) if np.isfinite(ratio) else _one_sided(ratio),
                *_ends(ratio, each, self._width),
            )
            for pair, ratio, each in zip(self.pairs, self.ratios, self.samples, strict=True)
        ]
        return pd.DataFrame(rows, columns=COLUMNS)

    @property
    def omnibus(self) -> float:
        """The probability of a largest difference like this, or larger, where all laws are equal.

        A p-value by the bootstrap's largest deviation; NaN where a pair has no interval.
        """
        if len(self._off) < len(self.pairs) or not self.pairs:
            return float("nan")
        largest = np.max(np.abs(self.ratios) / self.samples.std(axis=1))
        return float(np.mean(np.abs(self._off).max(axis=0) >= largest))

    def power(self, better: float) -> float:
        """How often a law that is so much better than all others would have the first place.

        `better` is the ratio, such as 0.8. The mean over laws, where the others are equal and
        scatter as they do here; NaN where a pair has no interval.
        """
        if len(self._off) < len(self.pairs) or not self.pairs:
            return float("nan")
        laws = dict.fromkeys(law for pair in self.pairs for law in pair)
        # In standard deviations: what the better law would lead by, less the width of its interval.
        needed = -np.log(better) / self.samples.std(axis=1) - self._width
        return float(np.mean([np.mean(self._first(law, needed)) for law in laws]))

    def _first(self, law: str, needed: Vector) -> npt.NDArray[np.bool_]:
        """In which samples (SAMPLES,) a law would lead all others.

        `needed` (pair,) is by how many standard deviations a pair may deviate against it.
        """
        sides = [(place, -1 if pair[0] == law else 1) for place, pair in enumerate(self.pairs)]
        own = [(place, side) for place, side in sides if law in self.pairs[place]]
        ahead = [side * self._off[place] > -needed[place] for place, side in own]
        return np.asarray(np.all(ahead, axis=0))


def compare_laws(
    runs: Mapping[str, Vector], level: float, seed: int, *, sets: int = 1
) -> LawRatios:
    """All pairs of laws over their searches.

    `runs` are numbers of each law, shape (search, draw), infinite for a run that failed. Of `sets`
    training sets, the n-th search of a law is on set n modulo `sets`. A law that was not searched
    has a single row. Raises ValueError where a law's searches are not as many for every set.
    """
    for law, table in runs.items():
        if len(table) > 1 and len(table) % sets:
            raise ValueError(
                f"{law}: {len(table)} searches on {sets} training sets (training_sets)"
            )
    random = np.random.default_rng(seed)
    draws = next(iter(runs.values())).shape[1] if runs else 1
    # The same draws and training sets in each sample for all laws: they are paired.
    met = random.integers(draws, size=(SAMPLES, draws))
    trained = random.integers(sets, size=(SAMPLES, 1, sets))
    samples = {law: _sample_reached(table, met, trained, random) for law, table in runs.items()}
    pairs = tuple(combinations(runs, 2))
    reached = {law: float(np.median(np.median(table, axis=1))) for law, table in runs.items()}
    with np.errstate(invalid="ignore", divide="ignore"):
        ratios = np.array([np.log(reached[a]) - np.log(reached[b]) for a, b in pairs])
        spread = np.array([np.log(samples[a]) - np.log(samples[b]) for a, b in pairs])
        # Without pairs, the array has only one axis.
        spread = spread.reshape(len(pairs), SAMPLES)
        # Drawn with replacement, few training sets scatter less than sets do.
        # So the spread is widened as a sample variance is, by n / (n - 1).
        few = np.sqrt(sets / (sets - 1)) if sets > 1 else 1.0
        centre = np.where(np.isfinite(ratios), ratios, 0.0)[:, None]
        spread = centre + few * (spread - centre)
    return LawRatios(pairs, ratios, spread, level)


def ratios(runs: Mapping[str, Vector], level: float, seed: int, *, sets: int = 1) -> pd.DataFrame:
    """The table of `compare_laws`: a row for each pair, with ratio and interval.

    A pair of which a sample is not finite has no interval, unless all samples are infinite on one
    side.
    """
    return compare_laws(runs, level, seed, sets=sets).table()


def _sample_reached(
    table: Vector, met: Indices, trained: Indices, random: np.random.Generator
) -> Vector:
    """What a law reaches in each sample of training sets, of its searches, and of the draws.

    `table` is (searches, draws); `met` (SAMPLES, draws) are indices of draws and `trained`
    (SAMPLES, 1, sets) those of training sets. Shape (SAMPLES,).
    """
    by_search = np.stack([np.median(runs[met], axis=1) for runs in table], axis=1)
    # A law that was not searched has no searches to draw, whatever the training sets are.
    if len(table) == 1:
        return by_search[:, 0]
    sets = trained.shape[-1]
    repeats = len(table) // sets
    # Search number r * sets + s is the r-th on training set s.
    which = random.integers(repeats, size=(SAMPLES, repeats, sets)) * sets + trained
    searches = which.reshape(SAMPLES, repeats * sets)
    return np.asarray(np.median(np.take_along_axis(by_search, searches, axis=1), axis=1))


def _one_sided(ratio: float) -> float:
    """A ratio of which one side, or both, failed."""
    # NaN is that of two failures: none of the two is ahead.
    return 1.0 if np.isnan(ratio) else float(np.exp(ratio))


def _ends(ratio: float, spread: Vector, width: float) -> tuple[float, float]:
    """The interval of a ratio, from its logarithm and those of all samples, `spread` (n,).

    `width` is half of the interval in standard deviations. Samples that are all infinite to one
    side leave no doubt; otherwise, infinite samples leave everything open.
    """
    if np.isfinite(spread).all():
        half = width * spread.std()
        return float(np.exp(ratio - half)), float(np.exp(ratio + half))
    if np.isposinf(spread).all() or np.isneginf(spread).all():
        return float(np.exp(ratio)), float(np.exp(ratio))
    return 0.0, np.inf


def places(pairs: pd.DataFrame, laws: list[str]) -> dict[str, tuple[int, int]]:
    """The least and the largest rank that each law may have, where its intervals leave it open.

    `pairs` are rows of `LawRatios.table` among these laws.
    """
    ranks = {}
    for law in laws:
        first, second = pairs[pairs.a == law], pairs[pairs.b == law]
        worse = int((first.ratio_low > 1.0).sum() + (second.ratio_high < 1.0).sum())
        better = int((first.ratio_high < 1.0).sum() + (second.ratio_low > 1.0).sum())
        ranks[law] = 1 + worse, len(laws) - better
    return ranks
