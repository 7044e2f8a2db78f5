"""Pairs of laws in the same draw, and rank correlations, against numbers worked out by hand."""

from __future__ import annotations

import math
from itertools import permutations

import numpy as np
import pytest

from podusv_cli.studies.counting import statistics as st

inf, nan = math.inf, math.nan


def rank_correlation(x: np.ndarray, y: np.ndarray) -> float:
    return st.rank_correlations({"x": st.centre_ranks(x)}, y)["x"]


def test_pairs_count_wins_beyond_the_margin_and_both_failing_as_a_tie() -> None:
    a = np.array([1.0, 1.0, 2.0, inf, inf, 1.0, nan])
    b = np.array([2.0, 1.005, 1.0, inf, 1.0, inf, 1.0])
    found = st.pairs(a, b, 0.01)
    assert found == st.Pairs(n=7, wins=2, losses=2, both_failed=1, unknown=1)
    assert found.ties == 2  # 1 against 1.005, and both failed
    assert found.win_rate(0.95) == st.share(2, 7, 0.95, unknown=1)
    assert found.loss_rate(0.95) == st.share(2, 7, 0.95, unknown=1)
    assert st.pairs(a, b, 0.0).wins == 3


def test_the_margin_is_of_the_larger_of_two_numbers_whatever_their_signs() -> None:
    a = np.array([98.9, 99.0, -100.0, -100.0, -0.001, 0.0])
    b = np.array([100.0, 100.0, -98.9, -99.0, 0.0, 0.001])
    assert st.below(a, b, 0.01).tolist() == [True, False, True, False, True, True]
    assert not st.below(b, a, 0.01).any()


def test_ratios_of_failed_runs() -> None:
    a, b = np.array([3.0, inf, 1.0, inf, 0.0, nan]), np.array([2.0, 1.0, inf, inf, 0.0, 1.0])
    assert st.ratios(a, b)[:5].tolist() == [1.5, inf, 0.0, 1.0, 1.0]
    assert math.isnan(st.ratios(a, b)[5])


def test_ranks_share_ties_and_failures_are_worst() -> None:
    values = np.array([5.0, 1.0, inf, 5.0, inf])
    assert st.ranks(values).tolist() == [2.5, 1.0, 4.5, 2.5, 4.5]


def test_rank_correlation_of_known_rows() -> None:
    x = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    assert rank_correlation(x, np.exp(x)) == pytest.approx(1.0)
    assert rank_correlation(x, np.array([1.0, 2.0, 3.0, inf, inf])) > 0.97
    # 1 - 6 sum(d^2) / (n (n^2 - 1)) with d = 1, 1, 0, 1, 1
    assert rank_correlation(x, np.array([2.0, 1.0, 3.0, 5.0, 4.0])) == pytest.approx(0.8)
    assert math.isnan(rank_correlation(x, np.ones(5)))
    y = np.array([2.0, 1.0, nan, 5.0, 4.0])
    assert rank_correlation(x, y) == pytest.approx(0.6)
    # Ranks less their mean: -1.5 + 0.5 - 0.5 + 1.5, and nothing that rounding leaves
    assert rank_correlation(np.arange(4.0), np.array([7.0, 3.0, 3.0, 7.0])) == 0.0


def test_unrelated_quantities_stay_within_what_chance_gives() -> None:
    x = np.arange(6.0)  # all its orders are equally likely
    found = [rank_correlation(x, np.array(order)) for order in permutations(x)]
    spread = math.sqrt(np.mean(np.square(found)))
    assert st.by_chance(6, 0.95) == pytest.approx(1.959964 * spread, rel=1e-6)
    assert [st.by_chance(n, 0.95) for n in (0, 1, 2)] == [1.0, 1.0, 1.0]
