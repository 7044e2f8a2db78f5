"""The bench of laws that hold a pose: words of its page hold for the committed runs, made anew."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from rotation import one_in

from podusv_cli.studies.bench.cases import AXES, Selection, cases
from podusv_cli.studies.bench.runs import play
from podusv_cli.studies.bench.standing import PLACE, by_vessel, leaderboard, table

ROOT = Path(__file__).parents[2]
BENCH = ROOT / "configs" / "bench_dp"
RUNS = pd.read_csv(ROOT / "results" / "bench" / "dp.csv")
LENGTHS = {"cybership2": 1.255, "milliampere": 5.0}
HULLS = by_vessel(RUNS)


def chosen(overrides=(), **names):
    picked = {axis: (name,) for axis, name in names.items()}
    return list(cases(Selection(BENCH, overrides=list(overrides), chosen=picked)))


def test_the_committed_runs_are_those_of_the_bench():
    for axis in AXES:
        assert set(RUNS[axis.rstrip("s")]) == {path.stem for path in (BENCH / axis).iterdir()}
    for vessel, length in LENGTHS.items():
        (case,) = chosen(vessels=vessel, tasks="hold", conditions="calm")
        assert set(RUNS.law) == set(case.laws)
        (radius,) = {one.metrics.settling_radius for one in case.laws.values()}
        assert radius == pytest.approx(length / 4.0, abs=1e-3)


@pytest.mark.parametrize("vessel", one_in(2, [*LENGTHS]))
def test_a_case_run_now_is_the_committed_one(vessel):
    (case,) = chosen(vessels=vessel, tasks="hold", conditions="moderate")
    fresh = table(play(case)).set_index("law")
    kept = RUNS[(RUNS[PLACE] == list(case.place)).all(axis=1)].set_index("law")
    assert fresh.status.equals(kept.status)
    whole = kept.status == "finished"
    np.testing.assert_allclose(fresh.iae[whole], kept.iae[whole], rtol=5e-6)  # six digits are kept


def test_what_the_page_says_in_words_is_that_of_the_runs():
    iae = HULLS["cybership2"].pivot_table("iae", ["task", "condition"], "law").drop("calm", level=1)
    for fed, own in (("pd_fed", "pid"), ("backstepping_fed", "backstepping")):
        assert (iae[fed] < iae[own]).all()
    boards = leaderboard(HULLS["cybership2"]).variation
    assert boards.pd_fed / boards.pid == pytest.approx(1.2, abs=0.05)
    lost = HULLS["milliampere"].query("status != 'finished'").law
    linear = lost.isin(["pid", "pd_fed"]).sum()
    assert linear == 1  # "in one of 16"


def test_without_pods_backstepping_holds_the_ferry():
    limits = "{kind: saturated_full, surge_limit: 1000, sway_limit: 1000, yaw_limit: 1000}"
    case = {"vessels": "milliampere", "tasks": "hold", "conditions": "rough"}
    (behind_limits,) = chosen([f"actuator={limits}"], **case)
    status = table(play(behind_limits)).set_index("law").status
    assert status.backstepping == "finished"
    kept = HULLS["milliampere"].set_index([*PLACE[1:], "law"]).status
    assert kept["hold", "rough", "backstepping"] != "finished"
