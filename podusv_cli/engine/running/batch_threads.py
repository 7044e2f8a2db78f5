"""The runs of a batch, alone or side by side, each ready for a thread."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from podusv_cli.core.kernel import LANES, whole_lanes
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.lanes import Lanes
from podusv_cli.engine.running.simulate import March, Marcher
from podusv_cli.engine.running.watch import Bell, Ending, Work
from podusv_cli.engine.step.layout import Vectors

NUMBER = 8  # bytes; LANES numbers are a cache line


@dataclass(frozen=True, eq=False)
class BatchRun:
    """One run of a batch, ready to start."""

    position: int
    plan: Plan
    vectors: Vectors

    @classmethod
    def of(cls, position: int, plan: Plan) -> BatchRun:
        """At its start."""
        return cls(position, plan, _apart(plan.vectors()))


@dataclass(frozen=True, eq=False)
class MarchThread:
    """Runs that a thread marches over; `endings` tells how each of them ended.

    It is told whether the thread was stopped.
    """

    runs: list[BatchRun]
    work: Work
    endings: Callable[[bool], list[Ending]]


def march_alone(run: BatchRun, march: Marcher, bell: Bell) -> MarchThread:
    """The thread of one run."""
    grid, last = run.plan.grid, run.plan.grid.steps + 1
    function = partial(march(run.vectors, run.plan.layout, grid.step), 0, last)
    work = Work(function, run.vectors.under_way, bell)

    def endings(stopped: bool) -> list[Ending]:
        if stopped and work.reached < last:
            return [Ending(work.reached, "interrupted")]
        return [work.ending(last)]

    return MarchThread([run], work, endings)


def march_together(
    runs: list[BatchRun], advance: Callable[[Lanes, float], March], bell: Bell
) -> MarchThread:
    """The thread of runs side by side."""
    grid, last = runs[0].plan.grid, runs[0].plan.grid.steps + 1
    lanes = Lanes.of([run.vectors for run in runs], runs[0].plan.layout)
    work = Work(partial(advance(lanes, grid.step), 0, last), lanes.under_way, bell)
    return MarchThread(runs, work, lambda stopped: lanes.endings(work.reached, last))


def _apart(vectors: Vectors) -> Vectors:
    """The vectors in memory of their own, each from a new cache line on.

    Cores that write to one line wait for each other.
    """
    ends = np.cumsum([0, *(whole_lanes(len(vector)) for vector in vectors)]).tolist()
    room = np.zeros(ends[-1] + LANES)
    room = room[-(room.ctypes.data // NUMBER) % LANES :]
    own = [room[at : at + len(v)] for at, v in zip(ends, vectors, strict=False)]
    for vector, content in zip(own, vectors, strict=True):
        vector[:] = content
    return Vectors(*own)
