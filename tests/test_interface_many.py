"""podusv.simulate_many: which parameters it takes, and what it says of those that it does not."""

import re
from typing import Any

import numpy as np
import pandas as pd
import pytest
from test_interface import SHORT

import podusv_cli as podusv
from podusv_cli.engine.running import batch

REFUSED: list[tuple[Any, str]] = [
    ({"vessel.m": [20.0, -3.0]}, "row 1: vessel.m = -3; must be a number above 0 [kg]"),
    ({"start.x": [np.nan]}, "row 0: start.x = nan; must be a number [m]"),
    ({"vessel.m": ["20"]}, "vessel.m = 20; must be a number above 0 [kg]; leave out the quotes"),
    ({"controller.rate": ["exact"]}, "row 0: controller.rate = exact; must be analytic or diff"),
    ({"vessel.mass": [20.0]}, "vessel.mass: unknown key; did you mean 'vessel.m'? (allowed: "),
    ({"vesel.m": [20.0]}, "vesel.m: unknown key; did you mean 'vessel.m'? (allowed: "),
    ({"vessel..m": [20.0]}, "vessel..m: unknown key; did you mean 'vessel.m'?"),
    ({"": [20.0]}, ": unknown key"),
    ({"vessel": [20.0]}, "vessel: is a section; name one of the keys in it"),
    ({"simulation.step": [0.01]}, "simulation.step: simulation is the same in all runs of a batch"),
    ({"controller.kind": ["pid"]}, "controller.kind: is the same in all runs of a batch"),
    ({"vessel.m": 20.0}, "vessel.m: must be a list or array with one value a run, found 20.0"),
    ({"vessel.m": "heavy"}, "must be a list or array with one value a run, found 'heavy'"),
    ({"vessel.m": np.ones((2, 2))}, "one value a run, found an array of shape (2, 2)"),
    ({"vessel.m": [20.0], "start.x": [1.0, 2.0]}, "their lengths are {'vessel.m': 1, 'start.x'"),
    ({}, "no parameters: give a key and its values, as {'vessel.m': [20.0, 25.0]}"),
    (
        {"controller.anti_windup": ["none", "auxiliary"]},
        "row 1: controller.anti_windup = auxiliary changes how the loop is put together, and row 0 "
        "has controller.anti_windup = none; make a batch for each",
    ),
]


@pytest.mark.parametrize(("parameters", "text"), REFUSED)
def test_parameters_that_cannot_be_are_a_sentence(parameters: Any, text: str) -> None:
    with pytest.raises(ValueError, match=re.escape(text)) as told:
        podusv.simulate_many(SHORT, parameters)
    assert "\n" not in str(told.value)


def test_a_negative_number_of_workers_is_a_sentence() -> None:
    with pytest.raises(ValueError, match=r"^workers = -1: must be 0 \(one a core\) or more$"):
        podusv.simulate_many(SHORT, {"vessel.m": [20.0]}, workers=-1)


def test_words_and_whole_numbers_give_what_each_run_gives_alone() -> None:
    scenario = podusv.load(
        SHORT,
        {"disturbance": {"kind": "current", "speed": 0.1, "speed_std": 0.05, "time_constant": 5.0}},
    )
    rows = {
        "controller.reference": ["path", "virtual_controls", "path"],
        "disturbance.seed": np.array([1.0, 2.0, 9.0]),
    }
    many = podusv.simulate_many(scenario, rows)
    assert list(many["controller.reference"]) == rows["controller.reference"]
    for row in range(3):
        own = {"controller.reference": rows["controller.reference"][row]}
        alone = podusv.simulate(scenario, {**own, "disturbance.seed": int(many.iloc[row, 1])})
        assert many.loc[row, "iae"] == alone.metrics["iae"]
    assert many["iae"].nunique() == 3


def test_a_table_may_be_the_parameters() -> None:
    table = pd.DataFrame({"vessel.m": [20, 25], "start.x": [-5.0, -6.0]})
    many = podusv.simulate_many(SHORT, table)
    pd.testing.assert_frame_equal(many[list(table)], table)


def test_whether_runs_march_side_by_side_is_passed_on(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    real = batch.simulate_many

    def noted(*loops: Any, side_by_side: bool | None, **options: Any) -> batch.Batch:
        asked.append(side_by_side)
        return real(*loops, side_by_side=False, **options)

    monkeypatch.setattr(batch, "simulate_many", noted)
    for wanted in (None, True, False):
        podusv.simulate_many(SHORT, {"vessel.m": [20.0]}, side_by_side=wanted)
    podusv.simulate_many(SHORT, {"vessel.m": [20.0]})
    assert asked == [None, True, False, None]
