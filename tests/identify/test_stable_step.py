"""The step of the filter along a log: short enough for a hull that brakes yaw hard."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from identify_samples import LOGS

import podusv
from benchmarks import plain_logs
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.identify import intake
from podusv_cli.identify.fit.problem import FitProblem
from podusv_cli.identify.intake import logs_of, stable_step
from podusv_cli.identify.logs.reading import LogTable
from podusv_cli.scenario.identify import Identify, LogFile

# An Otter with a third of the moment of inertia, whose damping of yaw is many times as large.
NUMBERS = plain_logs.GUESSED | {"m33": 12.0, "N_rr": -6000.0, "m23": 0.0}
OTTER = plain_logs.PlainBoat(NUMBERS, plain_logs.TWO)
SECTIONS = {
    "vessel": {"preset": "otter"},
    "path": {"kind": "line", "speed": 0.0},
    "disturbance": {"kind": "none"},
    "controller": {"kind": "pid"},
    "actuator": {"kind": "pod", "preset": "otter"},
    "identify": Identify(logs=LOGS, free=("N_rr",)),
}


def spinning(seconds=30.0, **columns):
    """A log of a boat that turns at 0.3 rad/s, at 5 Hz."""
    times = np.arange(0.0, seconds, 0.2)
    still = {"x": 0.0 * times, "y": 0.0 * times, "psi": np.remainder(0.3 * times, 2.0 * math.pi)}
    return LogTable("spinning", times, still | columns)


@pytest.mark.parametrize("columns", [{}, {"r": np.full(150, 0.3)}])
def test_a_variance_decays_by_half_a_unit_in_it(columns):
    """By hand: 2 (20 + 2 . 100 . 0.3)/40 = 4 a second, of which 0.125 s are 0.5."""
    hull = Vessel(
        **{"length": 2.0, "beam": 1.0, "m": 50.0, "I_z": 40.0, "X_u": -10.0, "Y_v": -10.0},
        **{"N_r": -20.0, "N_rr": -100.0},
    )
    assert stable_step(spinning(**columns), hull) == pytest.approx(0.125, rel=1e-6)
    weak = hull.changed({"N_r": 0.0, "N_rr": 0.0})  # surge: 2 . 10/50
    assert stable_step(spinning(**columns), weak) == pytest.approx(1.25, rel=1e-6)


def known(hull):
    """The hull of a plain boat."""
    own = {n: number for n, number in NUMBERS.items() if n[0] in "XYN"}
    own |= {"X_udot": hull.m - NUMBERS["m11"], "Y_vdot": hull.m - NUMBERS["m22"], "x_g": 0.0}
    return hull.changed(own | {"N_rdot": hull.I_z - NUMBERS["m33"], "Y_rdot": 0.0, "N_vdot": 0.0})


def test_the_filter_of_a_boat_that_brakes_yaw_hard_stays_finite(tmp_path, monkeypatch):
    """With rows of 0.2 s in steps of 0.05 s a variance decays by more than RK4 bears."""
    rng = np.random.default_rng(3)
    parts = plain_logs.steps_of(rng, (-0.2, -0.2), (1.0, 1.0), 4.0)
    top = plain_logs.TWO[0].top
    motion = plain_logs.sail(OTTER, lambda t: [top * p for p in parts(t)], 40.0, plain_logs.Sea())
    columns = plain_logs.log_columns(motion, plain_logs.Sensors(row=0.2), rng)
    path = tmp_path / "otter.csv"
    pd.DataFrame(plain_logs.columns_of(columns, "shaft speeds")).to_csv(path, index=False)
    scenario = podusv.Scenario(name="otter", **SECTIONS)
    scenario = scenario.model_copy(update={"vessel": known(scenario.vessel)})

    def value():
        """-2 log of the posterior of the true hull."""
        logs = logs_of(path, LogFile(file=path.name, delay=0.0), scenario)
        given = FitProblem(scenario, scenario.identify, logs)
        return given.search.values([np.zeros(len(given.numbers))])[0]

    assert np.isfinite(value())
    monkeypatch.setattr(intake, "stable_step", lambda log, hull: math.inf)
    assert not np.isfinite(value())


def test_a_hull_that_does_not_brake_asks_for_no_step():
    hull = Vessel(length=2.0, beam=1.0, m=50.0, I_z=40.0)
    assert stable_step(spinning(), hull) == math.inf
