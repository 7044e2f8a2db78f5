"""Laws over all of their searches: ratios, their intervals, and the places they leave open."""

import numpy as np
import pytest

from podusv_cli.studies.tuning import searches

RANDOM = np.random.default_rng(3)
BASE = 300.0 * np.exp(RANDOM.normal(0.0, 0.3, 80))  # of each draw


def row(frame, a, b):
    (pair,) = frame[(frame.a == a) & (frame.b == b)].to_dict("records")
    return pair


def test_searches_that_all_end_alike_leave_the_ratio_of_the_draws():
    runs = {"a": np.tile(0.9 * BASE, (4, 1)), "b": np.tile(BASE, (6, 1))}
    pair = row(searches.ratios(runs, 0.95, 1), "a", "b")
    assert [pair[end] for end in ("ratio", "ratio_low", "ratio_high")] == pytest.approx([0.9] * 3)


def test_a_law_counts_by_the_median_of_its_searches_and_its_spread_is_in_the_interval():
    factors = np.array([0.7, 0.8, 0.9, 1.3, 1.4])[:, None]
    pair = row(searches.ratios({"a": factors * BASE, "b": BASE[None]}, 0.95, 1), "a", "b")
    assert pair["ratio"] == pytest.approx(0.9)
    assert pair["ratio_low"] < 0.75
    assert pair["ratio_high"] > 1.1


def test_searches_that_fail_in_draws_of_their_own_do_not_make_a_law_that_never_fails():
    """Each search fails in its own three fifths of the draws."""
    broken = np.tile(0.9 * BASE, (5, 1))
    for search, reached in enumerate(broken):
        reached[[(search + i) % 5 for i in range(3)]] = np.inf
        reached.reshape(-1, 5)[:, [(search + i) % 5 for i in range(3)]] = np.inf
    pair = row(searches.ratios({"a": broken, "b": BASE[None]}, 0.95, 1), "a", "b")
    assert pair["ratio"] == np.inf


def test_places_are_the_ranks_that_the_intervals_leave_open():
    spread = np.exp(np.linspace(-0.1, 0.1, 6))[:, None]
    runs = {
        "best": 0.5 * BASE[None],
        "one": spread * BASE,
        "other": spread[::-1] * 1.01 * BASE,
        "last": 3.0 * BASE[None],
    }
    places = searches.places(searches.ratios(runs, 0.95, 1), list(runs))
    assert places == {"best": (1, 1), "one": (2, 3), "other": (2, 3), "last": (4, 4)}


def test_a_law_that_fails_in_every_other_draw_has_no_interval_and_one_that_always_fails_is_worse():
    half = BASE.copy()
    half[::2] = np.inf
    lost = np.full((1, len(BASE)), np.inf)
    table = searches.ratios({"half": half[None], "whole": BASE[None], "lost": lost}, 0.95, 1)
    assert [row(table, "half", "whole")[end] for end in ("ratio_low", "ratio_high")] == [0, np.inf]
    assert row(table, "whole", "lost")["ratio_high"] == 0.0
    assert searches.places(table, ["half", "whole", "lost"])["lost"] == (2, 3)


def scattered(random, laws, sets, repeats, *, of_set, of_search, best=1.0):
    """One number a search, which a law's own effect of the training set is in."""
    which = np.arange(sets * repeats) % sets
    return {
        f"law {i}": (best if i == 0 else 1.0)
        * np.exp(random.normal(0, of_set, sets)[which] + random.normal(0, of_search, len(which)))[
            :, None
        ]
        for i in range(laws)
    }


def test_what_all_laws_share_of_a_training_set_is_in_no_interval():
    shared = np.exp(np.array([0.0, 0.5, -0.4, 0.2, 0.9]))[np.arange(20) % 5][:, None]
    found = searches.ratios({"a": 0.8 * shared, "b": shared}, 0.95, 1, sets=5)
    ends = row(found, "a", "b")
    assert [ends[end] for end in ("ratio_low", "ratio_high")] == pytest.approx([0.8, 0.8])
    asif = row(searches.ratios({"a": 0.8 * shared, "b": shared}, 0.95, 1), "a", "b")
    assert asif["ratio_low"] < 0.6, "searches that are drawn apart for each law"


def test_searches_that_are_not_as_many_for_every_training_set_are_refused():
    with pytest.raises(ValueError, match="a: 6 searches on 5 training sets"):
        searches.compare_laws({"a": np.ones((6, 4)), "b": np.ones((1, 4))}, 0.95, 1, sets=5)


def test_a_training_set_on_which_one_law_is_lucky_widens_its_interval():
    lucky = np.array([0.6, 1.0, 1.0, 1.0, 1.4])[np.arange(20) % 5][:, None]
    runs = {"a": lucky, "b": np.ones((20, 1))}
    clustered, alone = (searches.compare_laws(runs, 0.95, 1, sets=sets) for sets in (5, 1))
    assert clustered.samples.std() > 1.5 * alone.samples.std()


def test_the_omnibus_probability_and_the_power_follow_the_size_of_a_difference():
    random = np.random.default_rng(7)
    equal = searches.compare_laws(
        scattered(random, 6, 5, 4, of_set=0.03, of_search=0.03), 0.95, 1, sets=5
    )
    apart = {**scattered(random, 6, 5, 4, of_set=0.03, of_search=0.03, best=0.5)}
    assert equal.omnibus > 0.05
    assert searches.compare_laws(apart, 0.95, 1, sets=5).omnibus < 0.01
    assert equal.power(0.999) < 0.05 < equal.power(0.85) < equal.power(0.7)
    assert equal.power(0.5) == 1.0
    assert np.isnan(
        searches.compare_laws({"a": np.ones((1, 3)), "b": np.full((1, 3), np.inf)}, 0.95, 1).omnibus
    )


@pytest.mark.slow
def test_the_power_is_how_often_a_better_law_has_the_first_place_in_tables_made_anew(monkeypatch):
    monkeypatch.setattr(searches, "SAMPLES", 400)
    random, first, said = np.random.default_rng(11), 0, []
    for trial in range(100):
        runs = scattered(random, 8, 5, 4, of_set=0.04, of_search=0.04, best=0.8)
        found = searches.compare_laws(runs, 0.95, trial, sets=5)
        first += searches.places(found.table(), list(runs))["law 0"] == (1, 1)
        said.append(found.power(0.8))
    assert first / 100 == pytest.approx(np.mean(said), abs=0.15)


@pytest.mark.slow
def test_of_equal_laws_hardly_any_table_tells_one_apart_and_a_better_one_is_told(monkeypatch):
    """Ten laws with six searches that scatter by 5 %; one that is 30 % better than nine others."""
    monkeypatch.setattr(searches, "SAMPLES", 400)
    random, wrong, told = np.random.default_rng(1), 0, 0
    for trial in range(40):
        for best in (1.0, 0.7):
            runs = {
                f"law {i}": (best if i == 0 else 1.0)
                * BASE
                * np.exp(random.normal(0, 0.05, (6, 1)) + random.normal(0, 0.05, (6, 80)))
                for i in range(10)
            }
            places = searches.places(searches.ratios(runs, 0.95, trial), list(runs))
            if best == 1.0:
                wrong += any(place != (1, 10) for place in places.values())
            else:
                told += places["law 0"] == (1, 1)
    assert wrong <= 6, "of 40, in 2 of which a table at 95 % may err"
    assert told >= 34
