"""Runs, a table and verdicts planted by hand, for the tests of what a comparison writes."""

import math

import numpy as np
from known_signals import ABOUT

from podusv_cli.comparison import claims, table
from podusv_cli.comparison.claims import ParsedClaim
from podusv_cli.comparison.expressions import parse
from podusv_cli.core.about import Claim
from podusv_cli.core.past_run import PastRun
from podusv_cli.core.recording import Recording
from podusv_cli.scenario.about import about_of
from podusv_cli.scenario.load import load_text

SCENARIO = """
name: planted
description: What the <test> is for.
vessel: {preset: paper_nonlinear}
path: {kind: line}
disturbance: {kind: harmonic}
actuator: {kind: saturated}
simulation: {duration: 4.0}
controller: {kind: pid}
"""
FRAME = table.table(
    {
        "a": {"iae": 4.0, "law_ns": 10.0, "energy": 0.0},
        "b": {"iae": 2.0, "law_ns": math.nan, "energy": 3.0},
        "c": {"iae": 8.0, "law_ns": 5.0, "energy": 1.0},
        "lost": {},
    }
)


def about(*overrides):
    return about_of(scenario(*overrides))


def scenario(*overrides):
    return load_text(SCENARIO, "a.yaml", overrides).scenario


def past_run(metrics, status="finished", message="", told=None, **more):
    """A run of four rows with these metrics; `told` is what it says about itself."""
    t = np.linspace(0.0, 3.0, 4)
    signals = {"time": t, "x": 2 * t, "x_d": 3 * t, "z_e": t, "u": t}
    log = Recording(status, "pid", signals, message=message, about=ABOUT)
    return PastRun("a", told or about(), log, metrics, **more)


def verdicts():
    runs = {"a": past_run({"iae": 3.0}), "lost": PastRun.without_log("lost", about(), "killed")}
    texts = {
        "C1": "x.iae == 3",
        "C2": "x.iae > 4",
        "C3": "lost.iae < x.iae",
        "C4": "1 / 3 < 0 * x.iae",
    }
    parsed = [
        ParsedClaim(
            name,
            Claim(says="a | <b>", source="here", expect=text, remark="Not <stated>."),
            parse(text, ("x", "lost"), ABOUT),
        ).with_labels({"x": "a", "lost": "lost"})
        for name, text in texts.items()
    ]
    return claims.judge(parsed, runs)
