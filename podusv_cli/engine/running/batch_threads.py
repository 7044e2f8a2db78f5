"""The runs of a batch, alone or side by side, each ready for a thread."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np

from podusv_cli.core.kernel import LANES, whole_lanes
from podusv_cli.engine.loop.closed_loop import ClosedLoop, Observer, entries, vectors_of
from podusv_cli.engine.loop.recent import Recent
from podusv_cli.engine.running.lanes import Lanes
from podusv_cli.engine.running.simulate import March, marcher
from podusv_cli.engine.running.watch import Bell, Ending, Work
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.engine.step.layout import Layout, Vectors

NUMBER = 8  # bytes; LANES numbers are a cache line


@dataclass(frozen=True, eq=False)
class BatchRun:
    """One run of a batch, ready to start."""

    position: int
    loop: ClosedLoop
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
    """What the runs of a batch share: the structure of one of their loops, and its march."""

    like: ClosedLoop
    grid: TimeGrid
    observer: Observer
    bell: Bell = field(default_factory=Bell)
    recall: Recent = field(default_factory=Recent)

    @cached_property
    def structure(self) -> tuple[Layout, list[Any]]:
        """The layout, and the kernels with the names of their constants."""
        return self._structure_of(self.like)

    def _structure_of(self, loop: ClosedLoop) -> tuple[Layout, list[Any]]:
        return loop.layout(self.grid), list(entries(loop, self.observer, self.recall))

    @cached_property
    def advance(self) -> Callable[..., March]:
        """What makes the compiled march of a run."""
        return marcher(self.like, self.observer, True)

    def check(self, loop: ClosedLoop) -> None:
        """Raise ValueError for a loop of another structure, LawError for parts that do not fit."""
        loop.check_fit(self.grid.step)
        found, wanted = self._structure_of(loop), self.structure
        if found != wanted:
            raise ValueError(
                f"it has another structure than the batch: {_kinds(loop)} with {found[0]}, not "
                f"{_kinds(self.like)} with {wanted[0]}; runs of one batch differ in numbers only"
            )

    def run(self, position: int, loop: ClosedLoop) -> BatchRun:
        """A run that is ready to start."""
        layout = self.structure[0]
        vectors = vectors_of(loop, layout, self.observer, self.grid, recall=self.recall)
        return BatchRun(position, loop, _apart(vectors))

    def alone(self, run: BatchRun) -> Group:
        """The thread of one run."""
        layout, last = self.structure[0], self.grid.steps + 1
        function = partial(self.advance(run.vectors, layout, self.grid.step), 0, last)
        work = Work(function, run.vectors.under_way, self.bell)

        def endings(stopped: bool) -> list[Ending]:
            if stopped and work.reached < last:
                return [Ending(work.reached, "interrupted")]
            return [work.ending(last)]

        return Group([run], work, endings)

    def together(self, runs: list[BatchRun], advance: Callable[[Lanes, float], March]) -> Group:
        """The thread of runs side by side."""
        last = self.grid.steps + 1
        lanes = Lanes.of([run.vectors for run in runs], self.structure[0])
        march = partial(advance(lanes, self.grid.step), 0, last)
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
