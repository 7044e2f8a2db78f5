"""Laws over all of their searches: ratios, their intervals, and the places they leave open."""

import numpy as np
import pytest

from podusv_cli.studies.tuning import searches

RANDOM = np.random.default_rng(3)
BASE = 300.0 * np.exp(RANDOM.normal(0.0, 0.3, 80))  # of each draw


def row(frame, a, b):
    (found,) = frame[(frame.a == a) & (frame.b == b)].to_dict("records")
    return found


def test_searches_that_all_end_alike_leave_the_ratio_of_the_draws():
    runs = {"a": np.tile(0.9 * BASE, (4, 1)), "b": np.tile(BASE, (6, 1))}
    found = row(searches.ratios(runs, 0.95, 1), "a", "b")
    assert [found[end] for end in ("ratio", "ratio_low", "ratio_high")] == pytest.approx([0.9] * 3)


def test_a_law_counts_by_the_median_of_its_searches_and_its_spread_is_in_the_interval():
    factors = np.array([0.7, 0.8, 0.9, 1.3, 1.4])[:, None]
    found = row(searches.ratios({"a": factors * BASE, "b": BASE[None]}, 0.95, 1), "a", "b")
    assert found["ratio"] == pytest.approx(0.9)
    assert found["ratio_low"] == pytest.approx(0.7, abs=0.11)
    assert found["ratio_high"] == pytest.approx(1.4, abs=0.11)


def test_places_are_the_ranks_that_the_intervals_leave_open():
    spread = np.exp(np.linspace(-0.1, 0.1, 6))[:, None]
    runs = {"best": 0.5 * BASE[None], "one": spread * BASE, "other": spread[::-1] * 1.01 * BASE,
            "last": 3.0 * BASE[None]}  # fmt: skip
    found = searches.places(searches.ratios(runs, 0.95, 1), list(runs))
    assert found == {"best": (1, 1), "one": (2, 3), "other": (2, 3), "last": (4, 4)}


def test_failed_runs_are_the_worst_and_those_of_both_say_nothing():
    broken = BASE.copy()
    broken[:38] = np.inf
    found = searches.ratios({"a": broken[None], "b": BASE[None], "c": broken[None]}, 0.95, 1)
    assert row(found, "a", "b")["ratio"] == pytest.approx(1.0)
    assert row(found, "a", "b")["ratio_high"] == np.inf
    assert row(found, "a", "c")["ratio_high"] == pytest.approx(1.0)


@pytest.mark.slow
def test_intervals_of_six_searches_hold_the_truth_about_as_often_as_they_say(monkeypatch):
    """Searches that scatter by 10 %, draws by 5 % about them: 0.965 of 200 in a probe of 95 %."""
    monkeypatch.setattr(searches, "SAMPLES", 400)
    random, hits = np.random.default_rng(1), 0
    for trial in range(100):
        runs = {
            law: BASE * np.exp(random.normal(0, 0.1, (6, 1)) + random.normal(0, 0.05, (6, 80)))
            for law in "ab"
        }
        found = row(searches.ratios(runs, 0.95, trial), "a", "b")
        hits += found["ratio_low"] <= 1.0 <= found["ratio_high"]
    assert 88 <= hits <= 100
