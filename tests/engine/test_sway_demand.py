"""A third demand, a sway force, and a path with a heading, in scenarios and sessions."""

import numpy as np
import pytest
from conftest import vessel
from pose_samples import BOAT, HELD, POSES, marched, quintic

from podusv_cli.core.errors import ScenarioError, UsageError
from podusv_cli.interface.session import open_session
from podusv_cli.scenario.load import load_text


def test_a_law_of_two_demands_leaves_the_sway_force_0():
    """The same bits as behind the actuator that has none."""
    task = "path: {kind: circle}\ncontroller: {kind: velocity_vector}\n"
    full, two = marched(BOAT + task), marched(BOAT + task, "actuator.kind=ideal")
    assert not full["tau_v_cmd"].any()
    assert not full["tau_v"].any()
    for name in two.signals:
        np.testing.assert_array_equal(two[name], full[name], err_msg=name)


def test_limits_cut_each_load_by_itself():
    limits = "saturated_full, surge_limit: 50.0, yaw_limit: 50.0, sway_limit: 0.03"
    log = marched(BOAT.replace("ideal_full", limits) + POSES + HELD, "start.y=0.4")
    assert np.abs(log["tau_v"]).max() == 0.03 < np.abs(log["tau_v_cmd"]).max()
    for free in ("tau_u", "tau_r"):
        np.testing.assert_array_equal(log[free], log[f"{free}_cmd"])
    np.testing.assert_array_equal(log["saturated"] == 1.0, log["tau_v"] != log["tau_v_cmd"])


REFUSED = {
    "actuator.kind=saturated": "asks for a sway force, and saturated takes surge force and yaw "
    "moment alone; take ideal_full, saturated_full, or pods that push every way with sway_weight "
    "above 0",
    "path={kind: circle}": "wants a heading, and circle has none; take poses, stations, hold or "
    "ellipse",
}


@pytest.mark.parametrize("change", REFUSED)
def test_what_does_not_fit_is_refused_with_the_remedy(change):
    with pytest.raises(ScenarioError) as error:
        load_text(BOAT + POSES + HELD, "s.yaml", (change,))
    assert REFUSED[change] in " ".join(str(error.value).split())


THREE = BOAT.replace("ideal_full", "saturated_full") + POSES + "controller: {kind: pose_pid}\n"


@pytest.fixture
def waiting(tmp_path):
    """A session that waits for three demands at a time."""
    (tmp_path / "s.yaml").write_text(THREE)
    return open_session(tmp_path / "s.yaml", period=0.1)


def test_a_session_takes_three_demands_and_shows_heading_and_target(waiting, tmp_path):
    for k in range(30):
        seen = waiting.step((0.5, -0.01 * k, 0.02 * k))
    place, speed, growth = quintic(3.0, (0, 0, 0.2), (2, 1, 1.0))
    assert seen.target[:4] == pytest.approx([*place[:2], *speed[:2]], abs=1e-12)
    assert seen.heading == pytest.approx([place[2], speed[2], growth[2]], abs=1e-12)
    assert waiting.log["tau_v_cmd"][::5] == pytest.approx(0.02 * np.arange(30))
    log = waiting.log
    run = waiting.close(tmp_path / "kept", figures=False)
    for name, numbers in log.items():
        np.testing.assert_array_equal(run[name][: len(numbers)], numbers, err_msg=name)


@pytest.mark.parametrize(
    "demand", [(0.5, 0.1), (0.5, 0.1, float("nan")), (1.0, 2.0, 3.0, 4.0), 1.0]
)
def test_a_session_behind_three_loads_refuses_what_is_no_demand(waiting, demand):
    with pytest.raises(UsageError, match=r"three finite numbers, tau_u \[N\], tau_r \[N m\] and t"):
        waiting.step(demand)
    assert waiting.observe().time == 0.0


def test_a_law_by_hand_in_a_session_is_the_law_of_the_run(waiting):
    """Pose PID without integral, written once more, from what a session shows alone."""
    hull = vessel("cybership2")
    m = np.diag([hull.m11, hull.m22, hull.m33])
    M = np.array([[hull.m11, 0, 0], [0, hull.m22, hull.m23], [0, hull.m32, hull.m33]])
    D = -np.array([[hull.X_u, 0, 0], [0, hull.Y_v, hull.Y_r], [0, hull.N_v, hull.N_r]])
    W = np.diag([0.5, 0.5, 1.0])
    seen = waiting.observe()
    while seen.status == "running":
        place = np.append(seen.target[:2], seen.heading[0])
        speed, growth = (np.append(seen.target[i : i + 2], seen.heading[i // 2]) for i in (2, 4))
        c, s = np.cos(seen.state[2]), np.sin(seen.state[2])
        R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        nu_d = R.T @ speed
        u, v, r = (
            -R.T @ m @ W @ W @ (seen.state[:3] - place)
            - 2 * m @ W @ (seen.state[3:] - nu_d)
            + M @ R.T @ growth
            + D @ nu_d
        )
        seen = waiting.step((u, r, v))
    run = marched(THREE, "control.period=0.1", "controller.integral=0.0")
    for name in ("x", "y", "psi", "tau_v"):
        # At the very end a session holds its last demand, and a run samples once more.
        np.testing.assert_allclose(waiting.log[name][:-1], run[name][:-1], atol=1e-9, err_msg=name)


def test_an_environment_behind_three_loads_has_three_actions_and_a_heading(tmp_path):
    gym = pytest.importorskip("podusv.gym")
    (tmp_path / "s.yaml").write_text(THREE)
    given = {"period": 0.1, "observe": lambda now: [now.heading[0] - now.state[2], *now.seen[:2]]}
    env = gym.Env(tmp_path / "s.yaml", **given)
    np.testing.assert_array_equal(env.action_space.high, [2.0, 1.5, 2.0])
    seen, _ = env.reset(seed=0)
    assert seen == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    many = gym.VectorEnv(tmp_path / "s.yaml", count=3, **given)
    many.reset(seed=[0, 0, 0])
    for k in range(20):
        action = (0.3, 0.02 * k, -0.05 * k)
        one, *_ = env.step(action)
        all_three, *_ = many.step(np.array([action] * 3))
        np.testing.assert_array_equal(all_three, [one] * 3)
    with pytest.raises(UsageError, match="3 rows of three finite numbers"):
        many.step(np.zeros((3, 2)))
    with pytest.raises(UsageError, match=r"limits=\(8.0, 2.5, 4.0\)"):
        gym.Env(tmp_path / "s.yaml", period=0.1, limits=(8.0, 2.5))
