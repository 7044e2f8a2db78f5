"""Intervals of a study against known answers, and how often they contain the truth."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from rotation import one_in

from podusv_cli.studies.counting import statistics as st

inf, nan = math.inf, math.nan
STUDIES = 2000


def binomial(k: int, n: int, p: float) -> float:
    """The probability of k of n, by its definition."""
    return math.comb(n, k) * p**k * (1 - p) ** (n - k)


# limits of the share -----------------------------------------------------------------------------


@pytest.mark.parametrize("n", [1, 3, 10, 368])
def test_a_share_without_a_single_case_has_the_closed_form(n: int) -> None:
    none, all_ = st.share(0, n, 0.95), st.share(n, n, 0.95)
    assert none == pytest.approx((0.0, 0.0, 1 - 0.025 ** (1 / n)))
    assert all_ == pytest.approx((1.0, 0.025 ** (1 / n), 1.0))


@pytest.mark.parametrize(("k", "n"), [(1, 2), (3, 10), (7, 10), (19, 20)])
def test_the_ends_of_a_share_leave_half_of_the_rest_on_each_side(k: int, n: int) -> None:
    estimate, low, high = st.share(k, n, 0.9)
    assert estimate == k / n
    assert sum(binomial(i, n, low) for i in range(k, n + 1)) == pytest.approx(0.05)
    assert sum(binomial(i, n, high) for i in range(k + 1)) == pytest.approx(0.05)


def test_a_published_interval() -> None:
    # 10 of 100 at 95 %: 4.90 to 17.62 %, in every table of exact binomial limits
    assert st.share(10, 100, 0.95) == pytest.approx((0.10, 0.0490, 0.1762), abs=5e-5)


def test_the_ends_of_a_share_grow_with_the_count_and_the_level() -> None:
    _, low, high = st.share(np.arange(31), 30, 0.95)
    assert (np.diff(low) > 0).all()
    assert (np.diff(high) > 0).all()
    wider = [st.share(4, 30, level) for level in (0.5, 0.9, 0.99)]
    assert all(b.low < a.low and b.high > a.high for a, b in pairwise(wider))


def test_unknown_draws_widen_a_share_as_if_they_were_all_yes_or_all_no() -> None:
    assert st.share(3, 10, 0.95, unknown=2) == (
        0.3,
        st.share(3, 10, 0.95).low,
        st.share(5, 10, 0.95).high,
    )


# quantiles ---------------------------------------------------------------------------------------


def smallest_interval_ranks(n: int, q: float, tail: float) -> tuple[int, int]:
    """Ranks of the ends, from sums of the binomial distribution."""
    below = [sum(binomial(i, n, q) for i in range(r)) for r in range(n + 2)]  # P(B < r)
    low = max(r for r in range(n + 1) if below[r] <= tail)
    high = min(r for r in range(1, n + 2) if 1 - below[r] <= tail + 1e-15)
    return low, high


@pytest.mark.parametrize(("n", "q"), [(6, 0.5), (20, 0.5), (20, 0.25), (45, 0.95), (90, 0.05)])
def test_the_ends_of_a_quantile_are_the_order_statistics_of_the_binomial_sums(
    n: int, q: float
) -> None:
    values = np.random.default_rng(1).permutation(np.arange(1.0, n + 1))
    low, high = smallest_interval_ranks(n, q, 0.025)
    found = st.quantile(values, q, 0.95)
    assert found.low == (low or -inf)
    assert found.high == (high if high <= n else inf)
    assert found.estimate == np.quantile(values, q, method="inverted_cdf")


def test_known_ranks_of_a_median() -> None:
    # Conover, table of order statistics: of 20 values, the 6th and the 15th hold the median
    assert st.quantile(np.arange(1.0, 21.0), 0.5, 0.95) == (10.0, 6.0, 15.0)
    assert st.quantile(np.arange(1.0, 7.0), 0.5, 0.95)[1:] == (1.0, 6.0)
    # of 100 values, the k-th is the k % quantile, although 0.07 * 100 is more than 7 in floats
    ordered = np.arange(1.0, 101.0)
    assert [st.quantile(ordered, k / 100, 0.95).estimate for k in range(1, 100)] == [*range(1, 100)]


def test_too_few_draws_leave_a_side_open_instead_of_wrong() -> None:
    assert st.quantile(np.arange(5.0), 0.5, 0.95)[1:] == (-inf, inf)
    # a single value lies above the 99 % quantile with probability 1 % only
    assert st.quantile(np.array([2.0]), 0.99, 0.95) == (2.0, 2.0, inf)
    # the largest of n exceeds the 99 % quantile with probability 1 - 0.99**n: 367 are too few
    assert st.quantile(np.arange(367.0), 0.99, 0.95).high == inf
    assert st.quantile(np.arange(368.0), 0.99, 0.95).high == 367.0


def test_failures_and_unknown_values_of_a_quantile() -> None:
    failed = st.quantile(np.array([*range(15), *[inf] * 5]), 0.5, 0.95)
    assert failed == (9.0, 5.0, 14.0)
    assert st.quantile(np.array([*range(8), *[inf] * 12]), 0.5, 0.95) == (inf, 5.0, inf)
    unknown = st.quantile(np.array([*range(18), nan, nan]), 0.5, 0.95)
    assert unknown == (9.0, 3.0, 14.0)  # as if they were the two smallest, or the two largest


def test_a_quantile_grows_with_q_and_its_interval_with_the_level() -> None:
    values = np.random.default_rng(2).normal(size=200)
    found = [st.quantile(values, q, 0.95) for q in (0.05, 0.25, 0.5, 0.75, 0.95)]
    assert all(a < b for column in zip(*found, strict=True) for a, b in pairwise(column))
    wider = [st.quantile(values, 0.3, level) for level in (0.5, 0.9, 0.99)]
    assert all(b.low < a.low and b.high > a.high for a, b in pairwise(wider))


@pytest.mark.parametrize("n", [40, 173])
def test_a_quantile_excludes_a_bound_exactly_where_the_share_below_it_excludes_q(n: int) -> None:
    values = np.random.default_rng(3).exponential(size=n)
    for bound in np.linspace(0.1, 3.0, 40):
        _, low, high = st.quantile(values, 0.7, 0.95)
        _, least, most = st.share((values <= bound).sum(), n, 0.95)
        assert (high <= bound) == (least >= 0.7)
        assert (low > bound) == (most <= 0.7)


# coverage ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [1, 5, 30, 200])
@pytest.mark.parametrize("p", [0.0005, 0.02, 0.3, 0.5, 0.95, 0.999])
def test_the_interval_of_a_share_contains_the_truth(p: float, n: int) -> None:
    yes = np.random.default_rng(4).binomial(n, p, STUDIES)
    _, low, high = st.share(yes, n, 0.95)
    assert ((low <= p) & (p <= high)).mean() >= 0.94


# samples of a distribution, and its quantile function
DISTRIBUTIONS = {
    "normal": (lambda r, s: r.normal(size=s), lambda q: math.sqrt(2) * erfinv(2 * q - 1)),
    "lognormal": (
        lambda r, s: np.exp(2 * r.normal(size=s)),
        lambda q: math.exp(2 * math.sqrt(2) * erfinv(2 * q - 1)),
    ),
    "cauchy": (lambda r, s: r.standard_cauchy(s), lambda q: math.tan(math.pi * (q - 0.5))),
    "dice": (lambda r, s: r.integers(1, 7, s).astype(float), lambda q: math.ceil(6 * q)),
    "a tenth fails": (
        lambda r, s: np.where((u := r.random(s)) < 0.9, u, inf),
        lambda q: q if q < 0.9 else inf,
    ),
}


def erfinv(y: float) -> float:
    """The inverse error function by bisection."""
    low, high = -6.0, 6.0
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if math.erf(middle) < y else (low, middle)
    return low


@pytest.mark.parametrize("n", [1, 8, 60, 300])
@pytest.mark.parametrize("q", [0.01, 0.25, 0.5, 0.95])
@pytest.mark.parametrize("name", DISTRIBUTIONS)
def test_the_interval_of_a_quantile_contains_the_truth(name: str, q: float, n: int) -> None:
    sample, at = DISTRIBUTIONS[name]
    _, low, high = st.quantile(sample(np.random.default_rng(5), (STUDIES, n)), q, 0.95)
    assert ((low <= at(q)) & (at(q) <= high)).mean() >= 0.94


@pytest.mark.parametrize("n", [12, 100])
def test_the_interval_of_a_median_ratio_contains_the_truth(n: int) -> None:
    random = np.random.default_rng(6)
    sea = np.exp(random.normal(size=(STUDIES, n)))  # met by both laws
    a, b = (sea * factor * np.exp(0.2 * random.normal(size=(STUDIES, n))) for factor in (0.9, 1.0))
    a[random.random(a.shape) < 0.02] = inf  # fails in the worst case for it: shifts the median
    share_of_others = 0.5 / 0.98
    truth = 0.9 * math.exp(0.2 * math.sqrt(2) * math.sqrt(2) * erfinv(2 * share_of_others - 1))
    _, low, high = st.quantile(st.ratios(a, b), 0.5, 0.95)
    assert ((low <= truth) & (truth <= high)).mean() >= 0.94


def test_the_interval_of_a_win_rate_contains_the_truth() -> None:
    random = np.random.default_rng(7)
    a, b = random.random((2, STUDIES, 80))
    # a < b by more than 0.2 b: a < 0.8 b, with probability 0.4 for uniform numbers
    wins = st.below(a, b, 0.2).sum(axis=-1)
    _, low, high = st.share(wins, 80, 0.95)
    assert ((low <= 0.4) & (high >= 0.4)).mean() >= 0.94


# draws needed ------------------------------------------------------------------------------------


def test_draws_needed_are_the_first_that_decide() -> None:
    assert st.draws_for_share(0.0, 0.01, 0.95) == 368  # 0.99**n <= 0.025
    assert st.draws_for_share(1.0, 0.99, 0.95) == 368
    assert st.draws_for_share(0.01, 0.01, 0.95) is None
    count = st.draws_for_share(0.97, 0.95, 0.95)
    assert count
    whole = 100 * round(count / 100)
    assert st.share(0.97 * whole * 1.1, whole * 1.1, 0.95).low > 0.95
    assert st.share(0.97 * whole * 0.9, whole * 0.9, 0.95).low < 0.95


def test_draws_needed_grow_towards_the_bound_and_with_the_level() -> None:
    closer = [st.draws_for_share(share, 0.5, 0.95) for share in (0.9, 0.7, 0.6, 0.55, 0.51)]
    surer = [st.draws_for_share(0.6, 0.5, level) for level in (0.8, 0.95, 0.99)]
    for counts in (closer, surer):
        assert all(a and b and a < b for a, b in pairwise(counts))
    assert st.draws_for_share(0.5 + 1e-9, 0.5, 0.95) is None


# Holm --------------------------------------------------------------------------------------------


def levels_of(p: list[float], level: float = 0.95) -> tuple[list[bool], list[float]]:
    levels = st.holm(lambda i, at: p[i] <= 1 - at, len(p), level)
    return [value <= 1 - at for value, at in zip(p, levels, strict=True)], levels


def test_holm_by_hand() -> None:
    # Holm (1979): 0.01 <= 0.05/4; then 0.015 <= 0.05/3; then 0.03 > 0.05/2 ends it
    decided, levels = levels_of([0.03, 0.01, 0.04, 0.015])
    assert decided == [False, True, False, True]
    assert levels == pytest.approx([1 - 0.05 / 2, 1 - 0.05 / 4, 1 - 0.05 / 2, 1 - 0.05 / 3])
    assert levels_of([0.04]) == ([True], [0.95])
    assert levels_of([]) == ([], [])


def test_holm_decides_what_the_textbook_procedure_decides() -> None:
    random = np.random.default_rng(10)
    for _ in range(300):
        p = (random.random(random.integers(1, 7)) * random.choice([0.05, 0.2, 1.0])).tolist()
        order, textbook = sorted(range(len(p)), key=p.__getitem__), [False] * len(p)
        for step, i in enumerate(order):
            if p[i] > 0.05 / (len(p) - step):
                break
            textbook[i] = True
        assert levels_of(p)[0] == textbook


@pytest.mark.parametrize("true_effects", one_in(3, [1, 0, 2]))
def test_the_probability_that_any_null_is_decided_keeps_to_the_level(true_effects: int) -> None:
    random, studies = np.random.default_rng(11), 10 * STUDIES
    p = np.where(np.arange(4) < true_effects, 0.8, 0.5)
    yes = random.binomial(200, p, (studies, 4))
    decided = {
        left: (low > 0.5) | (high < 0.5)
        for left in range(1, 5)
        for _, low, high in [st.share(yes, 200, 1 - 0.05 / left)]
    }
    wrong = 0
    for k in range(studies):
        levels = st.holm(lambda i, at, k=k: decided[round(0.05 / (1 - at))][k, i], 4, 0.95)
        wrong += any(decided[round(0.05 / (1 - levels[i]))][k, i] for i in range(true_effects, 4))
    assert 0.02 < wrong / studies <= 0.05
    assert decided[1][:, true_effects:].any(axis=-1).mean() > 0.05  # without the correction


def test_an_interval_without_width_is_said_once() -> None:
    inf, nan = math.inf, math.nan
    assert f"{st.Interval(0.12, 0.1, 0.14)}" == "0.12 [0.1, 0.14]"
    assert f"{st.Interval(inf, inf, inf):.3f}" == "failed"
    assert st.Interval(inf, inf, inf).text(infinite="never") == "never"
    assert f"{st.Interval(12.0, 10.0, inf):.4g}" == "12 [10, failed]"
    assert f"{st.Interval(0.0, 0.0, 0.0):.3f}" == "0, no spread"
    assert f"{st.Interval(1.00001, 1.0, 1.00002):.3f}" == "1.000, no spread"
    assert f"{st.Interval(0.125, 0.05, 0.25):.3g%}" == "12.5 % [5, 25]"
    assert f"{st.Interval(2.0, nan, nan):.3f}" == "2.000"
    assert st.Interval(inf, inf, inf).ends("") == "failed"
    assert st.Interval(2.0, 1.0, inf).ends(".3g") == "1 to failed"
