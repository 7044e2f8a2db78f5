"""Margins of laws of poses: algebra of the loops at rest, simulated delays, what is refused."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from conftest import vessel
from pose_samples import BOAT, loaded_pose, marched
from scipy.optimize import brentq

from podusv_cli.core.errors import LawError, NotConvergedError
from podusv_cli.theory.loop_margins import LoopMargins, loop_margins

W = {"surge": 0.4, "sway": 0.55, "yaw": 0.9}
GAINS = "w_x: 0.4, w_y: 0.55, w_r: 0.9, zeta: 0.7, integral: 0.13"
TASK = BOAT + "path: {kind: hold, psi: 0.2}\n"
LAWS = {
    "pid": "controller: {kind: pose_pid, w_x: 0.4, w_y: 0.4, w_r: 0.9, zeta: 0.7}\n",
    "backstepping": "controller: {kind: pose_backstepping, k_i: 0.02}\n",
    "sliding": "controller: {kind: pose_sliding_mode}\n",
}


@cache
def of(law: str, *changes: str) -> LoopMargins:
    plan = loaded_pose(TASK + law, *changes).plan()
    return loop_margins(plan.loop, plan.grid)


def by_hand(axis: str, integral: float, psi: float):
    """L(s) of `pose_pid` on a hull at rest at a heading, the other loops closed."""
    hull = vessel("cybership2_linear")
    i = list(W).index(axis)
    M = np.array([[hull.m11, 0, 0], [0, hull.m22, hull.m23], [0, hull.m32, hull.m33]])
    D = -np.array([[hull.X_u, 0, 0], [0, hull.Y_v, hull.Y_r], [0, hull.N_v, hull.N_r]])
    m, w = np.diag(M), np.array([*W.values()])
    c, s = np.cos(psi), np.sin(psi)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])  # gains of positions are north and east

    def response(omega: float) -> complex:
        s = 1j * omega
        earth = np.diag(m * w * w * (1.0 + integral * w / s))
        law = R.T @ earth @ R + np.diag(2 * 0.7 * m * w * s)
        others = np.where(np.arange(3)[:, None] == i, 0.0, law)
        return complex((law @ np.linalg.inv(M * s * s + D * s + others))[i, i])

    return response


@pytest.mark.parametrize("axis", W)
@pytest.mark.parametrize(("integral", "psi"), [(0.13, 0.0), (0.0, 0.0), (0.13, -2.3)])
def test_a_pose_pid_at_rest_has_the_loops_of_its_formula(axis, integral, psi):
    """Without integral its three memories grow for ever in a load, and are no poles."""
    law = f"controller: {{kind: pose_pid, {GAINS}}}\n"
    turned = (f"path.psi={psi}", f"start.psi={psi}", "vessel.preset=cybership2_linear")
    loop = of(law, *turned, f"controller.integral={integral}")
    measured, response = loop.loops[axis], by_hand(axis, integral, psi)
    assert len(loop.poles) == (9 if integral else 6)
    omega = brentq(lambda w: abs(response(w)) - 1.0, 0.3, 6.0)
    assert measured.crossovers[-1] == pytest.approx(omega, rel=1e-6)
    phase = np.angle(-response(omega))
    assert measured.phase_margin == pytest.approx(phase, rel=1e-6)
    assert measured.delay_margin == pytest.approx(phase / omega, rel=1e-6)
    some = measured.omega[::40]
    S = [abs(1.0 / (1.0 + response(w))) for w in some]
    np.testing.assert_allclose(measured.S[::40], S, rtol=1e-5)


def test_the_loops_of_backstepping_do_not_depend_on_the_heading():
    numbers = [
        of(LAWS["backstepping"], f"path.psi={psi}", f"start.psi={psi}").numbers()
        for psi in (0.2, -2.3)
    ]
    assert numbers[0] == pytest.approx(numbers[1], rel=1e-5)


def growth(law: str, delay: float) -> float:
    """Rate [1/s] at which an oscillation grows in a run with a delayed command."""
    log = marched(
        TASK + LAWS[law],
        f"actuator.command={{delay: {delay}}}",
        "simulation={step: 0.005, duration: 80.0}",
        "start={x: 1e-4, y: -1e-4, psi: 0.2001}",
    )
    swing = np.gradient(log["v"], log["time"])
    late = [np.std(part) for part in np.array_split(swing, 4)[2:]]
    return float(np.log(late[1] / late[0]) / 20.0)


@pytest.mark.parametrize("law", LAWS)
def test_simulated_demands_may_be_late_by_the_delay_margin(law):
    margin = of(LAWS[law]).delay_margin
    rates = [growth(law, 0.005 * round(part * margin / 0.005)) for part in (0.96, 1.04)]
    assert rates[0] < 0.0 < rates[1], (margin, rates)


@pytest.mark.long
def test_a_law_of_two_demands_has_two_loops_behind_a_full_actuator():
    task = BOAT + "path: {kind: line}\ncontroller: {kind: velocity_vector}\n"
    plan = loaded_pose(task, "simulation.duration=60").plan()
    assert [*loop_margins(plan.loop, plan.grid).loops] == ["surge", "yaw"]


POSES = "path: {kind: poses, poses: [[0, 0, 0], [0, 0, 1]], travel: 9, dwell: 4}\n"


def test_a_pose_that_is_held_is_steady_and_a_turn_on_the_spot_is_not():
    plan = loaded_pose(BOAT + POSES + LAWS["pid"]).plan()  # 12 s: it turns from 4 s on
    assert loop_margins(plan.loop, plan.grid).linear.course.time <= 3.0
    with pytest.raises(NotConvergedError, match=r"not at t = 8 s.*--set path.kind=hold"):
        loop_margins(plan.loop, plan.grid, 8.0)


@pytest.mark.parametrize(
    ("shape", "error", "why"),
    [
        ("", NotConvergedError, "at no time of the run"),
        (", breadth: 10", LawError, "its target goes in a circle"),
    ],
)
def test_on_an_ellipse_a_law_of_poses_has_no_margins(shape, error, why):
    plan = loaded_pose(BOAT + f"path: {{kind: ellipse, length: 10{shape}}}\n" + LAWS["pid"]).plan()
    with pytest.raises(error, match=f"{why}.*--set path.kind=hold"):
        loop_margins(plan.loop, plan.grid)


def test_the_command_and_claims_have_three_loops(podusv):
    laws = "controllers: {pid: {kind: pose_pid}, two: {kind: velocity_vector}}\n"
    claims = {"yes": "pid.phase_margin_v > 1", "unknown": "two.phase_margin_v > 1"}
    written = [f"  {n}: {{says: a, source: b, expect: {e}}}\n" for n, e in claims.items()]
    Path("a.yaml").write_text(TASK + laws + "claims:\n" + "".join(written))
    said = podusv("margins", "a.yaml", "--controller", "pid", "--out", "m")
    assert said.code == 0
    assert "staying from t = 12 s on" in said.out
    assert "pid  sway load" in said.out
    assert "pid  all demands" in said.out
    assert "phase_margin_v,rad," in Path("m/margins.csv").read_text()
    told = json.loads(podusv("compare", "a.yaml", "--no-figures", "--json", "--out", "c").out)
    verdicts = {claim["claim"]: claim["verdict"] for claim in told["claims"]}
    assert verdicts == {"yes": "reproduced", "unknown": "cannot tell"}
    assert len(told["missing"]) == 1
