"""The runs of a bench: each law in each case, kept as numbers and a track, without a log."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from podusv_cli.core.errors import PodusvError, in_a_line
from podusv_cli.core.kernel import Vector
from podusv_cli.engine.running.simulate import to_end
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.scenario.model import Scenario
from podusv_cli.studies.bench.cases import BenchCase

POINTS = 150  # of a track
FAILED = "not at its target"


@dataclass(frozen=True)
class BenchRun:
    """How a law did in a case.

    `status` is finished, diverged, crashed, or FAILED where the mean error beyond the standoff over
    the steady window exceeds the settling radius. `track` has rows x, y, x_d, y_d [m].
    """

    place: tuple[str, str, str]
    law: str
    status: str
    cause: str
    metrics: Mapping[str, float]
    track: Vector

    @property
    def task(self) -> str:
        """The task's name."""
        return self.place[1]

    @property
    def good(self) -> bool:
        """Whether the vessel is at its target at the end."""
        return self.status == "finished"


def play(case: BenchCase) -> list[BenchRun]:
    """Simulate every law of a case; a law that fails costs no other."""
    return list(_play_case(case))


def _play_case(case: BenchCase) -> Iterator[BenchRun]:
    """The run of each law of a case; one that podusv refuses counts as crashed."""
    for law, scenario in case.laws.items():
        try:
            yield _run(case, law, scenario)
        except PodusvError as error:
            yield crashed_run(case, law, in_a_line(error))


def crashed_run(case: BenchCase, law: str, cause: str) -> BenchRun:
    """A run of which there is nothing."""
    return BenchRun(case.place, law, "crashed", cause, {}, np.empty((0, 4)))


def _run(case: BenchCase, law: str, scenario: Scenario) -> BenchRun:
    """Simulate one law in one case, and judge whether it ends at its target.

    Raises PodusvError where the loop refuses its numbers.
    """
    plan = scenario.plan(_thin_grid(scenario.time_grid()))
    recording = to_end(plan, compiled=scenario.simulation.compiled)
    numbers = plan.probe.summary(recording.seen) if recording.seen is not None else {}
    track = np.stack([recording[name] for name in ("x", "y", "x_d", "y_d")], axis=1)
    settled = numbers.get("e_steady", math.nan)
    if recording.status != "finished" or scenario.at_target(numbers):
        return BenchRun(
            case.place, law, recording.status, _first(recording.message), numbers, track
        )
    # Only runs that follow a path have it; there the legs done decide.
    left = numbers.get("path_done")
    cause = f"{settled:.3g} m off over the steady window"
    if left is not None:
        cause = f"{left:.0%} of the legs done"
    return BenchRun(case.place, law, FAILED, cause, numbers, track)


def _first(message: str) -> str:
    """When and why, without the last logged values."""
    return message.partition(";")[0]


def _thin_grid(grid: TimeGrid) -> TimeGrid:
    """The grid with so few logged rows as a track needs."""
    # Metrics are gathered at every step, so they do not depend on it.
    return replace(grid, log_every=max(1, grid.steps // POINTS))
