"""A third demand, a sway force, and a path with a heading, in scenarios and sessions."""

import numpy as np
import pytest
from pose_samples import BOAT, HELD, POSES, marched, quintic

from podusv_cli.core.errors import LawError, ScenarioError
from podusv_cli.interface.session import open_session
from podusv_cli.scenario.load import load_text
from podusv_cli.theory.loop_margins import loop_margins


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
    "path={kind: circle}": "wants a heading, and circle has none; take poses, hold or ellipse",
}


@pytest.mark.parametrize("change", REFUSED)
def test_what_does_not_fit_is_refused_with_the_remedy(change):
    with pytest.raises(ScenarioError) as error:
        load_text(BOAT + POSES + HELD, "s.yaml", (change,))
    assert REFUSED[change] in " ".join(str(error.value).split())


def test_margins_of_three_loops_are_refused():
    single = load_text(BOAT + POSES + HELD, "s.yaml").scenario.alone()
    plan = single.plan()
    with pytest.raises(LawError, match="margins are those of two loops"):
        loop_margins(plan.loop, plan.grid)


def test_a_session_behind_three_loads_steps_and_shows_its_target(tmp_path):
    """Its demand has two numbers; the target is written beside a heading, not over it."""
    file = tmp_path / "s.yaml"
    file.write_text(BOAT + POSES + "controller: {kind: velocity_vector}\n")
    session = open_session(file, period=0.1)
    for _ in range(30):
        seen = session.step((0.5, 0.0))
    place, speed, _ = quintic(3.0, (0, 0, 0.2), (2, 1, 1.0))
    assert seen.target[:4] == pytest.approx([*place[:2], *speed[:2]], abs=1e-12)
