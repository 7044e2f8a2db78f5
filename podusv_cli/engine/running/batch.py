"""Many runs at once: side by side where that is possible, as many at a time as there are cores.

The compiled march releases the interpreter's lock, so threads are enough. A thread marches over
several runs side by side (`lanes`), or over one with the compiled code of `simulate`. No log is
kept; a run's probe gathers what is wanted of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Protocol

import numpy as np
import numpy.typing as npt

from podusv_cli.core.errors import PodusvError, in_a_line
from podusv_cli.core.escaping import visible
from podusv_cli.core.kernel import Vector, whole_lanes
from podusv_cli.engine.loop.closed_loop import STATE, ClosedLoop, Probe
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.lanes import FEWEST, Lanes, LaneSorter, room
from podusv_cli.engine.running.simulate import March, Marcher, marcher, why
from podusv_cli.engine.running.thread import Bell, Ending, Work
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.engine.step.layout import Vectors
from podusv_cli.process.interrupts import interrupts_deferred, interrupts_enabled
from podusv_cli.process.workers import available_workers


class Loops(Protocol):
    """Closed loops by position; a run's loop is asked for once, when the run is to begin."""

    def __len__(self) -> int:
        """The number of runs."""

    def __getitem__(self, position: int, /) -> ClosedLoop:
        """The loop of a run. ValueError and PodusvError say that there cannot be such a loop."""


@dataclass(frozen=True)
class Lazily:
    """Loops that `make` makes one by one, so that they need not exist all at once."""

    count: int
    make: Callable[[int], ClosedLoop]

    def __len__(self) -> int:
        """The number of runs."""
        return self.count

    def __getitem__(self, position: int, /) -> ClosedLoop:
        """Make the loop of a run."""
        return self.make(position)


@dataclass(frozen=True, eq=False)
class BatchRun:
    """One run of a batch, ready to start."""

    position: int
    plan: Plan
    vectors: Vectors

    @classmethod
    def of(cls, position: int, plan: Plan) -> BatchRun:
        """The run in this place of a batch, at its start."""
        return cls(position, plan, plan.vectors())


@dataclass(frozen=True, eq=False)
class MarchThread:
    """Runs that a thread marches over; `endings` tells how each of them ended.

    It is told whether the thread was stopped.
    """

    runs: list[BatchRun]
    work: Work
    endings: Callable[[bool], list[Ending]]


def march_alone(run: BatchRun, march: Marcher, bell: Bell) -> MarchThread:
    """The thread of one run, over vectors of its own; `march` is that of a run like this.

    `bell` is rung when it ends.
    """
    run = replace(run, vectors=_apart(run.vectors))
    grid, last = run.plan.grid, run.plan.grid.steps + 1
    function = partial(march(run.vectors, run.plan.layout, grid.step), 0, last)
    work = Work(function, run.vectors.under_way, bell)

    def endings(stopped: bool) -> list[Ending]:
        """How the run ended; cut short if it was `stopped` before its last instant."""
        if stopped and work.good_instant_count < last:
            return [Ending(work.good_instant_count, "interrupted")]
        return [work.ending(last)]

    return MarchThread([run], work, endings)


def march_together(
    runs: list[BatchRun], advance: Callable[[Lanes, float], March], bell: Bell
) -> MarchThread:
    """The thread of at most LANES runs side by side, which `advance` makes the march of."""
    grid, last = runs[0].plan.grid, runs[0].plan.grid.steps + 1
    lanes = Lanes.of([run.vectors for run in runs], runs[0].plan.layout)
    work = Work(partial(advance(lanes, grid.step), 0, last), lanes.under_way, bell)
    return MarchThread(runs, work, lambda stopped: lanes.endings(work.good_instant_count, last))


def _apart(vectors: Vectors) -> Vectors:
    """The vectors in memory of their own, each from a new cache line on.

    Cores that write to one line wait for each other.
    """
    ends = np.cumsum([0, *(whole_lanes(len(vector)) for vector in vectors)]).tolist()
    together = room(ends[-1])
    own = [together[at : at + len(v)] for at, v in zip(ends, vectors, strict=False)]
    for vector, content in zip(own, vectors, strict=True):
        vector[:] = content
    return Vectors(*own)


@dataclass(frozen=True)
class Batch:
    """How N runs ended and what was gathered in them, one entry or row a run.

    `status` is one of these words; `cause` is a sentence for the middle four, else empty.

    finished      it reached the last instant
    diverged      a number is not finite
    hung          a step took more than `thread.PATIENCE` of processor time
    crashed       the law, or another part, raised an exception
    invalid       its loop cannot be made, or has another structure than the others
    interrupted   an interrupt stopped it, or kept it from beginning

    A run that did not begin has 0 instants reached and NaN in its rows. `interrupted` says that an
    interrupt came, whatever it stopped; it ends here, and the caller has to pass it on.
    """

    status: npt.NDArray[np.str_]  # (N,)
    cause: npt.NDArray[np.object_]  # (N,), str
    reached: npt.NDArray[np.int64]  # (N,), good instants; steps + 1 for a finished run
    state: Vector  # (N, 6), the vessel's state where the march ended
    seen: Vector  # (N, probe.size)
    interrupted: bool = False

    def note(self, run: BatchRun, ending: Ending) -> None:
        """Enter how a run ended: instants reached, status, last state and metrics, and cause."""
        i, vectors = run.position, run.vectors
        self.reached[i], self.status[i] = ending.reached, ending.status
        self.state[i], self.seen[i] = vectors.s[: len(STATE)], vectors.seen
        if ending.status not in ("finished", "interrupted"):
            self.cause[i] = why(run.plan, vectors, ending)

    def refuse(self, position: int, status: str, cause: str) -> None:
        """Enter that the run in this place of the batch cannot begin."""
        self.status[position], self.cause[position] = status, visible(" ".join(cause.split()))


def simulate_many(
    loops: Loops,
    grid: TimeGrid,
    *,
    probe: Probe | None = None,
    workers: int = 0,
    progress: Callable[[float], None] | None = None,
    like: ClosedLoop | None = None,
    side_by_side: bool | None = None,
) -> Batch:
    """Integrate loops of one structure over the grid, `workers` at a time (0: one a core).

    The structure (kinds, sizes of memory, sampling) is that of `like`, by default that of the first
    loop that can be made. Every run gives the bits that `simulate` gives, whatever the number of
    workers and however the others end; `Batch` says how a run may end. `progress` is called with
    the fraction of runs done. KeyboardInterrupt stops all runs at once and keeps what is done.
    `side_by_side` says whether runs may share a march; by default they do where the code for it is
    compiled already or the batch is worth it. It changes no bit. Raises LawError where a kernel
    cannot be compiled.
    """
    probe = probe or Probe()
    grid = replace(grid, log_every=grid.steps + 1)  # one row, for the first instant
    batch = _blank(len(loops), probe)
    with interrupts_deferred():
        plan = Plan.with_probe(like, grid, probe) if like else None
        runs = _Runs(loops, grid, batch, probe, plan, progress, side_by_side)
        return replace(batch, interrupted=runs.march(workers or available_workers()))


class InvalidLoop(Exception):
    """There cannot be such a loop, or it has another structure than the batch."""


class _Runs:
    """The runs of a batch while they are made."""

    def __init__(
        self,
        loops: Loops,
        grid: TimeGrid,
        batch: Batch,
        probe: Probe,
        like: Plan | None,
        progress: Callable[[float], None] | None,
        lanes: bool | None,
    ) -> None:
        """The arguments of `simulate_many`, and the `batch` that gets the results.

        `like` is the plan of a loop like these, made of the first one if None; `lanes` is
        `side_by_side`. Nothing marches yet.
        """
        self._loops, self._grid, self._batch, self._probe = loops, grid, batch, probe
        self._plan, self._bell = like, Bell()
        self._progress = progress or (lambda fraction: None)
        self._lanes = LaneSorter(len(loops) * (grid.steps + 1), lanes)
        self._ready: list[MarchThread] = []
        self._busy: list[MarchThread] = []
        self._over, self._settled = 0, False

    def march(self, workers: int) -> bool:
        """March over all runs, `workers` at a time; an interrupt or an error stops all of them.

        Returns whether it was an interrupt. Runs are made while others march, so that the memory of
        few is needed; what is left over for lanes comes last.
        """
        try:
            for position in range(len(self._loops)):
                self._begin(position)
                self._start(workers, self._wait)
            for runs in self._lanes.rest():
                self._together(runs)
            while self._ready or self._busy:
                self._start(workers, self._wait)
                if self._busy:
                    self._wait()
        except KeyboardInterrupt:
            return True
        finally:
            self._stop()
        return False

    def _begin(self, position: int) -> None:
        """Make the run in this place, and have it march alone, or wait for others beside it."""
        run = self._try_to_make(position)
        if run:
            self._together(self._lanes.sort_in(run.vectors, run))
        else:
            self._count()

    def _together(self, runs: list[BatchRun]) -> None:
        """Have `runs` march side by side, or one by one where they are too few or may not."""
        if len(runs) >= FEWEST and self._lanes.advance:
            self._ready.append(march_together(runs, self._lanes.advance, self._bell))
        else:
            self._ready += (march_alone(run, self._march, self._bell) for run in runs)

    @cached_property
    def _march(self) -> Marcher:
        """What makes the compiled march of a run by itself."""
        assert self._plan is not None
        return marcher(self._plan, True)

    def _start(self, workers: int, wait: Callable[[], None]) -> None:
        """Start all threads that are ready; `wait` until a thread ends where `workers` are busy."""
        while self._ready:
            thread = self._ready.pop(0)
            thread.work.start()
            self._busy.append(thread)
            while len(self._busy) >= workers:
                wait()

    def _try_to_make(self, position: int) -> BatchRun | None:
        """The run in this place, or None and an entry of why there is none."""
        run = self._contain(position, lambda: BatchRun.of(position, self._check_plan(position)))
        if run and not self._settled:
            self._settle(run.plan)
        return run

    def _settle(self, plan: Plan) -> None:
        """Have the march compiled, by the first plan."""
        self._plan = self._plan or plan
        self._lanes.choose(plan)
        if not self._lanes.advance:
            self._march  # noqa: B018  a kernel that cannot be compiled ends the batch
        self._settled = True

    def _check_plan(self, position: int) -> Plan:
        """The plan of the run in this place. Raises InvalidLoop where its loop cannot be."""
        try:
            loop = self._loops[position]
            # The first plan is made like itself, too: this checks that its parts fit
            return (self._plan or Plan.with_probe(loop, self._grid, self._probe)).like(loop)
        except (PodusvError, ValueError) as error:
            raise InvalidLoop(str(error)) from error

    def _contain(self, position: int, make: Callable[[], BatchRun]) -> BatchRun | None:
        """The run that `make` makes, or None: an exception costs this run and no other.

        The batch gets the reason. Interrupts act meanwhile, since a law may take any time.
        """
        try:
            with interrupts_enabled():
                return make()
        except KeyboardInterrupt:  # the last branch would take it for an error of the law
            raise
        except InvalidLoop as error:
            self._batch.refuse(position, "invalid", str(error))
        except BaseException as error:  # a law may raise anything
            self._batch.refuse(position, "crashed", in_a_line(error))
        return None

    def _wait(self) -> None:
        """Wait a moment for a thread to end, and enter the runs of those that have, or hang."""
        with interrupts_enabled():
            self._busy[0].work.wait()  # any of them rings the bell
        for thread in [thread for thread in self._busy if thread.work.over or thread.work.hangs()]:
            self._busy.remove(thread)
            self._enter(thread)

    def _enter(self, thread: MarchThread) -> None:
        """Enter how the runs of a thread ended.

        Of several runs of which one hangs each marches again alone, which shows the one.
        """
        if thread.work.result is None and len(thread.runs) > 1:
            thread.work.stop()
            again = (BatchRun.of(run.position, run.plan) for run in thread.runs)
            self._ready += (march_alone(run, self._march, self._bell) for run in again)
            return
        for run, ending in zip(thread.runs, thread.endings(False), strict=True):
            self._batch.note(run, ending)
        for _ in thread.runs:
            self._count()

    def _count(self) -> None:
        """Count one more run as over, and tell the progress."""
        self._over += 1
        self._progress(self._over / len(self._loops))

    def _stop(self) -> None:
        """Stop all threads at their next instant, and note how far each run came.

        All are told first, so that they end at the same time.
        """
        stopped = [thread for thread in self._busy if not thread.work.over]
        for thread in stopped:
            thread.work.stop()
        for thread in self._busy:
            if thread in stopped:
                thread.work.stop_and_count()
            for run, ending in zip(thread.runs, thread.endings(thread in stopped), strict=True):
                self._batch.note(run, ending)


def _blank(count: int, probe: Probe) -> Batch:
    """A batch of `count` runs of which none has begun: NaN, and interrupted."""
    return Batch(
        status=np.full(count, "interrupted"),
        cause=np.full(count, "", object),
        reached=np.zeros(count, np.int64),
        state=np.full((count, len(STATE)), np.nan),
        seen=np.full((count, probe.size), np.nan),
    )
