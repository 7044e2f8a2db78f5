"""Orders and metrics of loops that tests run."""

from itertools import pairwise

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.simulate import simulate
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.metrics.table import metrics_probe


def order(ends: list[Vector]) -> float:
    """Mean order from ends at halved steps (Richardson: differences shrink as errors do)."""
    gaps = [abs(a - b).max() for a, b in pairwise(ends)]
    return float(-np.polyfit(range(len(gaps)), np.log2(gaps), 1)[0])


def gathered(
    loop, *, steps=4000, log_every=1, radius=2.0, steady_fraction=0.25, compiled=True, **options
):
    grid = TimeGrid(0.01, steps, log_every)
    probe = metrics_probe(Plan(loop, grid), steady_fraction=steady_fraction, settling_radius=radius)
    recording = simulate(loop, grid, probe=probe, compiled=compiled, **options)
    return recording, probe.summary(recording.seen)
