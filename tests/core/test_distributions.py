"""Distributions: known values, the right frequencies, bounds that hold, and mistakes told."""

from __future__ import annotations

import math
from collections import Counter
from statistics import NormalDist
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from scipy import special, stats

from podusv_cli.core.portable import exponential, logarithm, standard_normal
from podusv_cli.scenario.distributions import Bounded, Distribution, LogNormal, Normal
from podusv_cli.studies.making.draws import uniforms

SHARES = np.array([2.0**-53, 1e-9, 0.01, 0.075, 0.25, 0.5, 0.75, 0.925, 0.99, 1 - 2.0**-52])
U = uniforms(1, "u", 0, 20_000)


def test_normal_quantiles_are_those_of_independent_code() -> None:
    u = np.append(U, SHARES)
    z = standard_normal(u)
    off_centre = np.abs(u - 0.5) > 1e-3
    np.testing.assert_allclose(z[off_centre], special.ndtri(u)[off_centre], rtol=3e-15)
    np.testing.assert_allclose(z, special.ndtri(u), atol=1e-15, rtol=3e-15)
    np.testing.assert_allclose(z[:500], [NormalDist().inv_cdf(x) for x in u[:500]], rtol=1e-14)
    assert standard_normal(np.array([0.5]))[0] == 0.0
    np.testing.assert_array_equal(standard_normal(1 - U), -z[: len(U)])


def test_logarithm_and_exponential_are_the_librarys_to_the_last_places() -> None:
    u = np.concatenate([U, [1e-300, 0.5, math.sqrt(0.5), 1 - 2.0**-53]])
    np.testing.assert_allclose(logarithm(u), np.log(u), rtol=1e-15)
    x = np.concatenate([(U - 0.5) * 80, [0.0, -1e-300, 1.0]])
    np.testing.assert_allclose(exponential(x), np.exp(x), rtol=1e-15)


@pytest.mark.parametrize(
    ("made", "u", "known"),
    [
        ({"uniform": (0.7, 1.3)}, [0.0, 0.25, 0.5, 1.0], [0.7, 0.85, 1.0, 1.3]),
        ({"log_uniform": (0.25, 4.0)}, [0.0, 0.25, 0.5, 1.0], [0.25, 0.5, 1.0, 4.0]),
        ({"triangular": (0.0, 1.0, 3.0)}, [1 / 12, 1 / 3, 5 / 6], [0.5, 1.0, 2.0]),
        ({"triangular": (0.0, 0.0, 1.0)}, [0.0, 0.75], [0.0, 0.5]),
        ({"triangular": (0.0, 1.0, 1.0)}, [0.25, 1.0], [0.5, 1.0]),
        ({"normal": Normal(mean=2.0, sigma=3.0)}, [0.5, 0.975], [2.0, 2 + 3 * 1.959963984540054]),
        (
            {"lognormal": LogNormal(median=2.0, sigma=0.5)},
            [0.5, 0.025],
            [2.0, 2 * math.exp(-0.5 * 1.959963984540054)],
        ),
        ({"angle": "all"}, [0.0, 0.25, 0.5, 1 - 2.0**-52], [math.pi, math.pi / 2, 0.0, -math.pi]),
    ],
)
def test_values_worked_out_by_hand(made: Any, u: list[float], known: list[float]) -> None:
    np.testing.assert_allclose(Distribution(**made).at(np.array(u)), known, atol=1e-14)


# The distribution functions of scipy, which are not made from these inverses.
FREQUENCIES: list[tuple[dict[str, Any], Any]] = [
    ({"uniform": (-2.0, 5.0)}, stats.uniform(-2, 7)),
    ({"log_uniform": (0.2, 3.0)}, stats.loguniform(0.2, 3.0)),
    ({"triangular": (-1.0, 0.5, 4.0)}, stats.triang(0.3, -1, 5)),
    ({"normal": Normal(mean=-1.0, sigma=0.2)}, stats.norm(-1, 0.2)),
    ({"normal": Normal(sigma=3.0, within=(-1.0, 6.0))}, stats.truncnorm(-1 / 3, 2, 0, 3)),
    ({"lognormal": LogNormal(median=3.0, sigma=0.7)}, stats.lognorm(0.7, scale=3)),
    ({"angle": "all"}, stats.uniform(-math.pi, 2 * math.pi)),
]


@pytest.mark.parametrize(("made", "other"), FREQUENCIES)
def test_frequencies_pass_the_kolmogorov_smirnov_test(made: Any, other: Any) -> None:
    for name in ("one", "two"):  # of fixed seeds: this does not come and go
        drawn = Distribution(**made).at(uniforms(3, name, 0, 20_000))
        assert stats.kstest(drawn, other.cdf).pvalue > 0.01


def test_a_truncated_lognormal_has_the_frequencies_between_its_bounds() -> None:
    whole, low, high = stats.lognorm(0.15), 0.6, 1.6
    below, share = whole.cdf(low), whole.cdf(high) - whole.cdf(low)
    drawn = LogNormal(sigma=0.15, within=(low, high)).at(U)
    assert stats.kstest(drawn, lambda x: (whole.cdf(x) - below) / share).pvalue > 0.01


@pytest.mark.parametrize(
    "cut",
    [
        Normal(sigma=3.0, within=(-9.0, 9.0)),
        Normal(sigma=1.0, within=(4.0, 4.5)),
        Normal(mean=5.0, sigma=1.0, within=(0.7, 1.9)),
        LogNormal(sigma=0.15, within=(0.6, 1.6)),
        LogNormal(median=10.0, sigma=2.0, within=(1e-3, 11.0)),
    ],
)
def test_truncation_is_exact(cut: Bounded) -> None:
    """No value is beyond a bound, and the shares are those of the distribution function."""
    assert cut.within is not None
    low, high = cut.within
    ends = cut.at(np.array([2.0**-53, 1 - 2.0**-53]))
    np.testing.assert_allclose(ends, [low, high], rtol=1e-9)
    assert ends[0] >= low
    assert ends[1] <= high
    if isinstance(cut, Normal):
        expected = stats.norm(cut.mean, cut.sigma).cdf([low, high])
    else:
        assert isinstance(cut, LogNormal)
        expected = stats.lognorm(cut.sigma, scale=cut.median).cdf([low, high])
    np.testing.assert_allclose(cut.shares, expected, rtol=1e-12, atol=1e-16)
    middle = cut.at(np.array([0.5]))[0]
    back = cut.whole(np.array([sum(cut.shares) / 2]))[0]
    assert middle == pytest.approx(back, rel=1e-12)


@pytest.mark.parametrize(
    "bounds", [(-7.0, 0.3), (-8.2, -4.0), (-1e-3, 7.9), (0.0, 6.0), (-0.123456789, 1 / 3)]
)
@pytest.mark.parametrize("sigma", [1.0, 0.15, 3.7e-3])
def test_shares_are_those_of_one_bisection_after_another(
    bounds: tuple[float, float], sigma: float
) -> None:
    """Drawn numbers depend on the last bit of a share, so many looks at once change none."""
    for whole in (Normal(mean=0.3, sigma=sigma), LogNormal(median=2.5, sigma=sigma)):
        within = tuple(sigma * z + 0.3 for z in bounds)
        if isinstance(whole, LogNormal):
            within = tuple(2.5 * math.exp(sigma * z) for z in bounds)
        expected = [bisected_share(whole, x) for x in within]
        assert list(whole.changed({"within": within}).shares) == expected


def bisected_share(whole: Bounded, x: float) -> float:
    low, high = 0.0, 1.0
    while low < (middle := 0.5 * (low + high)) < high and high - low > 2.0**-60:
        if whole.whole(np.array([middle]))[0] <= x:
            low = middle
        else:
            high = middle
    return high if high == 1.0 else low


def test_choices_and_whole_numbers_are_equally_likely_and_keep_their_types() -> None:
    words = Distribution(choice=("a", 2, 2.5, True)).at(U)
    counts = Counter(map(repr, words.tolist()))
    assert set(counts) == {"'a'", "2", "2.5", "True"}
    assert stats.chisquare(list(counts.values())).pvalue > 0.01
    dice = Distribution(integers=(-1, 4)).at(U)
    assert dice.dtype == np.int64
    numbers, times = np.unique(dice, return_counts=True)
    assert numbers.tolist() == [-1, 0, 1, 2, 3, 4]
    assert stats.chisquare(times).pvalue > 0.01
    ends = np.array([2.0**-53, 1 - 2.0**-53])
    assert Distribution(integers=(-1, 4)).at(ends).tolist() == [-1, 4]


@pytest.mark.parametrize(
    ("made", "words"),
    [
        ({}, r"must have one of uniform, normal, .*, angle; found none"),
        ({"uniform": (0.0, 1.0), "angle": "all"}, "found uniform and angle"),
        ({"uniform": (1.3, 0.7)}, "uniform: 1.3 is not below 0.7"),
        ({"uniform": (1.0, 1.0)}, "uniform: 1 is not below 1"),
        ({"uniform": (-1.7e308, 1.7e308)}, "too far apart"),
        ({"log_uniform": (0.0, 1.0)}, "log_uniform: 0 is not above 0"),
        ({"log_uniform": (2.0, 1.0)}, "log_uniform: 2 is not below 1"),
        ({"triangular": (0.0, 5.0, 1.0)}, r"triangular: write \[low, mode, high\]; 5 is not"),
        ({"triangular": (1.0, 1.0, 1.0)}, "triangular: 1 is not below 1"),
        ({"choice": ()}, "choice: is empty"),
        ({"integers": (3, 3)}, "integers: 3 is not below 3"),
        ({"integers": (1, 10**20)}, "integers: whole numbers must lie between -2"),
        ({"integers": (-(10**400), 3)}, "integers: whole numbers must lie between -2"),
        ({"choice": (1, 10**400)}, "choice: whole numbers must lie between -2"),
        ({"normal": {"sigma": 0.0}}, "greater than 0"),
        ({"normal": {"sigma": 1.0, "within": (9.0, -9.0)}}, "within: 9 is not below -9"),
        ({"normal": {"sigma": 1.0, "within": (8.0, 9.0)}}, r"within: .* excludes all but a share"),
        ({"lognormal": {"sigma": 0.1, "within": (-2.0, -1.0)}}, "excludes all but a share of 0"),
    ],
)
def test_what_is_no_distribution_is_told(made: Any, words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        Distribution.model_validate(made)


def test_what_distributions_share_is_none():
    with pytest.raises(TypeError, match="whole"):
        Bounded()
