"""From components to a recording: march over the grid, name the columns."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Allocate, Recording, Status
from podusv_cli.engine.loop.closed_loop import (
    DEMAND,
    STATE,
    ClosedLoop,
    Observer,
    entries,
    vectors_of,
)
from podusv_cli.engine.loop.columns import by_name, names
from podusv_cli.engine.machine import signatures
from podusv_cli.engine.running.check import asked, check_law
from podusv_cli.engine.running.watch import Ending, Word, watch
from podusv_cli.engine.step import rk4
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.engine.step.layout import STEPS, Layout, Parts, Vectors
from podusv_cli.process.interrupts import interrupts_deferred

# Over instants first .. last - 1, see `rk4.advance`; a third number stands for the grid's steps
March = Callable[..., int]
Marcher = Callable[[Vectors, Layout, float], March]  # of vectors, with a step [s]
# What a log says of a run, by how its march ended.
RECORDED: dict[Word, Status] = {
    "finished": "finished", "interrupted": "interrupted",
    "diverged": "diverged", "crashed": "diverged", "hung": "diverged",
}  # fmt: skip


def simulate(
    loop: ClosedLoop,
    grid: TimeGrid,
    *,
    observer: Observer | None = None,
    compiled: bool = True,
    progress: Callable[[float], None] | None = None,
    allocate: Allocate = np.empty,
) -> Recording:
    """Integrate the closed loop over the grid.

    `progress` is called with the fraction done, about 20 times a second. An interrupt ends the
    march and keeps what was logged. `compiled=False` runs the same kernels as plain Python.
    `allocate` gives the room for the logged rows; the recording's signals are views of it.
    """
    observer, about = observer or Observer(), loop.about()
    loop.check_fit(grid.step)
    layout = loop.layout(grid)
    vectors, last = vectors_of(loop, layout, observer, grid, grid.rows, allocate), layout.steps + 1
    advance = partial(marcher(loop, observer, compiled)(vectors, layout, grid.step), 0, last)
    with np.errstate(all="ignore"), interrupts_deferred():
        ending = watch(
            advance, last, vectors.under_way,
            progress and (lambda reached: progress(reached / last)),
        )  # fmt: skip
        return replace(recorded(loop, grid, vectors, layout, ending), about=about)


def ready(
    loop: ClosedLoop, grid: TimeGrid, observer: Observer, compiled: bool,
    compiling: Callable[[float], None] | None = None,
) -> None:  # fmt: skip
    """Make every check of a run before its first step, and have its march compiled and loaded.

    `compiling` is called with the fraction that is compiled, if there is anything to compile.
    Raises LawError.
    """
    check_law(loop)
    loop.check_fit(grid.step)
    asked(lambda: "the closed loop", partial(vectors_of, loop, loop.layout(grid), observer, grid))
    marcher(loop, observer, compiled, compiling)


def marcher(
    loop: ClosedLoop, observer: Observer, compiled: bool,
    compiling: Callable[[float], None] | None = None,
) -> Marcher:  # fmt: skip
    """What makes the march of loops like this one over such vectors, with a step [s].

    It is compiled if need be. The vectors have to outlive the march.
    """
    if not compiled:
        p = Parts(*(signatures.bind(*part) for part in entries(loop, observer)))
        return lambda c, n, h: (
            lambda first, last, steps=None: rk4.advance_plainly(
                p, first, last, h, c, n if steps is None else n._replace(steps=steps)
            )
        )
    from podusv_cli.engine.machine import compile  # a loop in plain Python needs no compiler

    parts, march = [*entries(loop, observer)], compile.Piece(rk4.advance, signatures.ADVANCE)
    compile.prepare([*(compile.adapter(*part) for part in parts), march], compiling)
    adapters, watch = [compile.entry(*part) for part in parts], compile.routine(march)

    def over(vectors: Vectors, layout: Layout, h: float) -> March:
        pointers, sizes = signatures.pointers(vectors), signatures.whole_numbers(layout)

        def march(first: int, last: int, steps: int = layout.steps) -> int:
            sizes[STEPS] = steps
            return int(watch(*adapters, first, last, h, pointers, sizes))

        return march

    return over


def _logged(loop: ClosedLoop, table: Vector) -> dict[str, Vector]:
    """The signals of a recording in a table of logged rows."""
    about = loop.about()
    named = by_name(names(loop), table, about)
    return {name: column for name, column in named.items() if name in about}


def recorded(
    loop: ClosedLoop, grid: TimeGrid, vectors: Vectors, layout: Layout, ending: Ending
) -> Recording:
    """The recording of a march that ended so, its signals views of the log."""
    rows = -(-ending.reached // layout.log_every)
    signals = _logged(loop, vectors.log.reshape(-1, layout.width)[:rows])
    status, message = RECORDED[ending.status], ""
    if status == "interrupted":
        message = f"interrupted after t = {max(ending.reached - 1, 0) * grid.step:.6g} s"
    if status == "diverged":
        message = f"diverged {why(ending, loop, grid, vectors)}; {_last_words(signals)}"
    fixed = {part.name: array for part, array in loop.controller.fixed_signals().items()}
    return Recording(status, loop.controller.label, signals, fixed, vectors.seen.copy(), message)


def why(ending: Ending, loop: ClosedLoop, grid: TimeGrid, vectors: Vectors) -> str:
    """When and why a march that nobody interrupted did not reach its last instant."""
    at = ending.reached * grid.step
    return f"at t = {at:.6g} s: {ending.cause or _culprit(vectors, names(loop), at)}"


def _culprit(vectors: Vectors, labels: list[str], at: float) -> str:
    now = np.concatenate([[at], vectors.s, vectors.row])
    named = zip(labels, now, strict=True)
    bad = next((name for name, x in named if not abs(x) <= rk4.LARGEST), "?")
    return f"{bad} is not finite"


def _last_words(signals: Mapping[str, Vector]) -> str:
    last = ", ".join(
        f"{name} {signals[name][-1]:.4g}"
        for name in ("time", *STATE, *DEMAND)
        if len(signals[name])
    )
    return f"last logged values: {last or 'none'}"
