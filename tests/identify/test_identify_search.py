"""The search for numbers of a filter, and the errors of what it finds, beside algebra."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq, minimize

from podusv_cli.identify.fit import estimate
from podusv_cli.identify.fit.estimate import (
    HullEstimate,
    HullSearch,
    Scored,
    covariance,
    estimate_hull,
    prior_kept,
)


def test_the_search_finds_mean_and_deviation_of_numbers_as_algebra_does():
    """Values z with mean m and deviation e^s: the estimates with a normal prior are known."""
    z = np.random.default_rng(5).normal(0.7, 0.3, 400)

    def innovations(points):
        nu = np.column_stack([z - y[0] for y in points])
        return nu, np.column_stack([np.full(len(z), math.exp(2.0 * y[1])) for y in points])

    found = estimate_hull(HullSearch(innovations, 2, np.arange(400) // 20))
    m, s = found.y
    variance = math.exp(2.0 * s)
    assert found.settled
    assert m == pytest.approx(z.sum() / (len(z) + variance), abs=0.1 * math.sqrt(variance / 400))
    # Of the deviation: -N + sum (z - m)^2 / e^2s - s = 0.
    exact = brentq(lambda s: -len(z) + np.sum((z - m) ** 2) * math.exp(-2.0 * s) - s, -3.0, 1.0)
    assert s == pytest.approx(exact, abs=0.1 * math.sqrt(0.5 / 400))
    sd = np.sqrt(np.diag(found.covariance))
    assert sd == pytest.approx([math.sqrt(variance / 400), math.sqrt(0.5 / 400)], rel=0.35)
    assert np.all(sd >= [0.99 * math.sqrt(variance / 401), 0.99 * math.sqrt(0.5 / 401)])


def test_an_interrupt_at_any_time_keeps_what_the_first_search_found():
    """At every call of the filter in the second search, the first of which no round protects."""
    z = np.random.default_rng(5).normal(0.7, 0.3, 40)
    made, last = [], [0]

    def innovations(points):
        made.append(len(points))
        if len(made) == last[0]:
            raise KeyboardInterrupt
        return np.column_stack([z - y[0] for y in points]), np.full((40, len(points)), 0.09)

    search = HullSearch(innovations, 1, np.arange(40) // 20)
    whole = estimate_hull(search, starts=1)
    first = len(made)
    made.clear()
    estimate_hull(search)
    calls = len(made)
    assert calls > first + 3
    for call in range(first + 1, calls + 1):
        made.clear()
        last[0] = call
        found = estimate_hull(search)
        assert found.interrupted
        assert found.value <= whole.value


def test_the_errors_of_a_mean_are_those_of_its_blocks():
    """Values that are alike within a block say no more of their mean than one of them."""
    rng = np.random.default_rng(3)
    blocks, each, sd = 40, 25, 3.0
    means = rng.normal(0.0, sd, blocks)
    values, of = np.repeat(means, each), np.repeat(np.arange(blocks), each)

    def innovations(points):
        nu = np.stack([values - 1e3 * y[0] for y in points], axis=1)  # the prior says nothing
        return nu, np.ones_like(nu)

    search = HullSearch(innovations, 1, of, 1)
    found = covariance(search.score(np.array([means.mean() / 1e3])), 1)[0, 0] * 1e6
    assert found == pytest.approx(np.var(means, ddof=1) / blocks, rel=1e-3)
    assert found > 20.0 / (blocks * each)  # what the curvature says of independent values is 1 / n


def test_errors_are_finite_where_one_block_says_nearly_all_there_is():
    """Values without noise make numbers sure to ten digits beside others that nothing shows."""
    rng = np.random.default_rng(1)
    way, other = rng.standard_normal((2, 12))
    by_values = np.array([1e13 * np.outer(way, way), 1e3 * np.outer(other, other)])
    found = covariance(Scored(0.0, np.zeros((2, 12)), by_values, np.zeros((2, 12, 12))), 12)
    values = np.linalg.eigvalsh(found)
    assert values[:2] == pytest.approx(np.zeros(2), abs=0.01)
    assert values[2:] == pytest.approx(np.ones(10), abs=0.02)


def test_a_number_that_bends_more_than_is_expected_does_not_hold_back_the_hull():
    """Over q the value bends by 4 c n m + 2 = 82, and Fisher's matrix says 2 near the least value.

    The hull's numbers a and b lie in a curved valley, b = a^2, along which q goes with them.
    Damped together with q they took 100 rounds, and 27 without what damps q apart; what is least is
    known by another program.
    """
    n, m, c = 400, 0.5, 0.1

    def residuals(y):
        a, b, q = y
        return np.array([*[m + c * (q + 0.3 * a) ** 2] * n, 30.0 * (b - a * a), 10.0 * (1.5 - a)])

    def innovations(points):
        nu = np.column_stack([residuals(y) for y in points])
        return nu, np.ones_like(nu)

    search = HullSearch(innovations, 3, np.zeros(n + 2, int), 2)
    found = estimate_hull(search, starts=1)
    least = minimize(lambda y: np.sum(residuals(y) ** 2) + y @ y, found.y, method="BFGS")
    assert found.rounds < 22
    assert found.value == pytest.approx(least.fun, abs=0.02)


def test_a_hull_is_left_as_it_was_where_the_filter_breaks_down_beside_the_rest():
    """The logs say nothing of y[0]; with y[0] as before, the filter breaks down above y[1] = 1.5.

    Then y[1] is looked for from the prior's centre, up to where the filter is whole.
    """
    z = np.full(40, 2.0)

    def innovations(points):
        a, b = np.array(points).T
        broken = (a < 0.5) & (b > 1.5)
        return z[:, None] - b, np.where(broken, -1.0, 0.01) * np.ones((40, 1))

    search = HullSearch(innovations, 2, np.arange(40) // 20, 1)
    found = HullEstimate(np.array([1.0, 2.0]), 0.0, np.eye(2), rounds=1)
    kept = prior_kept(search, found)
    assert np.isfinite(kept.covariance).all()
    assert kept.y[0] == 0.0
    assert 0.5 < kept.y[1] <= 1.5


def test_searches_that_end_at_one_value_with_two_hulls_have_not_come_to_the_same(monkeypatch):
    """Three places of one value: the third is 1.4 standard deviations from the first."""
    ends = [np.array([0.0, 9.0]), np.array([1.5, 9.0]), np.array([0.7, -9.0])]
    spread = np.diag([0.25, 0.25])

    def search(hull):
        left = [HullEstimate(y, 10.0 + 0.1 * i, spread, 3) for i, y in enumerate(ends)]
        monkeypatch.setattr(estimate, "_search_from", lambda *_: left.pop(0))
        blocks = np.zeros(1, np.int64)
        found = estimate_hull(HullSearch(lambda points: (np.ones(1), np.ones(1)), 2, blocks, hull))
        return found.settled, len(left)

    assert search(1) == (True, 0)
    assert search(0) == (True, 1)  # without a hull the value is enough
