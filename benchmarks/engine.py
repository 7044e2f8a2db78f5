"""The engine beside C, how its cost grows, and what one evaluation of a law costs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any

from benchmarks.c_program import agreement, timer
from benchmarks.cases import CASES, ROOT, SCENARIO, Case, grid, rivals, run_probe
from benchmarks.timing import Timer, in_turns, quartiles, ratio, timed
from podusv_cli.components.controllers.base import Controller
from podusv_cli.components.controllers.network import Network
from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.replay import replayer
from podusv_cli.engine.running.simulate import run, simulate
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.scenario.limits import estimate
from podusv_cli.scenario.load import load
from podusv_cli.scenario.model import Scenario

ROUNDS = 7
STEPS = (1_000, 3_100, 10_000, 31_000, 100_000)
NODES = (2, 3, 5, 7)  # along every axis
LOG_EVERY = (1, 10, 100)
USUAL = Case("adaptive_neural", "27 grid")


def engine_timers(case: Case) -> dict[str, Timer]:
    """Timers of one whole `simulate`, every step logged, without and with the metrics [CPU s]."""
    loop, over = case.loop(), grid()
    probe = run_probe(loop, over)
    return {
        "podusv": timed(partial(simulate, loop, over), clock=process_time),
        "podusv with metrics": timed(
            partial(simulate, loop, over, probe=probe), clock=process_time
        ),
    }


def beside_c(programs: Mapping[str, Path], case: Case, rounds: int = ROUNDS) -> dict[str, Any]:
    """CPU times [s] and ratios of podusv and the C programs, as quartiles, taken in turns."""
    timers = engine_timers(case) | {name: timer(path, case) for name, path in programs.items()}
    times = in_turns(timers, rounds)
    ratios = {
        f"{ours} / C -{name}": ratio(times, ours, name)
        for ours in ("podusv", "podusv with metrics")
        for name in programs
    }
    seconds = {name: quartiles(values) for name, values in times.items()}
    return {"seconds": seconds, "ratios": ratios}


def all_beside_c(
    programs: Mapping[str, Path], cases: Sequence[Case] = CASES
) -> Iterator[tuple[str, dict[str, Any]]]:
    """`beside_c` case by case, each after its results were found to agree."""
    for case in cases:
        apart = agreement(programs, case)
        yield case.label, {"apart": max(apart.values())} | beside_c(programs, case)


def growth(rounds: int = ROUNDS) -> dict[str, dict[str, list[float]]]:
    """CPU time of one step [s] against numbers of steps and nodes and density of the log."""
    usual, sparse = USUAL.loop(), grid(log_every=10)
    loops = {f"{n**3}": replace(usual, controller=_with_nodes(n)) for n in NODES}
    series = {
        "steps": {str(n): (usual, grid(n, log_every=10)) for n in STEPS},
        "nodes": {nodes: (loop, sparse) for nodes, loop in loops.items()},
        "log_every": {str(n): (usual, grid(log_every=n)) for n in LOG_EVERY},
    }
    return {name: _a_step(runs, rounds) for name, runs in series.items()}


def _with_nodes(n: int) -> Controller:
    return USUAL.controller().model_copy(update={"network": Network(nodes=(n, n, n))})


def _a_step(runs: dict[str, tuple[ClosedLoop, TimeGrid]], rounds: int) -> dict[str, list[float]]:
    timers = {
        label: timed(partial(simulate, *run), clock=process_time) for label, run in runs.items()
    }
    times = in_turns(timers, rounds)
    return {label: quartiles(times[label] / over.steps) for label, (_, over) in runs.items()}


def log_megabytes() -> float:
    """Size of the log of a whole run, in memory [MB]."""
    scenario = load(SCENARIO).scenario
    return estimate(scenario, scenario.plan()).content / 1e6


def actuators(rounds: int = ROUNDS) -> dict[str, list[float]]:
    """Time of one step [s] with the usual law behind each actuator; pods differ by allocation."""
    acting = {"ideal": "ideal", "saturated": "corrected", "one pod": "single", "two pods": "kept"}
    loops = {label: _behind(name) for label, name in acting.items()}
    sparse = grid(log_every=10)
    return _a_step({label: (loop, sparse) for label, loop in loops.items()}, rounds)


def seas(rounds: int = ROUNDS) -> dict[str, list[float]]:
    """Time of a run in a sea over that of the same run in calm water, round by round.

    The sea has a current, wind with 50 components and long-crested waves with 100.
    """
    parts = (
        {"kind": "current", "speed": 0.06, "speed_std": 0.02},
        {"kind": "wind", "speed": 1.0, "gusts": "norsok", "components": 50},
        {"kind": "waves", "height": 0.027, "period": 0.8, "components": 100},
    )
    sea = {"disturbance": parts}
    sensors = {"measurement": {"kind": "sensors"}}
    told = {
        "calm": {"disturbance": {"kind": "none"}},
        "sea": sea,
        "sea, sensors": sea | sensors,
        **{
            f"sea, sensors, {kind}": sea | sensors | {"estimator": {"kind": kind}}
            for kind in ("low_pass", "passive_observer", "ekf")
        },
    }
    base = load(ROOT / "configs" / "mu_2017" / "corrected.yaml").scenario
    loops = {label: _changed(base, new).closed_loop() for label, new in told.items()}
    over = grid(log_every=10)
    timers = {
        label: timed(partial(simulate, loop, over), clock=process_time)
        for label, loop in loops.items()
    }
    times = in_turns(timers, rounds)
    return {label: ratio(times, label, "calm") for label in loops}


def _changed(scenario: Scenario, new: dict[str, Any]) -> Scenario:
    return Scenario.model_validate(scenario.alone().model_dump() | new)


def _behind(name: str) -> ClosedLoop:
    folder = "mu_2017" if name == "corrected" else "pod"
    scenario = load(ROOT / "configs" / folder / f"{name}.yaml").scenario
    return replace(USUAL.loop(), actuator=scenario.actuator)


def law_costs(rounds: int = 15) -> dict[str, dict[str, list[float]]]:
    """Time of one evaluation of every law [s], over states of its own run, and its ratio.

    The ratio is to adaptive_neural with 27 nodes, round by round.
    """
    replays = {
        name: replayer(plan, run(plan))
        for name, loop in rivals().items()
        for plan in [Plan(loop, grid(log_every=10))]
    }
    times = in_turns(replays, rounds)
    return {
        name: {"seconds": quartiles(1e-9 * values), "ratio": ratio(times, name, USUAL.law)}
        for name, values in times.items()
    }
