"""Metrics of poses and of a sway force, by plain loops over a log."""

import math

import numpy as np
import pytest
from pose_samples import BOAT, loaded_pose

import podusv
from podusv_cli.metrics.table import METRICS, headlines_first

LIMITS = "actuator={kind: saturated_full, surge_limit: 3.0, yaw_limit: 2.0, sway_limit: 1.5}"
LAW = "controller: {kind: pose_pid, w_x: 0.4, w_y: 0.5, w_r: 0.9}\n"
WAY = "path: {kind: poses, poses: [[0, 0, 0.2], [1, 2, 3.4], [0, 1, 2.5]], travel: 9, dwell: 5.5}\n"
SET = ("metrics.settling_radius=0.28", "simulation.duration=47")


@pytest.fixture(scope="module")
def run():
    """A run from beside the first of three poses."""
    return podusv.simulate(loaded_pose(BOAT + WAY + LAW, LIMITS, "start.x=0.3", *SET))


def test_metrics_of_poses_are_those_of_a_plain_loop(run):
    square = largest = circle = 0.0
    corners, inside = [], None
    arrived = {0.0: 5.5, 14.5: 20.0, 29.0: 1e9}  # s, and until when the target stays
    time, step = run["time"], 0.02
    for i in range(len(time)):
        off = run["psi"][i] - run["heading_d"][i]
        off -= 2.0 * math.pi * round(off / (2.0 * math.pi))
        square += off * off * step * (0.5 if i in (0, len(time) - 1) else 1.0)
        largest = max(largest, abs(off))
    for begin, end in arrived.items():
        inside = None
        for i, t in enumerate(time):
            if begin - 1e-9 <= t <= end + 1e-9:
                z = math.hypot(run["x"][i] - run["x_d"][i], run["y"][i] - run["y_d"][i])
                circle = max(circle, z)
                inside = (t if inside is None else inside) if z <= 0.28 else None
        corners.append(inside - begin)
    assert run.metrics["heading_rms"] == pytest.approx(math.sqrt(square / time[-1]), rel=1e-9)
    assert run.metrics["heading_max"] == pytest.approx(largest, rel=1e-12)
    assert run.metrics["watch_circle"] == pytest.approx(circle, rel=1e-9)
    assert run.metrics["corner_time"] == pytest.approx(max(corners), abs=1e-9)
    assert max(corners) > 1.0


def test_metrics_of_the_sway_force_are_those_of_a_plain_loop(run):
    weights = np.full(len(run["time"]), 0.02)
    weights[[0, -1]] *= 0.5
    assert run.metrics["peak_tau_v"] == np.abs(run["tau_v_cmd"]).max()
    assert run.metrics["effort_v"] == pytest.approx((weights * run["tau_v"] ** 2).sum(), rel=1e-9)
    late = run["time"] >= 0.8 * 47 - 1e-9
    moved = np.abs(np.diff(run["tau_v_cmd"][late])).sum()
    assert run.metrics["tv_tau_v"] == pytest.approx(moved, rel=1e-9)
    for axis, limit in (("u", 3.0), ("v", 1.5), ("r", 2.0)):
        used = (weights * np.abs(run[f"tau_{axis}"])).sum() / limit / 47.0
        assert run.metrics[f"thrust_use_{axis}"] == pytest.approx(used, rel=1e-9)


def test_the_use_of_thrusters_is_that_of_a_plain_loop():
    pods = "actuator={kind: pod, preset: cybership2_thrusters, sway_weight: 1.0}"
    run = podusv.simulate(loaded_pose(BOAT + WAY + LAW, pods, "start.x=0.3", *SET))
    full, used = 2 * 5.10256e-3 * 33.0**2 + 1.56822e-4 * 33.0**2, 0.0
    for i, thrusts in enumerate(run["thrust"]):
        weight = 0.01 if i in (0, len(run["time"]) - 1) else 0.02
        used += weight * sum(abs(T) for T in thrusts) / full / 47.0
    assert run.metrics["thrust_use"] == pytest.approx(used, rel=1e-9)
    assert 0.01 < used < 0.5
    assert "thrust_use_u" not in run.metrics


def test_a_run_begins_with_what_holds_a_pose(run):
    """Watch circle, heading, time to a pose, use of each force; then what other runs begin with."""
    own = ["watch_circle", "heading_rms", "corner_time"]
    use = [f"thrust_use_{axis}" for axis in "uvr"]
    rows = [m.name for m in headlines_first(METRICS) if m.name in run.metrics]
    assert rows[:6] == [*own, *use]
    assert rows[6] == "settling_time"


def test_a_pose_that_is_left_outside_the_radius_was_never_reached():
    far = loaded_pose(BOAT + WAY + LAW, LIMITS, "start.x=3.0", *SET)
    assert math.isnan(podusv.simulate(far).metrics["corner_time"])


def test_without_limits_there_is_no_part_of_them():
    run = podusv.simulate(loaded_pose(BOAT + WAY + LAW))
    assert "thrust_use_u" not in run.metrics
    assert run.metrics["watch_circle"] == 0.0
