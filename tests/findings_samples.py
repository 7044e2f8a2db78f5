"""Scenarios from overrides of the corrected one, their findings, and their runs."""

from functools import lru_cache

import numpy as np
from conftest import PACKAGE

from podusv_cli.core.finding import Finding
from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording
from podusv_cli.findings.finding import preflight
from podusv_cli.process.extras import Extras
from podusv_cli.scenario.case import Case
from podusv_cli.scenario.load import load
from podusv_cli.scenario.model import Scenario
from podusv_cli.workflows import execute

CONFIGS = PACKAGE.parent / "configs" / "mu_2017"
PLAIN = ("path={kind: line}", "actuator={kind: ideal}", "simulation.duration=20")
# No adaptation, calm water: the bare linear loops.
BARE = (
    "controller.Gamma_u=0",
    "controller.Gamma_r=0",
    "controller.gamma_u=0",
    "controller.gamma_r=0",
    "disturbance={kind: none}",
)


def scene(*overrides: str) -> Scenario:
    """The corrected scenario on a line, without limits, for 20 s, with these overrides."""
    return load(CONFIGS / "corrected.yaml", (*PLAIN, *overrides)).scenario


def codes(*overrides: str) -> set[str]:
    """Codes of the findings about that scenario."""
    return {finding.code for finding in preflight(scene(*overrides))}


def finding(code: str, *overrides: str) -> Finding:
    """The first finding of that code."""
    return next(f for f in preflight(scene(*overrides)) if f.code == code)


@lru_cache(maxsize=3)  # a recording takes up to 40 MB, which every process started after it copies
def simulated(*overrides: str) -> tuple[Recording, dict[str, float]]:
    """The run of that scenario, and its metrics."""
    case = Case.of(scene(*overrides).alone())
    recording = execute.simulate_case(case, execute.Stopwatch())
    return recording, execute.summary(case, recording, Extras())


def log(*overrides: str) -> Recording:
    """The run of that scenario."""
    return simulated(*overrides)[0]


def late(signal: str, *overrides: str) -> Vector:
    """A signal over the last third of the run; raises where the run did not finish."""
    out = log(*overrides)
    assert out.status == "finished", out.message
    return np.asarray(out[signal][2 * len(out["time"]) // 3 :])
