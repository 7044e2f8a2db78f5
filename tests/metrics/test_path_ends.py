"""Metrics of a run end where its path ends, whoever marches it and however long it goes on."""

from __future__ import annotations

import json
import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import podusv
from podusv import gym
from podusv_cli.components.paths.legs import Legs
from podusv_cli.figures.curves import AFTER
from podusv_cli.figures.drawing import FIGURES
from podusv_cli.figures.shown import dress_runs

SCENARIO = """
name: ends
vessel: {preset: paper_nonlinear}
path: {kind: legs, points: [[0, 0], [12, 3], [15, 14], [2, 16]], acceptance: 1.5, switch: passed}
start: {x: -1.0, y: 1.0}
disturbance: {kind: step, b_u: 20.0, b_v: 15.0}
actuator: {kind: saturated, surge_limit: 400.0, yaw_limit: 300.0}
controller: {kind: los_pid}
simulation: {step: 0.02, duration: 90.0}
"""
SENSED: dict[str, Any] = {
    "measurement": {"kind": "sensors"},
    "estimator": {"kind": "ekf"},
    "control.period": 0.1,
}
DURATIONS = (91.0, 133.3, 260.0)
MEASURED_ANEW = {"law_ns", "law_ns_low", "law_ns_high", "law_operations"}


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("ends") / "ends.yaml"
    file.write_text(SCENARIO)
    return file


def looped(log: Any, steady_fraction: float = 0.2) -> dict[str, float]:
    """Metrics by a loop over the rows of a log, up to the first row with all three legs done.

    The steady window begins where four fifths of the 41.0 m of the way are behind the vessel.
    """
    corners = [(0.0, 0.0), (12.0, 3.0), (15.0, 14.0), (2.0, 16.0)]
    lengths = [math.dist(a, b) for a, b in pairwise(corners)]
    opens = (1.0 - steady_fraction) * sum(lengths)
    rows, window = [], []
    for i in range(len(log["time"])):
        row = {n: float(log[n][i]) for n in ("time", "e_ct", "leg", "along_leg", "u", "v", "r")}
        row |= {n: float(log[n][i]) for n in ("tau_u", "tau_v", "tau_r", "tau_u_cmd", "tau_r_cmd")}
        row["saturated"] = float(log["saturated"][i])
        leg = int(row["leg"])
        behind = sum(lengths[:leg]) + (row["along_leg"] if leg < 3 else 0.0)
        rows.append(row)
        if window or behind >= opens:
            window.append(row)
        if leg == 3:
            break

    def integral(of: Any) -> float:
        total = 0.0
        for a, b in pairwise(rows):
            total += 0.5 * (of(a) + of(b)) * (b["time"] - a["time"])
        return total

    span = rows[-1]["time"]
    late = [abs(row["e_ct"]) for row in window]
    return {
        "path_time": span,
        "path_done": rows[-1]["leg"] / 3.0,
        "e_ct_integral": integral(lambda row: abs(row["e_ct"])),
        "e_ct_rms": math.sqrt(integral(lambda row: row["e_ct"] ** 2) / span),
        "e_ct_max": max(abs(row["e_ct"]) for row in rows),
        "e_ct_steady": (sum(late) - 0.5 * late[-1]) / (len(late) - 0.5),
        "effort_u": integral(lambda row: row["tau_u"] ** 2),
        "effort_r": integral(lambda row: row["tau_r"] ** 2),
        "energy": integral(
            lambda row: (
                abs(row["tau_u"] * row["u"])
                + abs(row["tau_v"] * row["v"])
                + abs(row["tau_r"] * row["r"])
            )
        ),
        "saturated_fraction": integral(lambda row: row["saturated"]) / span,
        "peak_tau_u": max(abs(row["tau_u_cmd"]) for row in rows),
        "peak_tau_r": max(abs(row["tau_r_cmd"]) for row in rows),
        "tv_tau_u": sum(abs(b["tau_u_cmd"] - a["tau_u_cmd"]) for a, b in pairwise(window)),
        "tv_tau_r": sum(abs(b["tau_r_cmd"] - a["tau_r_cmd"]) for a, b in pairwise(window)),
    }


def numbers(metrics: Any) -> dict[str, float]:
    return {name: float(x) for name, x in dict(metrics).items() if name not in MEASURED_ANEW}


def test_every_metric_is_that_of_a_loop_over_the_log_up_to_the_last_waypoint(
    scenario: Path,
) -> None:
    run = podusv.simulate(scenario)
    found = numbers(run.metrics)
    expected = looped(run)
    assert 30.0 < found["path_time"] < 80.0
    assert {*expected} == {*found}
    for name, number in expected.items():
        assert found[name] == pytest.approx(number, rel=1e-9), name


@pytest.mark.parametrize("changes", [{}, SENSED], ids=["exact", "sensors"])
def test_no_metric_depends_on_how_long_the_run_goes_on(
    scenario: Path, changes: dict[str, Any]
) -> None:
    one, *others = (
        numbers(podusv.simulate(scenario, changes | {"simulation.duration": t}).metrics)
        for t in DURATIONS
    )
    assert len(one) > 12
    assert all(np.isfinite(x) for x in one.values())
    for other in others:
        assert other == one


def test_a_thinned_log_changes_no_metric(scenario: Path) -> None:
    every = numbers(podusv.simulate(scenario).metrics)
    assert numbers(podusv.simulate(scenario, {"log.every": 50}).metrics) == every


def test_side_by_side_as_alone(scenario: Path) -> None:
    starts = [round(0.1 * i - 1.0, 1) for i in range(9)]
    laned = podusv.simulate_many(scenario, {"start.y": starts}, side_by_side=True)
    for row, start in enumerate(starts):
        alone = numbers(podusv.simulate(scenario, {"start.y": start}).metrics)
        assert {name: float(laned[name][row]) for name in alone} == alone
    assert len({*laned["path_time"]}) > 1


def test_in_pieces_and_as_a_reward_metrics_end_where_the_path_does(
    scenario: Path, tmp_path: Path
) -> None:
    """One leg of 9.7 m to the north, pushed along it for 0.34 s at a time."""
    changes = {
        "path": {"kind": "legs", "points": [[0.0, 0.0], [9.7, 0.0]], "switch": "passed"},
        "start": {"x": 0.3, "y": 0.4, "psi": 0.0, "u": 0.2},
        "disturbance": {"kind": "none"},
        "simulation.duration": 34.0,
    }
    session = podusv.open_session(scenario, changes, period=0.34)
    env = gym.Env(str(scenario), changes, period=0.34, reward="e_ct_integral", limits=(50.0, 1.0))
    env.reset(seed=0)
    gathered, rewards, arrived = [], [], []
    for _ in range(100):
        seen = session.step((40.0, 0.0))
        gathered.append(session.metric("energy"))
        arrived.append(seen.time >= session.metric("path_time"))
        rewards.append(env.step((40.0, 0.0))[1])
    first = arrived.index(True)
    assert 5 < first < 90
    assert len({*gathered[: first + 1]}) == first + 1
    assert len({*gathered[first:]}) == 1
    assert all(reward < 0.0 for reward in rewards[: first + 1])
    assert not any(rewards[first + 1 :])
    log = session.close(tmp_path / "session", figures=False)
    t, e, arrival = log["time"], log["e_ct"], log.metrics.path_time
    until = t <= arrival
    assert log.metrics.e_ct_integral == pytest.approx(np.trapezoid(np.abs(e[until]), t[until]))


def test_a_run_that_does_not_come_so_far_is_measured_as_a_whole(scenario: Path) -> None:
    run = podusv.simulate(scenario, {"simulation.duration": 20.0})
    t, e = run["time"], run["e_ct"]
    assert run["leg"].max() < 3
    found = run.metrics
    assert math.isnan(found.path_time)
    assert found.e_ct_rms == pytest.approx(math.sqrt(np.trapezoid(e**2, t) / 20.0), rel=1e-9)
    late = np.abs(e[t >= 16.0])
    assert found.e_ct_steady == pytest.approx((late.sum() - 0.5 * late[-1]) / (len(late) - 0.5))
    demand = run["tau_r_cmd"][t >= 16.0]
    assert found.tv_tau_r == pytest.approx(np.abs(np.diff(demand)).sum(), rel=1e-9)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.8, 1.0])
def test_a_share_of_the_way_lies_where_it_is_measured_along_the_legs(share: float) -> None:
    path = Legs(points=((0.0, 0.0), (3.0, 4.0), (3.0, 14.0), (-2.0, 14.0)))
    expected = {
        0.0: {"leg": 0.0},
        0.3: {"leg": 1.0, "along_leg": 1.0},
        0.8: {"leg": 2.0, "along_leg": 1.0},
        1.0: {"leg": 3.0},
    }
    assert path.passed_by(share) == pytest.approx(expected[share])


def test_a_log_beside_a_run_counts_to_the_end_of_its_path(scenario: Path, tmp_path: Path) -> None:
    """A boat that stops there and drifts away is not off the track that it was to follow."""
    run = podusv.run(scenario, out=tmp_path / "run", figures=False)
    arrival = run.metrics.path_time
    over = run["time"] > arrival
    drifted = np.where(over, 100.0, 0.25)
    table = np.column_stack([run["time"], run["x"] + drifted, run["y"], run["psi"]])[::7]
    log = tmp_path / "sea.csv"
    np.savetxt(log, table, "%.17g", ",", header="time,x,y,psi", comments="")
    done = podusv.compare([run, str(log)], out=tmp_path / "both", figures=False)
    assert done.table.loc["log_distance_max", "run"] == pytest.approx(0.25, rel=1e-9)
    assert 100.0 in np.round(table[:, 1] - run["x"][::7], 6)


def test_a_metric_of_the_log_is_given_the_rows_up_to_the_end(scenario: Path) -> None:
    file = scenario.parent / "last.py"
    file.write_text(
        "from podusv_cli.plugin import Metric\n"
        "last = Metric('last_time', 's', 'time of the last row', "
        "of_log=lambda log: float(log['time'][-1]))\n"
    )
    run = podusv.simulate(scenario, {"plugins": [str(file)]})
    assert run.metrics.last_time == run.metrics.path_time < run["time"][-1]


def test_tables_and_pages_say_up_to_when_they_count_and_the_rest_is_grey(
    scenario: Path, tmp_path: Path
) -> None:
    changes = {
        "controllers": {
            "one": {"kind": "los_pid"},
            "late": {"kind": "los_pid", "U": 0.2, "U_min": 0.1},
        },
        "simulation.duration": 47.0,
    }
    done = podusv.compare(scenario, changes, out=tmp_path / "both", figures=False)
    assert done.table.loc["path_done", "late"] < 1.0
    time = done.table.loc["path_time", "one"]
    words = f"up to the end of the path: one {time:g} s; of the whole run: late"
    assert words in (tmp_path / "both" / "comparison.md").read_text()
    page = (tmp_path / "both" / "report.html").read_text()
    assert words in page
    chase, curves = (
        json.loads(page.split(f'id="{name}-data">')[1].split("</script>")[0])
        for name in ("chase", "curves")
    )
    for shown in (chase, curves):
        assert [run["counts"] for run in shown["runs"]] == [time, 47.0]
    run = done["one"]
    shown = dress_runs([run.past])
    axes = next(
        axes for axes in FIGURES["path"].family(shown, 2).axes if "e_{ct}" in axes.get_ylabel()
    )
    grey, own = sorted(axes.lines, key=lambda line: line.get_color() != AFTER["color"])
    assert own.get_xdata()[-1] == grey.get_xdata()[0] == time
    assert grey.get_xdata()[-1] == 47.0


def test_what_was_gathered_before_the_last_part_of_the_way_is_void(scenario: Path) -> None:
    """Started far behind, the last part of the time begins before that of the way."""
    changes = {"metrics.steady_fraction": 0.6, "start.x": -20.0, "simulation.duration": 75.0}
    run = podusv.simulate(scenario, changes)
    opens = run["time"][np.argmax((run["leg"] >= 1) & (run["along_leg"] > 0.4 * 41.0 - 12.37))]
    assert 0.4 * 75.0 + 5.0 < opens < run.metrics.path_time
    for name, number in looped(run, 0.6).items():
        assert run.metrics[name] == pytest.approx(number, rel=1e-9), name


def plugged(folder: Path, passed_by: str) -> dict[str, Any]:
    """Changes that take the legs of podusv with another method `passed_by`."""
    file = folder / "mine.py"
    file.write_text(
        "from typing import Literal\n"
        "from podusv_cli.components.paths.legs import Legs\n"
        "class Mine(Legs):\n"
        "    'Legs that say otherwise where they end.'\n"
        "    kind: Literal['mine'] = 'mine'\n"
        f"    def passed_by(self, share):\n        {passed_by}\n"
    )
    return {"plugins": [str(file)], "path.kind": "mine"}


FAULTS = {
    "raise RuntimeError('no way')": "asked where it ends: RuntimeError: no way",
    "return {'leg': 1.0, 'along_leg': 0.0, 'e_ct': 3.0}": (
        "asked where it ends: passed_by(0.8) returns leg, along_leg, e_ct; at most two are allowed"
    ),
    "return {'leg': 1.0, 'along': 0.0}": (
        "passed_by(0.8) returns leg, along; at most two are allowed, of its places (leg, e_ct, "
    ),
    "return [3.0]": "asked where it ends: AttributeError",
}


@pytest.mark.parametrize("passed_by", FAULTS)
def test_a_path_that_does_not_say_where_it_ends_is_one_sentence(
    scenario: Path, tmp_path: Path, passed_by: str
) -> None:
    with pytest.raises(podusv.PodusvError) as caught:
        podusv.simulate(scenario, plugged(tmp_path, passed_by))
    assert FAULTS[passed_by] in str(caught.value)
    assert "asked where it ends" in str(caught.value)
    assert "evaluated once before the run" not in str(caught.value)


def test_a_path_of_a_plug_in_ends_where_it_says(scenario: Path, tmp_path: Path) -> None:
    changes = plugged(tmp_path, "return super().passed_by(share)")
    one, other = (
        numbers(podusv.simulate(scenario, changes | change).metrics)
        for change in ({}, {"path.kind": "legs"})
    )
    assert 30.0 < one["path_time"] < 80.0
    assert one == other
