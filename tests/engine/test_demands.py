"""The engine carries as many demands as `core.signal.DEMAND` has: here a sway force, too."""

from __future__ import annotations

import subprocess
import sys
import textwrap

import numpy as np
import pytest

# A program of its own, as kernels know how many demands there are when they are imported.
PROGRAM = """
from typing import Literal

import numpy as np
from podusv_cli.core import signal

SWAY = signal.Signal("tau_v_cmd", "N", "sway force that the law asked for")
signal.DEMAND, signal.LOOP = (*signal.DEMAND, SWAY), (*signal.LOOP, SWAY)

from dataclasses import replace

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.components.controllers.base import Controller
from podusv_cli.core.kernel import kernel
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.check import check_law
from podusv_cli.engine.running.simulate import run
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.testing import loop_with


class Thrusters(Actuator):
    kind: Literal["thrusters"] = "thrusters"

    @staticmethod
    @kernel
    def drive(demand, tau):
        tau[0], tau[1], tau[2] = demand[0], demand[2], demand[1]


class Sideways(Controller):
    kind: Literal["sideways"] = "sideways"

    @staticmethod
    @kernel
    def law(t, x, tau):
        tau[0], tau[1], tau[2] = 1.0 + t, 2.0 - t, 3.0 * t - x[4]

    def start(self, x, target, nominal):
        return np.zeros(0)


for options, hold in CASES:
    loop = replace(loop_with(Thrusters(**options)), controller=Sideways())
    plan = Plan(loop, TimeGrid(0.1, 20, hold_every=hold))
    check_law(plan)
    log = run(plan, compiled=False)
    assert log.status == "finished", log.message
    for name in ("tau_u", "tau_r", "tau_v"):
        print(*log[name + "_cmd"], *log[name])
"""
LATE = {"command": {"delay": 0.3}}
OPTIONS = ({}, LATE, {**LATE, "failure": {"time": 1.0, "effectiveness": 0.25}})
CASES = [(options, hold) for options in OPTIONS for hold in (0, 5)]


@pytest.fixture(scope="module")
def logged():
    """Demands asked for and got, shape (case, demand, 2, instant), all from one program."""
    program = textwrap.dedent(PROGRAM).replace("CASES", repr(CASES))
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return np.loadtxt(done.stdout.splitlines()).reshape(len(CASES), 3, 2, -1)


@pytest.mark.parametrize("case", range(len(CASES)))
def test_a_third_demand_is_held_delayed_and_lost_like_the_others(logged, case):
    options, hold = CASES[case]
    late = 3 if "command" in options else 0
    asked, got = logged[case].transpose(1, 0, 2)
    expected = np.zeros_like(asked)
    expected[:, late:] = asked[:, : asked.shape[1] - late]
    expected[:, 10:] *= 0.25 if "failure" in options else 1.0
    np.testing.assert_array_equal(got, expected)
    assert len(np.unique(asked[2])) == (5 if hold else 21)
