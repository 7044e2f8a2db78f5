"""configs/bench_boats, and whether words of docs/bench.md hold for its committed runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from rotation import one_in

from podusv_cli.engine.running.simulate import simulate
from podusv_cli.scenario.load import load
from podusv_cli.studies.bench.cases import AXES, Selection, cases
from podusv_cli.studies.bench.runs import play
from podusv_cli.studies.bench.standing import PLACE, by_vessel, leaderboard, table

ROOT = Path(__file__).parents[2]
BOATS = ROOT / "configs" / "bench_boats"
RUNS = pd.read_csv(ROOT / "results" / "bench" / "boats.csv")
LENGTHS = {"otter": 2.0, "wamv": 4.9}


HULLS = by_vessel(RUNS)


@pytest.fixture(scope="module")
def boards() -> Any:
    return {vessel: leaderboard(rows) for vessel, rows in HULLS.items()}


def chosen(overrides: tuple[str, ...] = (), **names: str) -> list[Any]:
    picked = {axis: (name,) for axis, name in names.items()}
    return list(cases(Selection(BOATS, overrides=list(overrides), chosen=picked)))


def test_the_committed_runs_are_those_of_the_bench() -> None:
    for axis in AXES:
        assert set(RUNS[axis.rstrip("s")]) == {path.stem for path in (BOATS / axis).iterdir()}
    (case,) = chosen(vessels="otter", tasks="reach", conditions="calm")
    assert set(RUNS.law) == set(case.laws)


@pytest.mark.parametrize("vessel", one_in(2, [*LENGTHS]))
def test_a_case_run_now_is_the_committed_one(vessel: str) -> None:
    (case,) = chosen(vessels=vessel, tasks="reach", conditions="wind")
    fresh = table(play(case)).set_index("law")
    kept = RUNS[(RUNS[PLACE] == list(case.place)).all(axis=1)].set_index("law")
    assert fresh.status.equals(kept.status)
    np.testing.assert_allclose(fresh.iae, kept.iae, rtol=5e-6)  # six digits are kept


TUNED = ["ardupilot_l1", "ardupilot"]
OWN = ["momentum_vector", "velocity_vector", "alos", "ilos"]


def test_how_near_autopilots_come_on_each_hull_is_that_of_the_runs(boards: Any) -> None:
    otter, wamv = (boards[vessel].median_ratio for vessel in ("otter", "wamv"))
    podusvs = ["momentum_vector", "velocity_vector", "ilos", "alos", "adrc", "sliding_mode"]
    assert otter[podusvs].max() < otter[TUNED].min() < otter.los_pid
    assert list(wamv.index[wamv < wamv.ardupilot_l1]) == ["momentum_vector"]


def test_where_a_wrong_hull_is_told_ranks_are_those_of_the_runs() -> None:
    ranks = RUNS.pivot_table("rank", "law", ["vessel", "condition"])
    for vessel, nearer in (("wamv", True), ("otter", False)):
        wrong = ranks[vessel][["hull_heavy", "hull_light"]]
        assert ((wrong.loc["ardupilot_l1"] < wrong.loc[["alos", "ilos"]].min()) == nearer).all()
        calm = ranks[vessel].calm
        assert calm.ardupilot_l1 > calm[["alos", "ilos"]].max()


def test_who_fails_nowhere_and_where_is_that_of_the_runs(boards: Any) -> None:
    for board in boards.values():
        assert not board.failed[["momentum_vector", "ardupilot_l1", "ardupilot", "los_pid"]].any()
    windy = RUNS[(RUNS.status != "finished") & (RUNS.law == "px4") & (RUNS.vessel == "wamv")]
    assert not windy.condition.isin(["calm", "current"]).any()


def test_what_thrust_varies_on_each_hull_is_that_of_the_runs(boards: Any) -> None:
    cost = {vessel: board.variation for vessel, board in boards.items()}
    otter = cost["otter"]
    podusvs = otter[[*OWN, "adrc", "sliding_mode"]]
    assert podusvs.min() > 2.0 * otter[TUNED].max()


def test_words_of_the_table_of_laws_for_boats_hold_for_the_runs(boards: Any) -> None:
    otter, wamv = (board.median_ratio.momentum_vector for board in boards.values())
    assert f"{otter:.2f}" == f"{wamv:.2f}"  # "on either"
    costs = [board.variation for board in boards.values()]
    parts = [cost.momentum_vector / cost.ardupilot_l1 for cost in costs]
    assert parts == pytest.approx([7.0, 3.0], abs=0.5)  # "a seventh and a third"


@pytest.mark.parametrize("vessel", LENGTHS)
def test_what_is_tuned_on_the_water_is_so_in_every_condition(vessel: str) -> None:
    """To the true hull, whatever the laws are told."""
    (calm,) = chosen(vessels=vessel, tasks="reach", conditions="calm")
    for condition in ("hull_heavy", "hull_light"):
        (case,) = chosen(vessels=vessel, tasks="reach", conditions=condition)
        assert case.laws["alos"].nominal.m == pytest.approx(
            calm.laws["alos"].nominal.m * (1.25 if condition == "hull_heavy" else 0.75)
        )
        for law in ("ardupilot", "ardupilot_l1", "px4"):
            assert case.laws[law].controller == calm.laws[law].controller


def test_the_scenario_to_begin_with_has_the_bench_s_laws() -> None:
    """Of the Otter: the same numbers under the same names."""
    (case,) = chosen(vessels="otter", tasks="reach", conditions="calm")
    alone = load(ROOT / "configs/laws/autopilots.yaml").scenario.singles()
    for law in ("ardupilot", "ardupilot_l1", "ardupilot_firmware", "px4", "px4_r1"):
        assert alone[law].controller == case.laws[law].controller


@pytest.mark.parametrize("vessel", LENGTHS)
@pytest.mark.parametrize(
    ("law", "key", "step"), [("px4", "lookahead", 1.0), ("ardupilot_l1", "l1_period", 0.5)]
)
def test_guidance_is_raised_until_the_boat_no_longer_weaves(
    vessel: str, law: str, key: str, step: float
) -> None:
    """The least number in the guide's steps with one swing at most beyond a tenth of L."""

    def swings(number: float) -> int:
        changes = (f"controllers.{law}.{key}={number}",)
        (case,) = chosen(changes, vessels=vessel, tasks="reach", conditions="calm")
        scenario = case.laws[law]
        e = simulate(scenario.closed_loop(), scenario.time_grid())["e_ct"]
        beside = np.split(e, np.flatnonzero(np.diff(np.sign(e))) + 1)[1:]
        return sum(np.abs(swing).max() > 0.1 * LENGTHS[vessel] for swing in beside)

    (case,) = chosen(vessels=vessel, tasks="reach", conditions="calm")
    taken = getattr(case.laws[law].controller, key)
    default = type(case.laws[law].controller).model_fields[key].default
    assert swings(taken) <= 1
    assert taken == default or swings(taken - step) > 1
