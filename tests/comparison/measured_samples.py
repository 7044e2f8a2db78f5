"""A short task, logs beside its runs, and what their comparison says."""

import math
from pathlib import Path

from scenario_samples import write

import podusv as p
from podusv_cli.workflows import compare as comparing
from podusv_cli.workflows.request import Request

TASK = """
vessel: {preset: cybership2}
path: {kind: sinusoid, speed: 0.17}
disturbance: {kind: none}
actuator: {kind: ideal}
controllers: {velocity: {kind: velocity_vector}, momentum: {kind: momentum_vector}}
simulation: {duration: 7.9, step: 0.02}
log: {every: 5}
"""
ROWS = [[0.62 * i, 0.1 * i, 0.02 * i, 0.1 + 0.02 * i] for i in range(11)]
METRICS = ("log_distance_rms", "log_distance_max", "log_heading_rms", "log_instants")


def log(name, head, rows):
    """A CSV file; NaN is an empty cell."""
    lines = [",".join("" if math.isnan(x) else f"{x:.17g}" for x in row) for row in rows]
    write(name, "\n".join([head, *lines, ""]))


def compared(*items, overrides=(), **options):
    request = Request(overrides, out=Path("both"), force=True, figures=False, **options)
    return comparing.compare([Path(item) for item in items], request)


def numbers(done, label):
    return [done.result.table.of(label).get(name, math.nan) for name in METRICS]


def made_run(name="run"):
    alone = {"controllers": None, "controller": {"kind": "momentum_vector"}}
    return p.run("task.yaml", alone, out=name, figures=False)


def warnings_of(done):
    return [finding.text for finding in done.warnings() if finding.code == "measured-log"]
