"""Many runs at once, each in a thread, as many at a time as there are cores.

The compiled march releases the interpreter's lock, so threads are enough. The compiled code is that
of `simulate`. No log is kept; a run's observer gathers what is wanted of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from typing import Any

import numpy as np
import numpy.typing as npt

from podusv_cli.core.kernel import LANES, Vector, whole_lanes
from podusv_cli.engine.closed_loop import Plan, Wires
from podusv_cli.engine.grid import TimeGrid
from podusv_cli.engine.march import Bell, Ending, Work
from podusv_cli.engine.simulate import STATE, ClosedLoop, Observer, entries, marcher, wire
from podusv_cli.process.interrupts import interrupts_deferred, interrupts_enabled
from podusv_cli.process.workers import available_workers

NUMBER = 8  # bytes; LANES numbers are a cache line


@dataclass(frozen=True)
class Batch:
    """How N runs ended and what was gathered in them, one entry or row a run.

    `status` holds the words of `Recording.status`; a run that an interrupt kept from beginning is
    `interrupted` with 0 instants reached and NaN in its rows.
    """

    status: npt.NDArray[np.str_]  # (N,)
    reached: npt.NDArray[np.int64]  # (N,), good instants; steps + 1 for a finished run
    state: Vector  # (N, 6), the vessel's state where the march ended
    seen: Vector  # (N, observer.size)

    def note(self, run: BatchRun, ending: Ending) -> None:
        """Enter how a run ended."""
        i, wires = run.position, run.wires
        self.reached[i], self.status[i], _ = ending
        self.state[i], self.seen[i] = wires.s[: len(STATE)], wires.seen


@dataclass(frozen=True, eq=False)
class BatchRun:
    """One run of a batch."""

    position: int
    wires: Wires
    work: Work


def simulate_many(
    loops: Sequence[ClosedLoop],
    grid: TimeGrid,
    *,
    observer: Observer | None = None,
    workers: int = 0,
    progress: Callable[[float], None] | None = None,
) -> Batch:
    """Integrate loops of one structure over the grid, `workers` at a time (0: one a core).

    Every run gives the bits that `simulate` gives, whatever the number of workers; one that
    diverges ends by itself. `progress` is called with the fraction of runs done. KeyboardInterrupt
    stops all runs at once and keeps what is done. Raises ValueError for loops of different
    structure: other kinds, other sizes of memory, other sampling.
    """
    observer = observer or Observer()
    grid = replace(grid, log_every=grid.steps + 1)  # one row, for the first instant
    plan = _common_plan(loops, grid, observer)
    batch = Batch(
        status=np.full(len(loops), "interrupted"), reached=np.zeros(len(loops), np.int64),
        state=np.full((len(loops), len(STATE)), np.nan),
        seen=np.full((len(loops), observer.size), np.nan),
    )  # fmt: skip
    if plan is None:
        return batch
    advance, last, bell = marcher(loops[0], observer, True), grid.steps + 1, Bell()

    def run(i: int) -> BatchRun:
        wires = _apart(wire(loops[i], plan, observer))
        function = partial(advance, 0, last, grid.step, wires, plan)
        return BatchRun(i, wires, Work(function, wires.under_way, bell))

    def tell(done: int) -> None:
        if progress:
            progress(done / len(loops))

    with interrupts_deferred():
        _march_all(map(run, range(len(loops))), last, workers or available_workers(), batch, tell)
    return batch


def _march_all(
    runs: Iterator[BatchRun], last: int, workers: int, batch: Batch, progress: Callable[[int], None]
) -> None:
    """March over all runs; an interrupt or an error stops those that are under way."""
    busy: list[BatchRun] = []
    done = 0
    try:
        while True:
            for run in islice(runs, workers - len(busy)):
                run.work.start()
                busy.append(run)
            if not busy:
                break
            with interrupts_enabled():
                busy[0].work.wait()  # any of them rings the bell
            for run in [run for run in busy if run.work.over or run.work.hangs()]:
                busy.remove(run)
                batch.note(run, run.work.ending(last))
                done += 1
                progress(done)
    except KeyboardInterrupt:
        pass
    finally:
        for run in busy:
            run.work.stop()
        for run in busy:
            batch.note(run, run.work.interrupted(last))


def _common_plan(loops: Sequence[ClosedLoop], grid: TimeGrid, observer: Observer) -> Plan | None:
    """The layout that all loops share, None where there are none."""
    found: tuple[Plan, list[Any]] | None = None
    for i, loop in enumerate(loops):
        structure = loop.layout(grid), list(entries(loop, observer))
        found = found or structure
        if structure != found:
            raise ValueError(
                f"run {i} has another structure than run 0: {_kinds(loop)} with {structure[0]}, "
                f"not {_kinds(loops[0])} with {found[0]}; runs of one batch differ in numbers only"
            )
    return found[0] if found else None


def _kinds(loop: ClosedLoop) -> str:
    parts = (loop.path, loop.disturbance, loop.actuator, loop.controller)
    return ", ".join(type(part).__name__ for part in parts)


def _apart(wires: Wires) -> Wires:
    """The vectors in memory of their own, each from a new cache line on.

    Cores that write to one line wait for each other.
    """
    ends = np.cumsum([0, *(whole_lanes(len(vector)) for vector in wires)]).tolist()
    room = np.zeros(ends[-1] + LANES)
    room = room[-(room.ctypes.data // NUMBER) % LANES :]
    own = [room[at : at + len(v)] for at, v in zip(ends, wires, strict=False)]
    for vector, content in zip(own, wires, strict=True):
        vector[:] = content
    return Wires(*own)
