"""configs/bench_boats, and what results/bench.md and docs/bench.md say of its committed runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from podusv_cli.engine.running.simulate import simulate
from podusv_cli.scenario.load import load
from podusv_cli.studies.bench.cases import AXES, Selection, cases
from podusv_cli.studies.bench.page import as_markdown
from podusv_cli.studies.bench.runs import play
from podusv_cli.studies.bench.standing import PLACE, leaderboard, table

ROOT = Path(__file__).parents[1]
BOATS = ROOT / "configs" / "bench_boats"
RUNS = pd.read_csv(ROOT / "results" / "bench" / "boats.csv")
PAGE, GUIDE = (
    " ".join((ROOT / name).read_text().split()) for name in ("results/bench.md", "docs/bench.md")
)
LENGTHS = {"otter": 2.0, "wamv": 4.9}


@pytest.fixture(scope="module")
def board() -> Any:
    return leaderboard(RUNS)


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


def test_the_table_and_its_findings_are_those_of_the_runs(board: Any) -> None:
    assert as_markdown(RUNS) in (ROOT / "results" / "bench.md").read_text()
    failed = RUNS[RUNS.status != "finished"]
    counts = failed.groupby("law").size()
    own = ["ardupilot_l1_firmware", "ardupilot_firmware", "px4_r1"]
    said = "L1 fails in {} of 48 cases and the position controller in {}, with the wheels' gains "
    assert (said + "PX4 in {};").format(*counts[own]) in PAGE
    of_them = failed[failed.law.isin(own)]
    assert f"of these {len(of_them)} failures {(of_them.vessel == 'wamv').sum()} are on" in PAGE
    iae = RUNS.pivot_table("iae", PLACE, "law")
    better = (iae.momentum_vector < iae.ardupilot_l1).sum()
    ratio = [f"{board.median_ratio[law]:.2f}" for law in ("ardupilot_l1", "ardupilot")]
    assert "at {} (L1) and {} (position controller) times the best law".format(*ratio) in PAGE
    assert f"`momentum_vector` is better than L1 in {better} of 48 cases" in PAGE
    ranks = RUNS.pivot_table("rank", "law", "condition")
    wrong = [f"{ranks.loc[law, f'hull_{how}']:.1f}" for law in ("ardupilot_l1", "ilos")
             for how in ("heavy", "light")]  # fmt: skip
    assert "(mean ranks {} and {}; `ilos` {} and {})".format(*wrong) in PAGE
    for condition in ("calm", "current"):
        assert ranks.loc["ardupilot_l1", condition] > ranks.loc["momentum_vector", condition]
    gentle = leaderboard(RUNS[RUNS.task.isin(["reach", "zigzag"])]).median_ratio
    said = "L1 is at {:.2f} and the position controller at {:.2f} times the best law), slowing"
    assert said.format(gentle.ardupilot_l1, gentle.ardupilot) in PAGE
    costs = board.variation
    beside = sorted(costs[["momentum_vector", "velocity_vector", "alos", "ilos"]])
    assert costs.ardupilot == pytest.approx(costs.ardupilot_l1, rel=0.01)
    numbers = [f"{cost:.3g}" for cost in (costs.ardupilot_l1, costs.px4, beside[0], beside[-1])]
    said = "is {} for both of ArduPilot's, {} for PX4, and {} to {} for the four laws before them"
    assert said.format(*numbers) in PAGE
    windy = failed[(failed.law == "px4") & (failed.vessel == "wamv")]
    assert not windy.condition.isin(["calm", "current"]).any()
    assert f"On the WAM-V in wind it fails in {len(windy)} of 16 cases" in PAGE
    assert f"({board.median_ratio.los_pid:.2f} times the best), but fails nowhere" in PAGE


def test_the_table_of_laws_for_boats_says_what_the_runs_say(board: Any) -> None:
    ratio, failed, costs = board.median_ratio, board.failed, board.variation
    assert not failed[["momentum_vector", "ardupilot_l1", "ardupilot", "los_pid"]].any()
    assert f"| {ratio.momentum_vector:.2f} times the best in the median, no failure in 48" in GUIDE
    own = [failed[f"{law}_firmware"] for law in ("ardupilot", "ardupilot_l1")]
    said = "| {:.2f} and {:.2f}, no failure, a fifth of the variation of thrust; with the "
    said += "firmware's gains "
    said = said.format(ratio.ardupilot, ratio.ardupilot_l1)
    assert said + "{:.0f} and {:.0f} of 48 fail |".format(*own) in GUIDE
    assert f"| {ratio.px4:.2f}, fails in {failed.px4:.0f} of 48 |" in GUIDE
    assert costs.momentum_vector / costs.ardupilot_l1 == pytest.approx(5.0, abs=0.5)


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
