"""The optimum of every case: the least IAE of all motions, with everything known beforehand.

Cases that differ only in what laws are told, or how often they are asked, have the same one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pandas as pd

from podusv_cli.core.errors import NotConvergedError, UsageError
from podusv_cli.engine.running.simulate import to_end
from podusv_cli.optimum import collocation
from podusv_cli.optimum.collocation import Stage
from podusv_cli.optimum.problem import Motion, OptimumProblem, problem
from podusv_cli.studies.bench.cases import BenchCase
from podusv_cli.studies.bench.runs import BenchRun

STEPS = (0.4, 0.2)  # s, of the finest of three grids; the next where IPOPT finds nothing
BEGINNINGS = 2  # how many laws the search begins from: the best of the case
# What an optimum depends on. It has no law, and sees all without sensors.
TASK = {"vessel", "start", "path", "disturbance", "actuator", "simulation"}

CaseName = tuple[str, str, str]


@dataclass(frozen=True)
class Least:
    """An optimum: the cases that it is of, IAE [m s], and by how much the finest grid lowered it.

    `start` is the law from whose run the search came to it.
    """

    places: Sequence[CaseName]
    iae: float
    step: float
    lowered: float
    start: str


@dataclass(frozen=True)
class OptimumTask:
    """Cases with one optimum, and the laws whose runs the search begins from."""

    cases: Sequence[BenchCase]
    laws: Sequence[str]


def wanted_optima(
    every: Iterable[BenchCase], runs: Sequence[BenchRun]
) -> tuple[list[OptimumTask], list[str]]:
    """What is to be solved, and a sentence for each actuator or load that cannot be.

    Cases with equal TASK sections share one optimum. `runs` supply the laws to begin from.
    """
    tasks: dict[str, list[BenchCase]] = {}
    refused: dict[str, None] = {}
    for case in every:
        first = next(iter(case.laws.values()))
        try:
            problem(first, "iae")
        except UsageError as error:
            # The same reason may come from many cases: it is given once, without the case's name.
            refused[str(error).partition(": ")[2]] = None
            continue
        tasks.setdefault(first.model_dump_json(include=TASK), []).append(case)
    return [OptimumTask(cases, _best(cases, runs)) for cases in tasks.values()], list(refused)


def _best(cases: Sequence[BenchCase], runs: Sequence[BenchRun]) -> list[str]:
    """At most BEGINNINGS laws that reached the target in the first case, least IAE first."""
    done = [run for run in runs if run.place == cases[0].place and run.good]
    return [run.law for run in sorted(done, key=lambda run: run.metrics["iae"])[:BEGINNINGS]]


def least(of: OptimumTask, tell: Callable[[float], None]) -> Least:
    """The optimum of these cases; `tell` is called with the part that is done, from 0 to 1.

    Raises NotConvergedError, and UsageError where no law reached its target.
    """
    case = of.cases[0]
    places = [case.place for case in of.cases]
    if not of.laws:
        raise UsageError(f"{', '.join(case.place)}: no law reached its target to begin from")
    scenarios = {law: case.laws[law] for law in of.laws}
    guesses = {
        law: Motion.of(to_end(scenario.plan(), compiled=scenario.simulation.compiled))
        for law, scenario in scenarios.items()
    }
    stages = _search_optimum(problem(scenarios[of.laws[0]], "iae"), guesses, tell)
    # The last two grids: their difference shows how much the finest one still changed.
    before, last = next(reversed(list(pairwise(stages))))
    lowered = before.integral - last.integral
    return Least(places, last.integral, last.step, float(np.nan_to_num(lowered)), last.start)


def _search_optimum(
    asked: OptimumProblem, guesses: Mapping[str, Motion], tell: Callable[[float], None]
) -> list[Stage]:
    """Optima on ever finer grids, the finest last.

    `guesses` are runs of laws to begin from, by name. The next of STEPS is tried where IPOPT finds
    nothing. Raises NotConvergedError.
    """
    *first, last = STEPS
    for step in first:
        with suppress(NotConvergedError):
            return collocation.search_optima(asked, guesses, step, lambda _, part: tell(part))[0]
    # Outside `suppress`: the error of the last attempt is the caller's.
    return collocation.search_optima(asked, guesses, last, lambda _, part: tell(part))[0]


def table(optima: Iterable[Least]) -> pd.DataFrame:
    """A row for each case that has an optimum: IAE [m s], finest step [s], and how it was found."""
    rows = [
        (*place, optimum.iae, optimum.step, optimum.lowered, optimum.start)
        for optimum in optima
        for place in optimum.places
    ]
    names = ("vessel", "task", "condition", "optimum", "step", "lowered", "start")
    return pd.DataFrame(rows, columns=pd.Index(names))
