"""Sentences about a finished search: who is best, and what a reader has to beware of."""

import math
from types import SimpleNamespace

import pandas as pd
import pytest

from podusv_cli.metrics.table import METRICS
from podusv_cli.studies.tuning import remarks
from podusv_cli.studies.tuning.trials import CUT, FINISHED


def pairs(ratio, low, high):
    row = {"when": "after", "metric": "iae", "a": "pid", "b": "li", "ratio": ratio}
    return pd.DataFrame([row | {"ratio_low": low, "ratio_high": high}])


@pytest.mark.parametrize(
    ("ratio", "ends", "says"),
    [
        (0.9, (0.8, 0.95), "is 0.900 [0.800, 0.950]: pid is better"),
        (1.1, (1.05, 1.2), "li is better"),
        (1.0, (0.9, 1.1), "neither is better"),
    ],
)
def test_the_answer_tells_the_least_objective_and_who_wins_in_the_same_draw(ratio, ends, says):
    results = SimpleNamespace(
        laws=pd.DataFrame(
            {
                "law": ["li", "pid", "dsc", "lost"],
                "repeats_median": [3.0, 2.0, 9.0, 1.0],
                "rank_after": [2, 1, 3, None],
            }
        ),
        searches=pairs(ratio, *ends),
        shown=["iae"],
        plan=SimpleNamespace(tune=SimpleNamespace(objective="median(iae)"), metrics=METRICS),
    )
    (unranked,) = remarks._remark_unsettled(results)
    assert unranked.endswith(": lost")
    (text,) = remarks._answer(results)
    assert text.startswith("pid has the least median(iae) in the median of its searches")
    assert text.endswith(says)


def test_a_repeat_that_is_better_on_fresh_draws_than_the_one_taken_is_told():
    results = SimpleNamespace(winners={"pid": [1, 2], "li": [1, 2]})
    results.spread = {"pid": [2.0, 3.0], "li": [2.0, 2.01]}.get
    results.winner = {"pid": 2, "li": 2}.get
    (text,) = remarks._remark_overfitted(results)
    assert text.startswith("pid: the search that gained most on its training draws has 3 on the fr")


def test_a_search_with_fewer_than_ten_whole_trials_for_each_gain_is_told():
    trials = [SimpleNamespace(status=status) for status in (*[FINISHED] * 20, *[CUT] * 20)]
    results = SimpleNamespace(
        winners={"pid": [], "li": []},
        trials={"pid": [trials], "li": [trials]},
        plan=SimpleNamespace(gains={"pid": (1, 2, 3), "li": (1, 2)}),
    )
    (text,) = remarks._few(results)
    assert ": pid 20 for 3 gains; give a larger tune.budget" in text


def test_an_inequality_that_holds_in_training_only_is_told():
    row = {"when": "after", "inequality": "quantile(tv_tau_u, 0.95) <= 20", "value": 23.25}
    results = SimpleNamespace(
        limits=pd.DataFrame(
            [
                row | {"law": "pid", "holds": False, "held_in_training": True},
                row | {"law": "li", "holds": False, "held_in_training": False},
                row | {"law": "dsc", "holds": True, "held_in_training": True},
            ]
        )
    )
    (text,) = remarks._beyond(results)
    assert text.startswith("pid: quantile(tv_tau_u, 0.95) <= 20 held on the training draws; on the")
    assert text.endswith("it is 23.25")


def test_one_search_a_law_is_told_to_be_chance():
    tune = SimpleNamespace(searches=5, training_sets=5)
    plan = SimpleNamespace(tune=tune, laws={"pid": 0, "li": 0})
    assert "no order of laws follows" in next(remarks._once(SimpleNamespace(plan=plan)))
    tune.searches, tune.training_sets = 20, 4
    assert "give tune.training_sets 5" in next(remarks._once(SimpleNamespace(plan=plan)))
    tune.training_sets = 5
    assert list(remarks._once(SimpleNamespace(plan=plan))) == []


def test_the_power_of_a_table_is_said_where_every_pair_has_an_interval():
    results = SimpleNamespace(compared=SimpleNamespace(omnibus=0.3, power=lambda better: better))
    (text,) = remarks._power(results)
    assert "had a probability of 0.3; a law that is 20% better" in text
    assert text.endswith("in 80% of all such tables")
    results.pairs_of_laws.omnibus = math.nan
    assert list(remarks._power(results)) == []


def test_a_gain_at_the_end_of_its_range_keeps_the_table_from_being_final():
    row = {"law": "pid", "gain": "K_Pu", "low": 1.0, "high": 40.0}
    results = SimpleNamespace(gains=pd.DataFrame([row | {"at": ""}, row | {"at": "upper"}]))
    (text,) = remarks._bounds(results)
    assert text.startswith("the table is not final")
    assert text.endswith("pid: K_Pu at the upper end, 40")
