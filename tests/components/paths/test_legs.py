"""Legs followed without a timetable: geometry, switching, what laws see, what is absent."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from conftest import corrected
from pydantic import ValidationError

import podusv as package
from podusv_cli.components.paths.legs import Legs
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.findings.finding import preflight

POINTS = ((0.0, 0.0), (12.0, 3.0), (15.0, 14.0), (2.0, 16.0))
SCENARIO: dict[str, Any] = {
    "path": {"kind": "legs", "points": POINTS, "acceptance": 1.5},
    "start": {"x": -1.0, "y": 1.0},
    "simulation.duration": 90.0,
}
SENSED: dict[str, Any] = {"measurement": {"kind": "sensors"}, "estimator": {"kind": "ekf"}}


def run(law: str = "velocity_vector", **changes: Any) -> Any:
    source = "podusv:mu_2017/corrected.yaml"
    return package.simulate(source, SCENARIO | {"controller": {"kind": law}} | changes)


def beside(x: Any, y: Any, leg: int) -> tuple[Any, Any]:
    """Along and across a leg, by complex numbers."""
    a, b = (complex(*POINTS[leg + i]) for i in (0, 1))
    turned = ((np.asarray(x) + 1j * np.asarray(y)) - a) * np.conj(b - a) / abs(b - a)
    return turned.real, turned.imag


def switched(x: Any, y: Any, radius: float, *, passed: bool = False) -> list[int]:
    """The active leg at every row, by going through a track."""
    leg, found = 0, []
    for here in zip(x, y, strict=True):
        if leg < len(POINTS) - 1:
            away = float(np.hypot(*np.subtract(POINTS[leg + 1], here)))
            along, _ = beside(*here, leg)
            past = along > np.hypot(*np.subtract(POINTS[leg + 1], POINTS[leg]))
            leg += int(away < radius or (passed and bool(past)))
        found.append(leg)
    return found


@pytest.mark.parametrize("law", ["velocity_vector", "los_pid", "pid"])
def test_legs_and_errors_are_those_of_the_logged_track(law: str) -> None:
    log = run(law)
    assert log["leg"].tolist() == switched(log["x"], log["y"], 1.5)
    assert log["leg"].max() == 3
    for leg in range(3):
        rows = np.minimum(log["leg"], 2) == leg
        along, across = beside(log["x"][rows], log["y"][rows], leg)
        np.testing.assert_allclose(log["e_ct"][rows], across, atol=1e-12)
        np.testing.assert_allclose(log["along_leg"][rows], along, atol=1e-12)


def test_laws_see_the_point_beside_them_or_their_standoff_ahead() -> None:
    for law, lead in (("velocity_vector", 0.0), ("pid", 0.5)):
        log = run(law)
        for leg in range(3):
            rows = np.minimum(log["leg"], 2) == leg
            along, across = beside(log["x_d"][rows], log["y_d"][rows], leg)
            np.testing.assert_allclose(across, 0.0, atol=1e-12)
            np.testing.assert_allclose(along, log["along_leg"][rows] + lead, atol=1e-12)


def test_there_is_no_distance_to_a_target_anywhere(tmp_path: Any) -> None:
    log = package.run(
        "podusv:mu_2017/corrected.yaml",
        SCENARIO | {"simulation.duration": 20.0},
        out=tmp_path / "r",
        figures=False,
    )
    assert not {"z_e", "x_e"} & set(log.log)
    about = {"iae", "z_e_steady", "settling_time", "e_steady", "cross_track_rms"}
    assert not about & set(log.metrics.index)
    assert {"e_ct_rms", "e_ct_max", "path_done"} <= set(log.metrics.index)
    claim = {"A": {"says": "a", "source": "ours", "expect": "max(los_pid.z_e) < 1"}}
    laws = {"controllers": {"los_pid": {"kind": "los_pid"}}, "claims": claim}
    found = package.compare("podusv:mu_2017/corrected.yaml", SCENARIO | laws, figures=False)
    assert found.claims.loc["A", "verdict"] == "cannot tell"
    assert "z_e" not in " ".join(map(str, found.table.index))


def test_the_stability_monitor_is_off_where_the_law_sees_another_target() -> None:
    square = {"kind": "waypoints", "legs": "straight", "points": POINTS}
    source, short = "podusv:mu_2017/corrected.yaml", {"simulation.duration": 2.0}
    logs = [package.simulate(source, short | {"path": p}) for p in (square, square | {"fillet": 2})]
    assert ["V" in one.log for one in (*logs, run("adaptive_neural"))] == [True, False, False]


def test_metrics_are_those_of_the_log() -> None:
    log = run("los_pid")
    found, counts = log.metrics, slice(1 + int(np.argmax(log["leg"] == 3)))
    t, e = log["time"][counts], log["e_ct"][counts]
    assert found.path_time == t[-1] < log["time"][-1]
    assert found.path_done == 1.0
    assert found.e_ct_max == pytest.approx(np.abs(e).max())
    assert found.e_ct_rms == pytest.approx(np.sqrt(np.trapezoid(e**2, t) / t[-1]), rel=1e-9)
    short = run("los_pid", **{"simulation.duration": 40.0}).metrics
    assert np.isnan(short.path_time)
    assert short.path_done == pytest.approx(1 / 3)


def test_a_missed_waypoint_is_passed_where_the_path_says_so() -> None:
    path = SCENARIO["path"] | {"acceptance": 0.05}
    stuck, on = (run("los_pid", path=path | {"switch": how}) for how in ("circle", "passed"))
    assert stuck["leg"].max() < 3
    assert on["leg"].max() == 3
    assert on["leg"].tolist() == switched(on["x"], on["y"], 0.05, passed=True)


def test_behind_sensors_the_legs_change_by_what_the_law_sees() -> None:
    log = run("velocity_vector", **SENSED)
    seen = switched(log["x_est"], log["y_est"], 1.5)
    assert log["leg"].tolist() == seen
    assert seen != switched(log["x"], log["y"], 1.5)
    _, across = beside(log["x"], log["y"], 0)
    rows = log["leg"] == 0
    np.testing.assert_allclose(log["e_ct"][rows], across[rows], atol=1e-12)


def test_sampled_control_follows_and_plain_python_has_the_same_bits() -> None:
    loop = replace(corrected(), path=Legs(points=POINTS, acceptance=1.5))
    grid = TimeGrid(0.05, 300, hold_every=4)
    from podusv_cli.engine.running.simulate import simulate

    one, other = (simulate(loop, grid, compiled=compiled) for compiled in (True, False))
    for name in ("x", "leg", "e_ct", "tau_u_cmd"):
        np.testing.assert_allclose(one[name], other[name], rtol=1e-9, atol=1e-12)
    assert "z_e" not in one.signals


@pytest.mark.slow
def test_runs_side_by_side_have_the_bits_that_they_have_alone() -> None:
    radii = {"path.acceptance": np.linspace(1.0, 4.0, 9)}
    scenario = package.load(
        "podusv:mu_2017/corrected.yaml", SCENARIO | {"simulation.duration": 24.0}
    )
    one, other = (
        package.simulate_many(scenario, radii, side_by_side=lanes) for lanes in (True, False)
    )
    for metric in ("e_ct_rms", "e_ct_max", "effort_u", "path_done"):
        assert one[metric].tolist() == other[metric].tolist()
    assert len(set(one.path_done)) > 1  # the runs are on different legs


@pytest.mark.parametrize("points", [(), ((0.0, 0.0),), ((0.0, 0.0), (0.0, 0.0))])
def test_a_path_needs_two_points_apart(points: Any) -> None:
    with pytest.raises(ValidationError, match=r"two points|the same"):
        Legs(points=points)


def test_findings_tell_of_a_leg_too_short_and_of_legs_that_are_left() -> None:
    def codes(**changes: Any) -> set[str]:
        return {
            warning.partition("[")[2].partition("]")[0]
            for warning in run("los_pid", **changes).warnings
        }

    legs = SCENARIO["path"]
    assert "short-leg" in codes(path=legs | {"acceptance": 6.0})
    (short,) = (
        w for w in run("los_pid", path=legs | {"acceptance": 60.0}).warnings if "short" in w
    )
    assert f", and {len(legs['points']) - 2} more of {len(legs['points']) - 1} are short" in short
    assert not {"short-leg", "never-arrives", "never-settles"} & codes()
    assert "never-arrives" in codes(**{"simulation.duration": 40.0})
    missed = run("los_pid", path=legs | {"acceptance": 0.05})
    (told,) = (warning for warning in missed.warnings if "never-arrives" in warning)
    assert "path.switch: passed" in told


def test_legs_that_no_run_can_end_in_time_are_told_with_a_duration_that_does() -> None:
    """Hops by hand: 13.153 + 11.402 + 13.153 m; without the circles 7.5 m less, 60.4 s."""

    def told(seconds: float, law: str = "los_pid") -> list[str]:
        changes = {"controller": {"kind": law}, "simulation.duration": seconds}
        scenario = package.load("podusv:mu_2017/corrected.yaml", SCENARIO | changes)
        return [one.text for one in preflight(scenario) if one.code == "legs-too-long"]

    (text,) = told(60.0)
    assert "37.71 m" in text
    assert "75.4 s at 0.5 m/s; simulate 91 s" in text
    assert not told(61.0)
    assert not told(60.0, "zigzag")
    for law in ("los_pid", "velocity_vector"):
        done = run(law, **{"simulation.duration": 91.0}).metrics
        assert done["path_done"] == 1.0
        assert done["path_time"] > 60.4


def test_a_trial_leaves_the_legs_aside_and_no_finding_asks_for_them() -> None:
    trial = run("zigzag", **{"simulation.duration": 2.0})
    assert any("trial-unfinished" in warning for warning in trial.warnings)
    assert not any("never-arrives" in warning for warning in trial.warnings)
    of_legs = {"e_ct_integral", "e_ct_rms", "e_ct_max", "e_ct_steady", "path_time", "path_done"}
    assert not of_legs & set(trial.metrics.index)
    assert of_legs <= set(run("los_pid", **{"simulation.duration": 2.0}).metrics.index)


def test_a_number_that_a_run_has_not_is_never_or_a_dash(podusv: Any, tmp_path: Any) -> None:
    short = ("simulation.duration=1", "actuator={kind: pod, preset: otter}")
    sets = [word for change in short for word in ("--set", change)]
    said = podusv("run", "podusv:laws/legs.yaml", "--no-figures", "--out", tmp_path / "r", *sets)
    shown = {line.split()[-1]: line.split()[-2] for line in said.out.splitlines()}
    assert shown["path_time"] == "never"
    assert shown["energy_pod"] == "-"  # the Otter's power is not known


@pytest.mark.parametrize("command", ["optimum", "margins"])
def test_what_needs_a_target_with_a_timetable_says_so(
    command: str, podusv: Any, tmp_path: Any
) -> None:
    file = tmp_path / "a.yaml"
    file.write_text(
        "extends: podusv:laws/legs.yaml\ncontrollers: {}\ncontroller: {kind: los_pid}\n"
    )
    said = podusv(command, str(file))
    assert said.code != 0
    assert "timetable" in said.err
