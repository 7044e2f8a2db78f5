"""The runs of a bench: each law in each case, kept as numbers and a track, without a log."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from podusv_cli.core.errors import PodusvError, in_a_line
from podusv_cli.core.kernel import Vector
from podusv_cli.engine.running.simulate import simulate
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
    return list(_played(case))


def _played(case: BenchCase) -> Iterator[BenchRun]:
    for law, scenario in case.laws.items():
        try:
            yield _run(case, law, scenario)
        except PodusvError as error:
            yield crashed(case, law, in_a_line(error))


def crashed(case: BenchCase, law: str, cause: str) -> BenchRun:
    """A run of which there is nothing."""
    return BenchRun(case.place, law, "crashed", cause, {}, np.empty((0, 4)))


def _run(case: BenchCase, law: str, scenario: Scenario) -> BenchRun:
    probe, grid = scenario.probe(), _thinned(scenario).time_grid()
    recording = simulate(
        scenario.closed_loop(), grid, probe=probe, compiled=scenario.simulation.compiled
    )
    if recording.status == "interrupted":
        raise KeyboardInterrupt
    numbers = probe.summary(recording.seen) if recording.seen is not None else {}
    track = np.stack([recording[name] for name in ("x", "y", "x_d", "y_d")], axis=1)
    settled = numbers.get("e_steady", math.nan)
    if recording.status != "finished" or scenario.at_target(numbers):
        return BenchRun(
            case.place, law, recording.status, _first(recording.message), numbers, track
        )
    left = numbers.get("path_done")
    cause = f"{settled:.3g} m off over the steady window"
    if left is not None:
        cause = f"{left:.0%} of the legs done"
    return BenchRun(case.place, law, FAILED, cause, numbers, track)


def _first(message: str) -> str:
    """When and why, without the last logged values."""
    return message.partition(";")[0]


def _thinned(scenario: Scenario) -> Scenario:
    """The scenario with so few logged rows as a track needs."""
    every = max(1, scenario.time_grid().steps // POINTS)
    return scenario.model_copy(update={"log": scenario.log.model_copy(update={"every": every})})
