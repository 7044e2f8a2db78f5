"""Adding a law, path, disturbance, actuator, vessel, metric, figure or finding is one file.

Each is written into a copy of the package; no other file is touched. All commands know it then.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import pytest
import yaml
from conftest import PACKAGE

HEAD = """
from typing import Any, ClassVar, Literal
import numpy as np
from podusv_cli.plugin import Signal, Vector, kernel, value
"""
FILES = {
    # It has neither psi_e nor z_e, a memory with an axis of its own, and tells of a fast loop.
    "components/controllers/cross_track.py": """
from podusv_cli.plugin import Controller, Loop

E_CT = Signal("e_ct", "m", "cross-track error")
MODES = Signal("modes", "m", "amplitudes of the modes", axes=("mode",))
WIDTHS = Signal("widths", "m", "widths of the modes", axes=("mode",), fixed=True)


class CrossTrack(Controller):
    \"\"\"Holds the target's course.\"\"\"

    kind: Literal["cross_track"] = "cross_track"
    gain: float = value(1.0, "N/m", "gain of the cross-track error")
    signals: ClassVar[tuple[Signal, ...]] = (E_CT,)

    def slots(self):
        return ((MODES, 3),)

    def fixed_signals(self):
        return {WIDTHS: np.ones(3)}

    def start(self, x, target, nominal):
        return np.zeros(3)

    def velocity_loops(self, axes, nu):
        return [Loop("surge", "gain", 0.0, np.array([-self.gain]), np.zeros((0, 1)))]

    @staticmethod
    @kernel
    def law(t, x, memory, target, k, table, tau, rate, signals, work):
        signals[0] = target[1] - x[1]
        tau[0], tau[1] = 1.0, k.gain * signals[0]
        for i in range(3):
            rate[i] = signals[0]
""",
    "components/paths/still.py": """
from podusv_cli.plugin import Path


class Still(Path):
    \"\"\"A buoy.\"\"\"

    kind: Literal["still"] = "still"
    north: float = value(3.0, "m", "where it floats, north")

    @staticmethod
    @kernel
    def evaluate(t, k, table, target):
        for i in range(6):
            target[i] = 0.0
        target[0] = k.north
""",
    "components/disturbances/steady.py": """
from podusv_cli.plugin import Disturbance


class Steady(Disturbance):
    \"\"\"A current that pushes.\"\"\"

    kind: Literal["steady"] = "steady"
    push: float = value(0.1, "N", "force in surge")

    @staticmethod
    @kernel
    def evaluate(t, x, k, table, b):
        b[0], b[1], b[2] = k.push, 0.0, 0.0
""",
    "components/actuators/lagging.py": """
from podusv_cli.plugin import Actuator

BEHIND = Signal("behind", "N", "what the force lags behind the demand")
FORCE = Signal("force", "N", "surge force of the lagging actuator")


class Lagging(Actuator):
    \"\"\"A force that follows with a lag.\"\"\"

    kind: Literal["lagging"] = "lagging"
    lag: float = value(0.5, "s", "time constant", gt=0)
    states = property(lambda self: (FORCE,))
    signals = property(lambda self: (BEHIND,))

    @staticmethod
    @kernel
    def drive(t, x, state, demand, k, table, tau, rate, signals):
        tau[0], tau[1], tau[2] = state[0], 0.0, demand[1]
        signals[0] = demand[0] - state[0]
        rate[0] = signals[0] / k.lag
""",
    "metrics/reach.py": """
from podusv_cli.plugin import Accumulator, Metric, gathered


@kernel
def watch(t, weight, s, row, k, seen):
    seen[0] = max(seen[0], abs(s[1]))
    seen[1] += weight * k.reach_scale


OF = Accumulator(watch, lambda layout: 2, lambda layout: {"reach_scale": 2.0})
reach = Metric("reach", "m", "largest distance east", OF, gathered(0))
twice = Metric("twice", "s", "twice the run", OF, gathered(1))
""",
    "figures/cross.py": """
from podusv_cli.plugin import figure, signals_over_time

cross = figure("cross", caption="cross-track error", signals=("e_ct",))(signals_over_time("e_ct"))
""",
    "findings/lazy.py": """
from podusv_cli.plugin import warn_after_run, warn_before_run


@warn_before_run("lazy-law", about="controller", meaning="the gain is small")
def lazy(case):
    if getattr(case.scenario.controller, "gain", 9.0) < 2.0:
        yield "the gain is small"


@warn_after_run("far-off", about="path", meaning="the cross-track error is large")
def far_off(scenario, log):
    if "e_ct" in log and abs(log["e_ct"]).max() > 0.5:
        yield f"e_ct reaches {abs(log['e_ct']).max():.2g} {log.about['e_ct'].unit}"
""",
}
SCENARIO = """
vessel: {preset: barge}
path: {kind: still}
disturbance: {kind: steady}
actuator: {kind: lagging}
controller: {kind: cross_track}
controllers: {one: {gain: 1.0}, other: {gain: 3.0}, pid: {kind: pid}}
start: {y: 1.0}
simulation: {duration: 0.5, compiled: false}
claims:
  C1:
    says: it drifts
    source: here
    expect: max(abs(one.e_ct)) > 0.5 and one.reach > 0.5
    tolerance: 0.0
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a copy of the package that has one file more of each kind."""
    folder = tmp_path_factory.mktemp("extended")
    copy = folder / "podusv_cli"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    for name, text in FILES.items():
        assert not (copy / name).exists()
        (copy / name).write_text(HEAD + text)
    barge = yaml.safe_load((copy / "components/vessels/paper_nonlinear.yaml").read_text()) | {
        "m": 40.0
    }
    (copy / "components/vessels/barge.yaml").write_text(yaml.safe_dump(barge))
    (folder / "a.yaml").write_text(SCENARIO)
    return folder


def podusv(place: Path, *words: str, code: int = 0) -> str:
    """What a command of the extended package prints."""
    done = subprocess.run(
        [sys.executable, "-m", "podusv_cli", *words],
        cwd=place,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(place), "COLUMNS": "100"},
        timeout=300,
    )
    assert done.returncode == code, done.stderr
    return done.stdout + done.stderr


@pytest.mark.slow
def test_every_command_knows_what_one_file_brings(place):
    said = podusv(place, "run", "a.yaml", "--json", "--out", "r", "-q", "--no-figures")
    run, _ = json.JSONDecoder().raw_decode(said)
    codes = {finding["code"] for finding in run["warnings"]}
    assert {"lazy-law", "far-off"} <= codes
    with h5py.File(place / "r/log.h5") as log:
        assert run["metrics"]["reach"] == abs(log["y"][...]).max()
        assert run["metrics"]["twice"] == pytest.approx(1.0)
        assert log["modes"].shape == (51, 3)
        assert log["widths"].shape == (3,)
        assert (log["e_ct"].attrs["units"], log["e_ct"].attrs["symbol"]) == (b"m", b"e_{ct}")
        assert log["z_e"].shape == log["behind"].shape == log["force"].shape == (51,)
        assert "psi_e" not in log

    said = podusv(place, "compare", "a.yaml", "--out", "c", "--no-figures")
    assert "reproduced" in said
    podusv(place, "plot", "c", "--figure", "cross", "--format", "svg", "--out", "p")
    assert (place / "p/cross.svg").exists()
    podusv(place, "diff", "c/one", "c/other", code=3)


@pytest.mark.slow
def test_everything_is_listed_and_explained(place):
    listed = podusv(place, "list")
    kinds = ("cross_track", "still", "steady", "lagging", "barge")
    for name in (*kinds, "lazy-law", "far-off", "reach"):
        assert f"  {name}" in listed
    assert "cross-track error" in podusv(place, "explain", "e_ct")
    assert "the gain is small" in podusv(place, "explain", "lazy-law")
    assert "lazy-law" in podusv(place, "schema")
