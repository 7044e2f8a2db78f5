"""Drawn quantities in words."""

import pytest

from podusv_cli.scenario.distributions import WAYS
from podusv_cli.scenario.sweep import Quantity
from podusv_cli.scenario.words import WORDS, in_words


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (
            {"plus": {"normal": {"sigma": 2.0, "within": (-3.0, 3.0)}}},
            "the scenario's own value plus a summand: normal with mean 0 and standard deviation 2, "
            "only from -3 to 3",
        ),
        (
            {"times": {"lognormal": {"sigma": 0.1}}},
            "the scenario's own value times a factor: lognormal with median 1, "
            "standard deviation of the logarithm 0.1",
        ),
        ({"log_uniform": (0.5, 2.0)}, "log-uniform from 0.5 to 2"),
        ({"triangular": (0.0, 1.0, 3.0)}, "triangular from 0 to 3, likeliest at 1"),
        ({"choice": ("line", 2)}, "one of line, 2, all equally likely"),
        ({"integers": (1, 6)}, "a whole number from 1 to 6, all equally likely"),
        ({"angle": "all"}, "any direction, all equally likely"),
        (
            {"identified": "found", "rows": "m,I_z\n1,2\n3,4\n5,6"},
            "one of the 3 rows of found/posterior.csv, hulls, all equally likely",
        ),
        ({"seed": True}, "a new seed for every draw"),
    ],
)
def test_quantities_in_words(given, words):
    assert in_words(Quantity(**given)) == words


def test_every_distribution_has_words():
    assert WORDS.keys() == WAYS.keys()
