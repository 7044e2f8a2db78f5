"""Many runs at once beside the same runs one after another."""

from __future__ import annotations

from functools import partial
from time import process_time
from typing import Any

import numpy as np

from benchmarks.cases import Case, grid, metrics_observer
from benchmarks.timing import in_turns, quartiles, timed
from podusv_cli.engine.batch import simulate_many
from podusv_cli.engine.grid import TimeGrid
from podusv_cli.engine.loop import ClosedLoop, Observer
from podusv_cli.engine.simulate import simulate
from podusv_cli.engine.variants import variants
from podusv_cli.process.workers import available_workers

CASE = Case("adaptive_neural", "27 grid")
STEPS = (31_000, 1_000)
A_CORE = 16  # runs; the last ones end alone


def _one_by_one(loops: list[ClosedLoop], over: TimeGrid, observer: Observer) -> None:
    for loop in loops:
        simulate(loop, over, observer=observer)


def batch_costs(rounds: int = 7) -> dict[str, Any]:
    """By number of steps: time of one run [s] alone and in a batch, and what the batch costs.

    The cost is the time of N runs on all cores over N / cores times that of a single one; that in
    processor time does not see whether the cores were free. Runs side by side are related to those
    of a batch one by one. All runs gather metrics, none logs.
    """
    return {str(steps): _costs(steps, rounds) for steps in STEPS}


def _costs(steps: int, rounds: int) -> dict[str, Any]:
    cores = available_workers()
    count = A_CORE * cores
    over = grid(steps, log_every=steps + 1)
    scales = {"disturbance.scale": np.linspace(0.5, 1.5, count)}
    loops = variants(CASE.loop(), scales)
    watching = metrics_observer(loops[0], over)
    many = partial(simulate_many, loops, over, observer=watching, side_by_side=False)
    abreast = partial(simulate_many, loops, over, observer=watching, side_by_side=True)
    singly = partial(_one_by_one, loops, over, watching)
    timers = {
        "alone": timed(singly, 1),
        "batch": timed(many, 1),
        "alone, processor": timed(singly, 1, process_time),
        "batch, processor": timed(many, 1, process_time),
        "side by side, processor": timed(abreast, 1, process_time),
    }
    times = in_turns(timers, rounds)
    return {
        "runs": count,
        "cores": cores,
        "seconds": {name: quartiles(values / count) for name, values in times.items()},
        "cost": quartiles(times["batch"] * cores / times["alone"]),
        "processor cost": quartiles(times["batch, processor"] / times["alone, processor"]),
        "side by side": quartiles(times["side by side, processor"] / times["batch, processor"]),
    }
