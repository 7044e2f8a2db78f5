"""The controller of examples/nmpc: what it knows, predicts and plans, and a run that it steers."""

import runpy
from types import SimpleNamespace

import numpy as np
import pytest
from command_samples import ROOT

import podusv
from podusv_cli.components.paths.circle import Circle
from podusv_cli.components.paths.line import Line
from podusv_cli.core.kernel import bundle
from podusv_cli.optimum.collocation import dynamics
from podusv_cli.workflows import rerun as repeating
from podusv_cli.workflows.request import Request

ca = pytest.importorskip("casadi", reason="CasADi is not installed: podusv[optimum]")
nmpc = SimpleNamespace(**runpy.run_path(str(ROOT / "examples/nmpc/nmpc.py")))
STEPS = 10
TASK = "podusv:laws/rivals.yaml"


@pytest.fixture(scope="module")
def controller():
    """One with a short horizon."""
    return nmpc.Nmpc(podusv.load(TASK), STEPS)


@pytest.fixture(scope="module")
def plan(controller):
    """Its planner."""
    return controller.planned


@pytest.mark.parametrize("preset", ["paper_nonlinear", "otter", "wamv"])
def test_the_vessel_moves_as_podusv_has_it(preset):
    vessel = podusv.load(TASK, {"vessel": {"preset": preset, "coriolis": 0.7}}).nominal
    wanted = dynamics(bundle(vessel.constants()))
    random = np.random.default_rng(3)
    for _ in range(10):
        given = [random.normal(0.0, 1.0, size) for size in (6, 2, 3)]
        rate = ca.evalf(nmpc.rate(vessel, *map(ca.DM, given))).full()
        np.testing.assert_allclose(rate, wanted(*given).full(), rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("path", [Line(course=0.4), Line(speed=0.0), Circle(radius=5.0)])
def test_the_target_is_predicted_along_lines_and_circles(path):
    now, *later = path.targets([3.0 + nmpc.STEP * i for i in range(STEPS + 1)])
    np.testing.assert_allclose(
        nmpc.predicted(now, STEPS), np.array(later)[:, :2], rtol=0.0, atol=1e-12
    )


def test_a_plan_towards_a_far_target_is_full_thrust_whatever_was_planned_before(plan):
    none, calm = np.zeros((STEPS, 2)), np.zeros(3)
    there = np.tile([50.0, 0.0], (STEPS, 1))
    first, solved = plan(np.zeros(6), none, calm, there)
    assert solved
    np.testing.assert_allclose(first[:-1, 0], 8.0, rtol=1e-3)
    assert first[-1, 0] == pytest.approx(8.0, rel=0.01)  # moves the end of the plan only
    assert abs(first[:, 1]).max() < 0.05
    plan(np.ones(6), np.ones((STEPS, 2)), np.ones(3), -there)
    np.testing.assert_array_equal(plan(np.zeros(6), none, calm, there)[0], first)


def test_a_load_is_carried_where_the_target_stands_still(plan):
    load = np.array([2.0, 0.0, 0.5])
    last = np.tile(-load[[0, 2]], (STEPS, 1))  # what held it against this load
    demands, solved = plan(np.zeros(6), last, load, np.zeros((STEPS, 2)))
    assert solved
    np.testing.assert_allclose(demands[0], [-2.0, -0.5], atol=0.02)


def test_the_observer_learns_a_constant_load_as_its_poles_say(controller):
    """With both poles at z, (1 + k (1 - z)) z^k of it is unknown after k samples."""
    state, load, demand = np.zeros(6), np.array([1.0, -0.5, 0.2]), (0.4, 0.1)
    controller.observe(state)
    for k in range(1, 41):
        controller.expect(state, demand)
        state = controller.ahead(state, demand, load, nmpc.PERIOD).full().ravel()
        controller.observe(state)
        unknown = (1.0 + k * (1.0 - nmpc.POLE)) * nmpc.POLE**k
        np.testing.assert_allclose(controller.load, (1.0 - unknown) * load, atol=0.02)


@pytest.mark.long
def test_a_session_that_it_steers_leaves_a_run_that_repeats(tmp_path):
    changes = {"simulation.duration": 3.0, "metrics.windows": {}}
    session = podusv.open_session(TASK, changes, period=nmpc.PERIOD)
    steered = nmpc.steer(session)
    assert steered.unsolved == 0
    run = session.close(tmp_path / "nmpc", figures=False)
    assert run["tau_u_cmd"] == pytest.approx(8.0, rel=1e-3)  # the target is far away
    assert abs(run["tau_r_cmd"]).max() <= 2.5
    assert len(set(run["tau_r_cmd"])) == 30  # it plans anew every period
    loads = [run[name][-1] for name in ("b_u", "b_v", "b_r")]
    np.testing.assert_allclose(steered.load, loads, rtol=0.2)  # which change meanwhile
    assert repeating.rerun(run.folder, Request()).identical
