"""The plug-in of examples/nmpc: what it predicts and plans, and runs with it."""

import shutil
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest
from command_samples import ROOT
from conftest import NONLINEAR

from podusv_cli.components.paths.circle import Circle
from podusv_cli.components.paths.line import Line
from podusv_cli.core.kernel import bundle
from podusv_cli.storage.run_folder import open_run

EXAMPLE = ROOT / "examples/nmpc"
pytest.importorskip("casadi", reason="CasADi is not installed: podusv[optimum]")
spec = spec_from_file_location("nmpc", EXAMPLE / "nmpc.py")
nmpc = sys.modules.setdefault("nmpc", module_from_spec(spec))
spec.loader.exec_module(nmpc)
K = bundle(nmpc.Nmpc(steps=10).constants_with(NONLINEAR))
CALM = np.zeros(3)


@pytest.mark.parametrize("path", [Line(course=0.4), Line(speed=0.0), Circle(radius=5.0)])
def test_the_target_is_predicted_along_lines_and_circles(path):
    now, *later = path.targets([3.0 + K.step * i for i in range(11)])
    np.testing.assert_allclose(nmpc.predicted(now, K).T, np.array(later)[:, :2], atol=1e-12)


def test_a_plan_towards_a_far_target_is_full_thrust_whatever_was_planned_before():
    plan = nmpc.planner(K)
    there = np.tile([[50.0], [0.0]], 10)
    first, solved = plan(np.zeros(6), np.zeros(20), CALM, there)
    assert solved
    np.testing.assert_allclose(first[:-2:2], 8.0, rtol=1e-3)
    assert first[-2] == pytest.approx(8.0, rel=0.01)  # moves the end of the plan only
    assert abs(first[1::2]).max() < 0.05
    plan(np.ones(6), np.ones(20), np.ones(3), -there)
    np.testing.assert_array_equal(plan(np.zeros(6), np.zeros(20), CALM, there)[0], first)


def test_a_load_is_carried_where_the_target_stands_still():
    b = np.array([2.0, 0.0, 0.5])
    last = np.tile(-b[[0, 2]], 10)  # what held it against this load
    demand, solved = nmpc.planner(K)(np.zeros(6), last, b, np.zeros((2, 10)))
    assert solved
    np.testing.assert_allclose(demand[:2], [-2.0, -0.5], atol=0.02)


def test_the_example_runs_and_repeats_itself(podusv):
    shutil.copytree(EXAMPLE, "nmpc")
    words = ("--set", "simulation.duration=0.3", "--set", "metrics.windows={}", "--no-figures")
    said = podusv("run", "nmpc/nmpc.yaml", "--controller", "nmpc", *words, "--out", "one")
    assert said.code == 0, said.err
    log = open_run(Path("one")).recording
    assert log["unsolved"][-1] == 0.0
    assert abs(log["tau_r_cmd"]).max() <= 2.5
    assert log["tau_u_cmd"] == pytest.approx(8.0, rel=1e-3)  # the target is far away
    assert podusv("rerun", "one", "--trust").code == 0


def test_as_machine_code_it_is_refused_in_a_sentence(podusv):
    shutil.copytree(EXAMPLE, "nmpc")
    said = podusv(
        "run", "nmpc/nmpc.yaml", "--controller", "nmpc", "--set", "simulation.compiled=true"
    )
    assert said.code == 2
    assert "cannot become machine code" in said.err
