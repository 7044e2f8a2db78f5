"""The runs of a batch, alone or side by side, each ready for a thread."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from podusv_cli.core.kernel import LANES, whole_lanes
from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.loop.recent import Recent
from podusv_cli.engine.running.lanes import Lanes
from podusv_cli.engine.running.simulate import March, marcher
from podusv_cli.engine.running.watch import Bell, Ending, Work
from podusv_cli.engine.step.layout import Vectors

NUMBER = 8  # bytes; LANES numbers are a cache line


@dataclass(frozen=True, eq=False)
class BatchRun:
    """One run of a batch, ready to start."""

    position: int
    plan: Plan
    vectors: Vectors


@dataclass(frozen=True, eq=False)
class Group:
    """Runs that a thread marches over; `endings` tells how each of them ended.

    It is told whether the thread was stopped.
    """

    runs: list[BatchRun]
    work: Work
    endings: Callable[[bool], list[Ending]]


@dataclass(frozen=True)
class Common:
    """What the runs of a batch share: the plan of one of them, and its march."""

    plan: Plan
    bell: Bell = field(default_factory=Bell)
    recall: Recent = field(default_factory=Recent)

    @cached_property
    def advance(self) -> Callable[..., March]:
        """What makes the compiled march of a run."""
        return marcher(self.plan, True)

    def planned(self, loop: ClosedLoop) -> Plan:
        """The plan of a run.

        Raises ValueError for a loop of another structure, LawError for parts that do not fit.
        """
        wanted = self.plan
        loop.check_fit(wanted.grid.step)
        found = replace(wanted, loop=loop, probe=lambda plan: wanted.observer, recall=self.recall)
        if found.structure != wanted.structure:
            raise ValueError(
                f"it has another structure than the batch: {_kinds(loop)} with {found.layout}, "
                f"not {_kinds(wanted.loop)} with {wanted.layout}; runs of one batch differ in "
                "numbers only"
            )
        return found

    def run(self, position: int, plan: Plan) -> BatchRun:
        """A run that is ready to start."""
        return BatchRun(position, plan, _apart(plan.vectors()))

    def alone(self, run: BatchRun) -> Group:
        """The thread of one run."""
        grid, layout = self.plan.grid, self.plan.layout
        last = grid.steps + 1
        function = partial(self.advance(run.vectors, layout, grid.step), 0, last)
        work = Work(function, run.vectors.under_way, self.bell)

        def endings(stopped: bool) -> list[Ending]:
            if stopped and work.reached < last:
                return [Ending(work.reached, "interrupted")]
            return [work.ending(last)]

        return Group([run], work, endings)

    def together(self, runs: list[BatchRun], advance: Callable[[Lanes, float], March]) -> Group:
        """The thread of runs side by side."""
        last = self.plan.grid.steps + 1
        lanes = Lanes.of([run.vectors for run in runs], self.plan.layout)
        march = partial(advance(lanes, self.plan.grid.step), 0, last)
        work = Work(march, lanes.under_way, self.bell)
        return Group(runs, work, lambda stopped: lanes.endings(work.reached, last))


def _kinds(loop: ClosedLoop) -> str:
    parts = (loop.path, loop.disturbance, loop.actuator, loop.controller)
    return ", ".join(type(part).__name__ for part in parts)


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
