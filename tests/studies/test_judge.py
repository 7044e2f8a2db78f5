"""examples/reproduce/judge.py judges the gains of searches on the draws of another scenario."""

import importlib.util
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from podusv_cli.components.controllers.pid import Pid
from podusv_cli.studies.tuning.objective import Outcomes

ROOT = Path(__file__).parents[2]
SMALL = """
extends: {base}
vessel: {{preset: cybership2}}
simulation: {{duration: 10.0}}
sweep: {{seed: 5, laws: [pid, full_backstepping], success: finished}}
tune: {{validate: 3, subject_to: [failures <= 0.0]}}
"""


@pytest.fixture(scope="module")
def judge():
    place = ROOT / "examples/reproduce/judge.py"
    spec = importlib.util.spec_from_file_location("judge", place)
    found = importlib.util.module_from_spec(spec)
    sys.modules["judge"] = found  # where its dataclass looks for its own module
    spec.loader.exec_module(found)
    yield found
    del sys.modules["judge"]


def gains(*rows):
    return pd.DataFrame(rows, columns=["law", "gain", "before", "repeats"])


def test_a_gain_of_the_scenario_becomes_what_each_search_found(judge):
    law = Pid(K_Pu=40.0, K_Du=5.0)
    found = gains(("pid", "K_Pu", 40.0, "12.34 40.0"), ("pid", "K_Du", 5.0, "0.5 7.0"))
    assert judge.sets_of_gains(found, law) == [
        {},
        {"K_Pu": 12.34, "K_Du": 0.5},
        {"K_Pu": 40.0, "K_Du": 7.0},
    ]


def test_another_gain_of_the_scenario_is_changed_by_the_same_factor(judge):
    found = gains(("pid", "K_Pu", 40.0, "20.0 80.0"))
    sets = judge.sets_of_gains(found, Pid(K_Pu=400.0))
    assert sets == [{}, {"K_Pu": 200.0}, {"K_Pu": 800.0}]


def test_a_law_without_gains_is_judged_as_it_is(judge):
    assert judge.sets_of_gains(gains(), Pid()) == [{}, {}]


def test_gains_that_equal_those_before_change_nothing(judge, tmp_path):
    config = tmp_path / "small.yaml"
    config.write_text(SMALL.format(base=ROOT / "configs/studies/tune_small.yaml"))
    own = str(Pid().K_Pu)
    tables = judge.judged(config, gains(("pid", "K_Pu", own, f"{own} {own}")))
    laws = tables["laws"].set_index("law")
    assert (laws.ratio == 1.0).all()
    assert (laws.before == laws.after).all()
    assert laws.searches.to_dict() == {"pid": 2, "full_backstepping": 1}
    assert set(laws.draws) == {3}
    assert laws.held_after.to_dict() == {"pid": 2, "full_backstepping": 1}
    assert list(tables["searches"].columns[:2]) == ["a", "b"]


def told(judge, runs):
    """The table of laws for runs by law, each a list of the IAE before and after each search."""
    random = np.random.default_rng(1)
    spread = random.uniform(0.9, 1.1, 40)  # draws that all laws share
    outcomes = {
        law: [
            Outcomes({"iae": size * spread * random.uniform(0.97, 1.03, 40)}, np.zeros(40, bool))
            for size in sizes
        ]
        for law, sizes in runs.items()
    }
    sweep = SimpleNamespace(level=0.95, seed=3)
    plan = SimpleNamespace(
        tune=SimpleNamespace(training_sets=1),
        base=SimpleNamespace(sweep=sweep),
        metrics={},
        inequalities=(),
    )
    verdict = judge.Verdict(plan, outcomes)
    pairs = verdict.pairs()
    return verdict.laws(pairs).set_index("law").assign(first_pair=[*pairs.ratio, np.nan][0])


RUNS = {"better": [100.0, 48.0, 50.0, 52.0], "worse": [60.0, 118.0, 120.0, 122.0]}


def test_the_ratio_is_after_over_before_and_searches_do_not_count_what_was_before(judge):
    laws = told(judge, RUNS)
    assert laws.ratio.to_dict() == pytest.approx({"better": 0.5, "worse": 2.0}, rel=0.05)
    assert laws.loc["better", "ratio_high"] < 1.0 < laws.loc["worse", "ratio_low"]
    assert laws.loc["better", "after_high"] < 60.0
    assert laws.searches.tolist() == [3, 3]
    few = told(judge, {"one": [400.0, 40.0, 60.0], "other": [100.0, 99.0, 101.0]})
    assert few.first_pair.iloc[0] == pytest.approx(0.5, rel=0.05)
    assert laws[["place_low", "place_high"]].values.tolist() == [[1, 1], [2, 2]]


def test_laws_that_are_told_apart_by_nothing_share_their_places(judge):
    laws = told(judge, {"one": [100.0, 80.0, 120.0], "other": [100.0, 90.0, 112.0]})
    assert laws[["place_low", "place_high"]].values.tolist() == [[1, 2], [1, 2]]


def test_the_intervals_of_more_laws_hold_together_and_are_wider(judge):
    alone = told(judge, {"better": RUNS["better"]}).loc["better"]
    among = told(
        judge, {"better": RUNS["better"], **{f"law {i}": RUNS["worse"] for i in range(19)}}
    )
    widths = [row.ratio_high / row.ratio_low for row in (alone, among.loc["better"])]
    assert widths[1] > 1.1**0.1 * widths[0]


def test_gains_are_judged_on_the_draws_that_no_search_saw(judge, tmp_path, monkeypatch):
    config, streams = tmp_path / "small.yaml", []
    config.write_text(SMALL.format(base=ROOT / "configs/studies/tune_small.yaml"))
    variant = judge.TunePlan.variant

    def seen(self, laws, stream, draws):
        streams.append(stream)
        return variant(self, laws, stream, draws)

    monkeypatch.setattr(judge.TunePlan, "variant", seen)
    judge.judged(config, gains())
    assert streams == ["tune validation"]
