"""Many runs at once: one thread a core, each taking run after run through the compiled march.

The march gives up the interpreter's lock, so threads are all it takes; the machine code is that of
`simulate`. No log is kept: what is wanted of a run is what its observer gathers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from threading import Event
from typing import Any

import numpy as np
import numpy.typing as npt

from podusv_cli.core.kernel import LANES, Vector, whole_lanes
from podusv_cli.engine.closed_loop import Plan, Wires
from podusv_cli.engine.grid import TimeGrid
from podusv_cli.engine.march import Pace, in_blocks
from podusv_cli.engine.simulate import (
    STATE,
    ClosedLoop,
    Observer,
    entries,
    marcher,
    wire,
)
from podusv_cli.process.workers import workers_here

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
    stops all within a block of the march and keeps what is done. Raises ValueError for loops of
    different structure: other kinds, other sizes of memory, other sampling.
    """
    observer = observer or Observer()
    grid = replace(grid, log_every=grid.steps + 1)  # one row, for the first instant
    plan = _common_plan(loops, grid, observer)
    batch = _blank(len(loops), observer)
    if plan is None:
        return batch
    march, stop, pace = marcher(loops[0], observer, True), Event(), Pace()

    def go_on(fraction: float) -> None:
        if fraction < 1.0 and stop.is_set():
            raise KeyboardInterrupt

    def run(i: int) -> None:
        go_on(0.0)
        wires = _apart(wire(loops[i], plan, observer))
        batch.reached[i], batch.status[i], _ = in_blocks(
            lambda a, b: march(a, b, grid.step, wires, plan), plan, wires.under_way, go_on,
            pace=pace,
        )  # fmt: skip
        batch.state[i], batch.seen[i] = wires.s[: len(STATE)], wires.seen

    _shared_out(run, len(loops), workers or workers_here(), stop, progress)
    return batch


def _shared_out(
    run: Callable[[int], None], count: int, workers: int, stop: Event,
    progress: Callable[[float], None] | None,
) -> None:  # fmt: skip
    """All runs through a pool of threads; an interrupt or an error in one stops the others."""
    with ThreadPoolExecutor(workers) as pool:
        try:
            jobs = [pool.submit(run, i) for i in range(count)]
            for done, job in enumerate(as_completed(jobs), 1):
                job.result()
                if progress:
                    progress(done / count)
        except KeyboardInterrupt:
            pass
        finally:
            stop.set()
            pool.shutdown(cancel_futures=True)


def _blank(count: int, observer: Observer) -> Batch:
    return Batch(
        status=np.full(count, "interrupted"), reached=np.zeros(count, np.int64),
        state=np.full((count, len(STATE)), np.nan), seen=np.full((count, observer.size), np.nan),
    )  # fmt: skip


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
