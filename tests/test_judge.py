"""examples/reproduce/judge.py judges the gains of searches on the draws of another scenario."""

import importlib.util
import sys
from pathlib import Path

import pandas as pd
import pytest

from podusv_cli.components.controllers.pid import Pid

ROOT = Path(__file__).parents[1]
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
        {}, {"K_Pu": 12.34, "K_Du": 0.5}, {"K_Pu": 40.0, "K_Du": 7.0},
    ]  # fmt: skip


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
