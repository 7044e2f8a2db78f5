"""Many runs at once beside the same runs one after another, and runs side by side beside both."""

from __future__ import annotations

from functools import partial
from time import process_time
from typing import Any

import numpy as np

from benchmarks.cases import LAWS, Case, grid, run_probe
from benchmarks.timing import in_turns, quartiles, ratio, timed
from benchmarks.variants import variants
from podusv_cli.engine.loop.closed_loop import ClosedLoop, Probe
from podusv_cli.engine.running.batch import simulate_many
from podusv_cli.engine.running.simulate import simulate
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.process.workers import available_workers

CASE = Case("adaptive_neural", "27 grid")
STEPS = (31_000, 1_000)
A_CORE = 16  # runs; the last ones end alone
USUAL = [Case(law, "" if law == "pid" else "27 grid") for law in LAWS]
MANY_NODES = [Case(law, "125 grid") for law in LAWS if law != "pid"]
RUNS = {31_000: 8, 1_000: 64}  # side by side, by number of steps
MANY = {True: 512, False: 64}  # runs on all cores, side by side and one by one


def _one_by_one(loops: list[ClosedLoop], over: TimeGrid, probe: Probe) -> None:
    for loop in loops:
        simulate(loop, over, probe=probe)


def batch_costs(rounds: int = 7) -> dict[str, Any]:
    """By number of steps: time of one run [s] alone and in a batch, and what the batch costs.

    The cost is the time of N runs on all cores over N / cores times that of a single one; that in
    processor time does not see whether the cores were free. All runs gather metrics, none logs.
    """
    return {str(steps): _costs(steps, rounds) for steps in STEPS}


def _costs(steps: int, rounds: int) -> dict[str, Any]:
    cores = available_workers()
    count = A_CORE * cores
    over = grid(steps, log_every=steps + 1)
    scales = {"disturbance.scale": np.linspace(0.5, 1.5, count)}
    loops = variants(CASE.loop(), scales)
    probe = run_probe(loops[0], over)
    many = partial(simulate_many, loops, over, probe=probe, side_by_side=False)
    singly = partial(_one_by_one, loops, over, probe)
    timers = {
        "alone": timed(singly, 1),
        "batch": timed(many, 1),
        "alone, processor": timed(singly, 1, process_time),
        "batch, processor": timed(many, 1, process_time),
    }
    times = in_turns(timers, rounds)
    return {
        "runs": count,
        "cores": cores,
        "seconds": {name: quartiles(values / count) for name, values in times.items()},
        "cost": quartiles(times["batch"] * cores / times["alone"]),
        "processor cost": quartiles(times["batch, processor"] / times["alone, processor"]),
    }


def side_by_side_laws(rounds: int = 7) -> dict[str, dict[str, Any]]:
    """By law and number of steps: processor time of a run side by side and of one by one [s]."""
    cases = [(case, steps) for case in USUAL for steps in RUNS]
    cases += [(case, max(RUNS)) for case in MANY_NODES]
    return {f"{case.label}; {steps}": _side_by_side(case, steps, rounds) for case, steps in cases}


def _side_by_side(case: Case, steps: int, rounds: int) -> dict[str, Any]:
    over, count = grid(steps, log_every=steps + 1), RUNS[steps]
    loops = variants(case.loop(), {"disturbance.scale": np.linspace(0.5, 1.5, count)})
    many = partial(simulate_many, loops, over, probe=run_probe(loops[0], over), workers=1)
    timers = {
        name: timed(partial(many, side_by_side=beside), 1, process_time)
        for name, beside in (("side by side", True), ("one by one", False))
    }
    times = in_turns(timers, rounds)
    return {name: quartiles(values / count) for name, values in times.items()} | {
        "ratio": ratio(times, "side by side", "one by one")
    }


def hours_for_a_million(rounds: int = 3) -> dict[str, dict[str, list[float]]]:
    """By law the hours that a million runs take on all cores, from some hundreds of them.

    Each run has another start, all have all metrics.
    """
    return {case.label: _hours(case, rounds) for case in USUAL}


def _hours(case: Case, rounds: int) -> dict[str, list[float]]:
    over, draws = grid(31_000, log_every=31_001), np.random.default_rng(1)
    timers = {}
    for beside, count in MANY.items():
        starts = {f"start.{axis}": draws.uniform(-10.0, 10.0, count) for axis in "xy"}
        loops = variants(case.loop(), starts)
        probe = run_probe(loops[0], over)
        timers["side by side" if beside else "one by one"] = timed(
            partial(simulate_many, loops, over, probe=probe, side_by_side=beside), 1
        )
    times = in_turns(timers, rounds)
    counts = dict(zip(timers, MANY.values(), strict=True))
    return {name: quartiles(values / counts[name] * 1e6 / 3600) for name, values in times.items()}
