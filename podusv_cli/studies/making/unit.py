"""A unit of a study: a range of draws of one law in one cell, simulated as one batch."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.engine.running import lanes
from podusv_cli.engine.running.batch import Lazily, simulate_many
from podusv_cli.engine.running.simulate import ready
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.studies.counting.runs import STATUSES, Unit, UnitResult
from podusv_cli.studies.making.draws import drawing, draws
from podusv_cli.studies.making.plan import StudyPlan


def prepare(
    plan: StudyPlan, law: str, cell: int, runs: int = 0,
    compiling: Callable[[float], None] | None = None,
) -> str:  # fmt: skip
    """Check a law, and have its march compiled and loaded; why its runs march one by one.

    The reason is empty where runs march side by side. Raises LawError.

    `runs` is how many runs of it there will be, by default those of the plan. `compiling` is called
    with the fraction that is compiled, if there is anything to compile.
    """
    scenario = plan.single(law, cell)
    planned = scenario.plan()
    ready(planned, compiled=True, compiling=compiling)
    runs = runs or plan.sweep.draws * len(plan.cells)
    return lanes.prepare(planned, runs * planned.grid.steps, compiling)


def make(
    plan: StudyPlan, unit: Unit, progress: Callable[[float], None] | None = None,
    grid: TimeGrid | None = None,
) -> UnitResult:  # fmt: skip
    """Simulate a unit, run after run, over the scenario's instants or those of another grid.

    Raises KeyboardInterrupt, and then nothing is kept.
    """
    scenario = plan.single(unit.law, unit.cell)
    grid, probe = grid or scenario.time_grid(), scenario.probe()
    numbers = list(draws(plan.sweep, unit.first, unit.count, plan.stream))
    drawn = drawing(scenario, plan.sweep.vary)

    def loop(position: int) -> ClosedLoop:
        return drawn(numbers[position]).closed_loop()

    done = simulate_many(
        Lazily(unit.count, loop),
        grid,
        probe=probe,
        workers=1,
        progress=progress,
        like=scenario.closed_loop(),
    )
    if "interrupted" in done.status:
        raise KeyboardInterrupt
    return UnitResult(
        unit, probe.summaries(done.seen),
        np.array([STATUSES.index(word) for word in done.status], np.uint8),
        np.maximum(done.reached - 1, 0) * grid.step, tuple(map(str, done.cause)),
    )  # fmt: skip


def crashed(unit: Unit, names: tuple[str, ...], cause: str) -> UnitResult:
    """The result of a unit of one run that ends its process."""
    nothing = np.full(unit.count, np.nan)
    return UnitResult(
        unit, dict.fromkeys(names, nothing),
        np.full(unit.count, STATUSES.index("crashed"), np.uint8), nothing, (cause,) * unit.count,
    )  # fmt: skip
