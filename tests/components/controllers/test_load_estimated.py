"""Loads that an estimator finds, fed forward by laws of poses: Fossen and Strand's output feedback.

T. I. Fossen and A. Grovlen, IEEE Trans. Control Systems Technology 6 (1998), feed the bias estimate
of an observer forward in place of an integral.
"""

import numpy as np
import pytest
from conftest import vessel
from pose_samples import BOAT, loaded_pose, marched

import podusv
from podusv_cli.core.errors import ScenarioError
from podusv_cli.theory.loop_margins import loop_margins

SEEN = """
measurement:
  kind: sensors
  position: {period: 0.2, noise: 0.0}
  heading: {period: 0.1, noise: 0.0}
  velocity: null
  yaw_rate: null
estimator: {kind: passive_observer, T_b: 1.0e9}
"""
TASK = BOAT + SEEN + "path: {kind: hold, psi: 0.7}\n"
LAWS = {
    "pid": "controller: {kind: pose_pid, integral: 0.0, load: estimated}\n",
    "backstepping": "controller: {kind: pose_backstepping, load: estimated}\n",
    "sliding": "controller: {kind: pose_sliding_mode, load: estimated}\n",
}
CURRENT = "disturbance={kind: current, speed: 0.1, direction: 2.0}"
LONG = "simulation={step: 0.02, duration: 200.0}"


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("change", ["control.period=0.0", "control.period=0.14"])
def test_a_constant_load_is_cancelled_without_an_integral(law, change):
    changes = (CURRENT, LONG, "start.psi=0.7", change)
    fed = marched(TASK + LAWS[law], *changes)
    alone = marched(TASK + LAWS[law], "controller.load=unknown", *changes)
    assert fed["z_e"][-1] < 1e-7
    assert abs(fed["psi"][-1] - 0.7) < 1e-7
    assert alone["z_e"][-1] > 0.01
    c, s = np.cos(0.7), np.sin(0.7)
    load = (c * fed["b_u"][-1] - s * fed["b_v"][-1], s * fed["b_u"][-1] + c * fed["b_v"][-1])
    found = (fed["b_est_x"][-1], fed["b_est_y"][-1])
    np.testing.assert_allclose(found, load, rtol=1e-5)


def test_a_load_that_is_forgotten_leaves_the_error_of_the_algebra():
    """At rest b_est = T_b K_3 e and b = b_est + (K_4 + K_2 d) e, of which the law lacks b - b_est.

    The law sees u_est = -K_2 e and balances that load with K_p x_est + K_d u_est, and x is ahead of
    x_est by e - K_11 e.
    """
    hull = vessel("cybership2_linear")
    pushed = ("disturbance={kind: step, b_u: 0.5}", "path.psi=0.0", "start.psi=0.0", LONG)
    often = ("measurement.position.period=0.02", "measurement.heading.period=0.02")
    told = ("vessel.preset=cybership2_linear", "estimator={kind: passive_observer, T_b: 300.0}")
    log = marched(TASK + LAWS["pid"], *pushed, *told, *often)
    force = 8.0 * 2.0 * (hull.m11 + hull.m22) / 2.0
    e = 0.5 / (300.0 * 0.25 * force + force - 8.0 * hull.X_u)
    lacking = 0.5 - 300.0 * 0.25 * force * e
    notch = 2.0 * (1.0 - 0.1) * 8.0 / 6.0
    x = (lacking + 2.0 * 0.5 * hull.m11 * 8.0 * e) / (hull.m11 * 0.5**2) + e * (1.0 + notch)
    assert log["x"][-1] == pytest.approx(x, rel=0.01)
    assert log["b_est_x"][-1] == pytest.approx(0.5 - lacking, rel=1e-5)


def test_the_demand_is_that_of_the_law_less_the_estimated_load():
    """Pose PD once more, from what the log has of the estimate, at turned headings."""
    way = "path={kind: poses, poses: [[0, 0, 0.7], [2, -1, 2.4]], travel: 9.0, dwell: 2.0}"
    log = marched(TASK + LAWS["pid"], CURRENT, way, "start.psi=0.7", "simulation.duration=14")
    hull = vessel("cybership2")
    m = np.diag([hull.m11, hull.m22, hull.m33])
    M = np.array([[hull.m11, 0, 0], [0, hull.m22, hull.m23], [0, hull.m32, hull.m33]])
    D = -np.array([[hull.X_u, 0, 0], [0, hull.Y_v, hull.Y_r], [0, hull.N_v, hull.N_r]])
    W = np.diag([0.5, 0.5, 1.0])
    speeds = np.gradient(np.stack([log["x_d"], log["y_d"], log["heading_d"]]), 0.02, axis=1)
    growth = np.gradient(speeds, 0.02, axis=1)
    for i in range(10, len(log["time"]) - 10, 37):
        eta, nu = ([log[f"{n}_est"][i] for n in names] for names in (("x", "y", "psi"), "uvr"))
        c, s = np.cos(eta[2]), np.sin(eta[2])
        R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        aim = np.array([log["x_d"][i], log["y_d"][i], log["heading_d"][i]])
        nu_d = R.T @ speeds[:, i]
        load = np.array([log["b_est_x"][i], log["b_est_y"][i], log["b_est_psi"][i]])
        tau = -R.T @ (m @ W @ W @ (eta - aim) + load) - 2 * m @ W @ (nu - nu_d)
        tau += M @ R.T @ growth[:, i] + D @ nu_d
        given = [log["tau_u_cmd"][i], log["tau_v_cmd"][i], log["tau_r_cmd"][i]]
        np.testing.assert_allclose(given, tau, atol=2e-3)
        assert np.abs(load).max() > 1e-3 or i < 100


@pytest.mark.parametrize(
    "change",
    [
        ("measurement.kind=exact", "estimator.kind=none"),
        ("measurement={kind: sensors}", "estimator.kind=none"),
        ("measurement={kind: sensors}", "estimator={kind: ekf, bias: false}"),
    ],
)
def test_without_an_estimated_load_the_law_is_refused(change):
    with pytest.raises(ScenarioError) as error:
        loaded_pose(TASK + LAWS["pid"], *change)
    assert "pose_pid wants an estimated load, and nothing finds one; take" in str(error.value)


def test_an_ekf_finds_the_load_too_and_margins_leave_it_out():
    fed = marched(TASK + LAWS["pid"], CURRENT, "start.psi=0.7", LONG, "estimator={kind: ekf}")
    assert fed["z_e"][-1] < 1e-3
    plan = loaded_pose(TASK + LAWS["pid"]).plan()
    assert "the feedforward of the estimated load" in loop_margins(plan.loop, plan.grid).left_out


def test_runs_side_by_side_have_the_bits_that_they_have_alone():
    single = loaded_pose(TASK + LAWS["pid"], CURRENT)
    gains = {"controller.w_x": np.linspace(0.3, 0.7, 9)}
    one, other = (podusv.simulate_many(single, gains, side_by_side=lanes) for lanes in (1, 0))
    np.testing.assert_array_equal(one["iae"], other["iae"])
