"""A unit of a study: a range of draws of one law in one cell, simulated as one batch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise

import numpy as np

from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.engine.running import lanes
from podusv_cli.engine.running.batch import Lazily, simulate_many
from podusv_cli.engine.running.simulate import ready
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.studies.counting.runs import STATUSES, Unit, UnitResult
from podusv_cli.studies.making.draws import Draw, drawing, draws
from podusv_cli.studies.making.plan import StudyPlan

Part = tuple[StudyPlan, Unit]


def prepare(
    plan: StudyPlan,
    law: str,
    cell: int,
    runs: int = 0,
    compiling: Callable[[float], None] | None = None,
) -> str:
    """Check a law, have its march compiled and loaded, and say why its runs march one by one.

    The reason is empty where runs march side by side. `runs` is how many runs of the law there will
    be, by default those of the plan: for few, the march side by side is not worth compiling.
    `compiling` is called with the fraction that is compiled, if there is anything to compile.
    Raises LawError.
    """
    planned = plan.run_plan(law, cell)
    ready(planned, compiled=True, compiling=compiling)
    runs = runs or plan.sweep.draws * len(plan.cells)
    return lanes.prepare(planned, runs * planned.grid.steps, compiling)


def make(
    plan: StudyPlan,
    unit: Unit,
    progress: Callable[[float], None] | None = None,
    grid: TimeGrid | None = None,
) -> UnitResult:
    """Simulate a unit, run after run, over the scenario's instants or those of another `grid`.

    `progress` is called with the fraction done. Raises KeyboardInterrupt, and then nothing is kept.
    """
    return make_together([(plan, unit)], progress, grid)[0]


def make_together(
    parts: Sequence[Part],
    progress: Callable[[float], None] | None = None,
    grid: TimeGrid | None = None,
) -> list[UnitResult]:
    """Simulate units that are `alike`, as one batch; a result for each; otherwise as `make`.

    A unit with runs that the batch refuses is made once more by itself, as a number such as
    `hold_below` may change the structure of a law.
    """
    plan, unit = parts[0]
    scenario = plan.single(unit.law, unit.cell)
    grid, probe = grid or scenario.time_grid(), scenario.probe()
    loops = [loop for part in parts for loop in _loops(*part)]
    done = simulate_many(
        Lazily(len(loops), lambda position: loops[position]()),
        grid,
        probe=probe,
        workers=1,
        progress=progress,
        like=scenario.closed_loop(),
    )
    if "interrupted" in done.status:
        raise KeyboardInterrupt
    ends = np.cumsum([0, *(unit.count for _, unit in parts)]).tolist()
    rows = [slice(first, stop) for first, stop in pairwise(ends)]
    made = [
        UnitResult(
            unit,
            probe.summaries(done.seen[own]),
            np.array([STATUSES.index(word) for word in done.status[own]], np.uint8),
            # The time of the last instant reached; a run that reached none has 0.
            np.maximum(done.reached[own] - 1, 0) * grid.step,
            tuple(map(str, done.cause[own])),
        )
        for (_, unit), own in zip(parts, rows, strict=True)
    ]
    if len(parts) == 1:
        return made
    refused = [STATUSES.index("invalid") in result.status for result in made]
    return [
        make(*part, progress, grid) if again else result
        for part, result, again in zip(parts, made, refused, strict=True)
    ]


def _loops(plan: StudyPlan, unit: Unit) -> list[Callable[[], ClosedLoop]]:
    """A function for each of a unit's draws that builds its closed loop when called."""
    drawn = drawing(plan.single(unit.law, unit.cell), plan.sweep.vary)

    def loop(draw: Draw) -> ClosedLoop:
        return drawn(draw).closed_loop()

    numbers = draws(plan.sweep, unit.first, unit.count, plan.stream)
    return [partial(loop, draw) for draw in numbers]


def alike(part: Part) -> str:
    """A key that is equal for units whose loops differ in numbers, and hardly ever in structure.

    `part` is a plan and a unit of it. The key has the law, the cell and all settings of the law
    that are no real numbers.
    """
    plan, unit = part
    law = plan.single(unit.law, unit.cell).controller.model_dump()
    return repr((unit.law, unit.cell, {k: v for k, v in law.items() if not isinstance(v, float)}))


def crashed_unit(unit: Unit, names: tuple[str, ...], cause: str) -> UnitResult:
    """The result of a unit that ends its process: no numbers, all runs crashed for this `cause`.

    `names` are the metrics that the table wants.
    """
    nothing = np.full(unit.count, np.nan)
    return UnitResult(
        unit,
        dict.fromkeys(names, nothing),
        np.full(unit.count, STATUSES.index("crashed"), np.uint8),
        nothing,
        (cause,) * unit.count,
    )
