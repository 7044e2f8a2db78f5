"""Stations: when they count as kept, what the target does, where metrics end."""

import math
from pathlib import Path

import numpy as np
import pytest
from pose_samples import BOAT, loaded_pose, marched
from pydantic import ValidationError

import podusv
from podusv_cli.components.paths.stations import Stations
from podusv_cli.findings.finding import postflight

POSES = ((0.0, 0.0, 0.2), (1.0, 2.0, 3.4), (0.5, 2.0, 2.9), (0.5, 2.0, 2.9))
PATH = (
    f"path: {{kind: stations, poses: {[*map(list, POSES)]}, radius: 0.1, angle: 0.05, keep: 2.1, "
    "travel: 7.3}\n"
)
LAW = "controller: {kind: pose_pid, w_x: 0.6, w_y: 0.7, w_r: 1.1}\n"
LONG = "simulation={step: 0.02, duration: 70.0}"
SENSED = ("measurement={kind: sensors}", "estimator={kind: ekf}", "control.period=0.14")


def walked(log, seen=("x", "y", "psi")):
    """Station, time of leaving and time since which it is there, by a loop over a log at 50 Hz."""
    station, left, since, rows = 0, 0.0, 0.0, []
    for t, x, y, psi in zip(log["time"], *(log[name] for name in seen), strict=True):
        if station < len(POSES):
            north, east, heading = POSES[station]
            off = math.remainder(psi - heading, 2.0 * math.pi)
            there = math.hypot(x - north, y - east) <= 0.1 and abs(off) <= 0.05
            there &= station == 0 or t - left > 7.3 - 1e-6
            since = (t if since < 0.0 else since) if there else -1.0
            if since >= 0.0 and t - since > 2.1 - 1e-6:
                station, left, since = station + 1, t, -1.0
        rows.append((station, left, since))
    return np.array(rows)


def aimed(t, station, left):
    """The target: quintic from the station before, begun when it was left; the last one stays."""
    begin, end = (POSES[min(max(i, 0), 3)] for i in (station - 1, station))
    s = min((t - left) / 7.3, 1.0)
    part = 10 * s**3 - 15 * s**4 + 6 * s**5
    return [a + (b - a) * part for a, b in zip(begin, end, strict=True)]


@pytest.mark.parametrize("changes", [(), SENSED])
def test_a_station_is_left_once_it_was_kept_for_the_time_asked_for(changes):
    log = marched(BOAT + PATH + LAW, LONG, "start.x=0.4", *changes)
    rows = walked(log, ("x_est", "y_est", "psi_est") if changes else ("x", "y", "psi"))
    np.testing.assert_array_equal(log["station"], rows[:, 0])
    np.testing.assert_allclose(log["left_at"], rows[:, 1], atol=1e-9)
    np.testing.assert_allclose(log["there_since"], rows[:, 2], atol=1e-9)
    assert log["station"][-1] == 4
    assert (log["there_since"] == -1.0).sum() > 500
    wanted = [aimed(t, int(row[0]), row[1]) for t, row in zip(log["time"], rows, strict=True)]
    for name, column in zip(("x_d", "y_d", "heading_d"), np.transpose(wanted), strict=True):
        np.testing.assert_allclose(log[name], column, atol=1e-12)


def test_metrics_end_with_the_last_station():
    over = ("simulation.duration=60.0", "metrics.steady_fraction=0.25", "start.x=1.5")
    run = podusv.simulate(loaded_pose(BOAT + PATH + LAW, LONG, *over))
    rows = walked(run)
    end = int(np.argmax(rows[:, 0] == 4))
    assert run.metrics["path_time"] == run["time"][end] < 60.0
    assert run.metrics["path_done"] == 1.0
    z = run["z_e"][: end + 1]
    assert run.metrics["iae"] == pytest.approx(np.trapezoid(z, dx=0.02), rel=1e-9)
    late = int(np.argmax(rows[:, 0] == 3))  # three of four
    assert run["time"][late] > 0.75 * 60.0  # the window by time has begun, and begins anew
    span = slice(late, end + 1)
    mean = np.trapezoid(run["z_e"][span], dx=0.02) / (run["time"][end] - run["time"][late])
    assert run.metrics["z_e_steady"] == pytest.approx(mean, rel=1e-9)
    assert run.metrics["watch_circle"] >= 0.4


def test_the_target_of_a_vessel_that_is_ahead_of_it_does_not_jump():
    """Near the pose before the target is: no step is longer than the quintic's fastest."""
    path = "path: {kind: stations, poses: [[0, 0, 0], [1, 0, 0], [0, 0, 0]], keep: 1.0}\n"
    log = marched(BOAT + path + LAW, "simulation={step: 0.02, duration: 100.0}")
    assert log["station"][-1] == 3
    assert np.abs(np.diff(log["x_d"])).max() <= 1.875 * 1.0 / 40.0 * 0.02 * (1.0 + 1e-9)


def test_a_station_that_is_not_kept_is_told():
    pushed = ("disturbance={kind: step, b_v: 4.0}", "controller.integral=0.0")
    weak = loaded_pose(BOAT + PATH + LAW, LONG, *pushed)
    run = podusv.simulate(weak)
    assert run.metrics["path_done"] == 0.0
    assert math.isnan(run.metrics["path_time"])
    said = {found.code: found.text for found in postflight(weak, run.recording)}
    assert "0 of 4 stations have been kept at the end" in said["station-not-kept"]


def test_margins_of_stations_are_refused_with_the_remedy(podusv):
    Path("a.yaml").write_text(BOAT + PATH + LAW)
    said = podusv("margins", "a.yaml")
    assert said.code == 2
    assert "--set path.kind=hold" in said.err


def test_what_is_no_station_is_refused():
    with pytest.raises(ValidationError, match="poses is empty; give at least one"):
        Stations(poses=())
