"""configs/bench_boats, and what docs/bench.md says of its committed runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from podusv_cli.engine.running.simulate import simulate
from podusv_cli.scenario.load import load
from podusv_cli.studies.bench.cases import AXES, Selection, cases
from podusv_cli.studies.bench.runs import play
from podusv_cli.studies.bench.standing import CROSS, PLACE, by_vessel, leaderboard, table

ROOT = Path(__file__).parents[2]
BOATS = ROOT / "configs" / "bench_boats"
RUNS = pd.read_csv(ROOT / "results" / "bench" / "boats.csv")
PAGE = " ".join((ROOT / "docs/bench.md").read_text().split())
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
    counts = [RUNS[name].nunique() for name in ("law", "task", "vessel", "condition")]
    said = "{} laws over {} tasks of legs, {} vessels and {} conditions, {} runs"
    assert said.format(*counts, len(RUNS)) in PAGE


@pytest.mark.parametrize("vessel", LENGTHS)
def test_a_case_run_now_is_the_committed_one(vessel: str) -> None:
    (case,) = chosen(vessels=vessel, tasks="reach", conditions="wind")
    fresh = table(play(case)).set_index("law")
    kept = RUNS[(RUNS[PLACE] == list(case.place)).all(axis=1)].set_index("law")
    assert fresh.status.equals(kept.status)
    np.testing.assert_allclose(fresh.iae, kept.iae, rtol=5e-6)  # six digits are kept


TUNED = ["ardupilot_l1", "ardupilot"]
OWN = ["momentum_vector", "velocity_vector", "alos", "ilos"]


def cells(row: Any) -> str:
    """A law's rank and failures, ratio and variation; a cross where too many runs failed."""
    ends = (f"{row.median_ratio:.2f}", f"{row.variation:.3g}")
    shown = ends if np.isfinite(row.median_ratio) else (CROSS, CROSS)
    return f"{row.mean_rank:.1f}, {row.failed:.0f} | {' | '.join(shown)}"


def test_the_table_is_that_of_the_runs(boards: Any) -> None:
    for law in RUNS.law.unique():
        both = (cells(board.loc[law]) for board in boards.values())
        assert f"| {law} | {' | '.join(both)} |" in PAGE


def test_how_near_autopilots_come_on_each_hull_is_that_of_the_runs(boards: Any) -> None:
    otter, wamv = (boards[vessel].median_ratio for vessel in ("otter", "wamv"))
    podusvs = ["momentum_vector", "velocity_vector", "ilos", "alos", "adrc", "sliding_mode"]
    assert otter[podusvs].max() < otter[TUNED].min() < otter.los_pid
    assert list(wamv.index[wamv < wamv.ardupilot_l1]) == ["momentum_vector"]
    iae = RUNS.pivot_table("iae", PLACE, "law")
    better = (iae.momentum_vector < iae.ardupilot_l1).groupby("vessel").sum()
    said = "better than L1 in {} of 24 cases on the Otter and in {} on the WAM-V"
    assert said.format(better.otter, better.wamv) in PAGE


def test_where_a_wrong_hull_is_told_ranks_are_those_of_the_runs() -> None:
    ranks = RUNS.pivot_table("rank", "law", ["vessel", "condition"])
    for vessel, nearer in (("wamv", True), ("otter", False)):
        wrong = ranks[vessel][["hull_heavy", "hull_light"]]
        assert ((wrong.loc["ardupilot_l1"] < wrong.loc[["alos", "ilos"]].min()) == nearer).all()
        calm = ranks[vessel].calm
        assert calm.ardupilot_l1 > calm[["alos", "ilos"]].max()


def test_who_fails_on_each_hull_is_that_of_the_runs(boards: Any) -> None:
    failed = {vessel: board.failed for vessel, board in boards.items()}
    own = ["ardupilot_l1_firmware", "ardupilot_firmware"]
    said = (
        "on the Otter in {:.0f} of 24 cases and the position controller in {:.0f}, on the WAM-V in "
    )
    said = said.format(*failed["otter"][own]) + "{:.0f} and {:.0f};".format(*failed["wamv"][own])
    assert said in PAGE
    wheels = [failed[vessel].px4_r1 for vessel in ("otter", "wamv")]
    assert "with the wheels' gains PX4 in {:.0f} and {:.0f}.".format(*wheels) in PAGE
    for board in boards.values():
        assert not board.failed[["momentum_vector", "ardupilot_l1", "ardupilot", "los_pid"]].any()
    windy = RUNS[(RUNS.status != "finished") & (RUNS.law == "px4") & (RUNS.vessel == "wamv")]
    assert not windy.condition.isin(["calm", "current"]).any()
    assert f"On the WAM-V in wind it fails in {len(windy)} of 16 cases" in PAGE


def test_what_thrust_varies_on_each_hull_is_that_of_the_runs(boards: Any) -> None:
    cost = {vessel: board.variation for vessel, board in boards.items()}
    otter = cost["otter"]
    podusvs = otter[[*OWN, "adrc", "sliding_mode"]]
    assert podusvs.min() > 2.0 * otter[TUNED].max()


def test_the_table_of_laws_for_boats_says_what_the_runs_say(boards: Any) -> None:
    ratio = {vessel: board.median_ratio for vessel, board in boards.items()}
    failed = sum(board.failed for board in boards.values())
    otter, wamv = ratio["otter"], ratio["wamv"]
    assert f"{otter.momentum_vector:.2f}" == f"{wamv.momentum_vector:.2f}"
    said = f"| {otter.momentum_vector:.2f} times the best in the median on either, no failure in 48"
    assert said in PAGE
    said = (
        "| Otter {:.2f} and {:.2f}, WAM-V {:.2f} and {:.2f}, no failure, a seventh and a third of"
    )
    assert said.format(*otter[TUNED[::-1]], *wamv[TUNED[::-1]]) in PAGE
    own = [failed[f"{law}_firmware"] for law in ("ardupilot", "ardupilot_l1")]
    assert "with the firmware's gains {:.0f} and {:.0f} of 48 fail |".format(*own) in PAGE
    said = f"| Otter {otter.px4:.2f}, WAM-V {wamv.px4:.2f}, fails in {failed.px4:.0f} of 48 |"
    assert said in PAGE
    costs = [board.variation for board in boards.values()]
    parts = [cost.momentum_vector / cost.ardupilot_l1 for cost in costs]
    assert parts == pytest.approx([7.0, 3.0], abs=0.5)


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
