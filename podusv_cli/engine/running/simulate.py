"""From components to a recording: march over the grid, name the columns."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Allocate, Recording, Status
from podusv_cli.engine.loop.closed_loop import DEMAND, STATE, ClosedLoop, Probe
from podusv_cli.engine.loop.columns import by_name
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.machine import signatures
from podusv_cli.engine.running.check import ask_part, check_law
from podusv_cli.engine.running.thread import Ending, MarchStatus, Work, march, march_together
from podusv_cli.engine.step import rk4
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.engine.step.layout import BEFORE, STEPS, Layout, Parts, Vectors
from podusv_cli.process.interrupts import interrupts_deferred

# Over instants first .. last - 1, see `rk4.advance`; a third number stands for the grid's steps
March = Callable[..., int]
Marcher = Callable[[Vectors, Layout, float], March]  # of vectors, with a step [s]
# What a log says of a run, by how its march ended.
RECORDED: dict[MarchStatus, Status] = {
    "finished": "finished",
    "interrupted": "interrupted",
    "diverged": "diverged",
    "crashed": "diverged",
    "hung": "diverged",
}


def simulate(
    loop: ClosedLoop,
    grid: TimeGrid,
    *,
    probe: Probe | None = None,
    compiled: bool = True,
    progress: Callable[[float], None] | None = None,
    allocate: Allocate = np.empty,
) -> Recording:
    """Plan the closed loop and integrate it over the grid; see `run` for the arguments.

    The `probe` sees every instant, logged or not.
    """
    plan = Plan.with_probe(loop, grid, probe or Probe())
    return run(plan, compiled=compiled, progress=progress, allocate=allocate)


def run(
    plan: Plan,
    *,
    compiled: bool = True,
    progress: Callable[[float], None] | None = None,
    allocate: Allocate = np.empty,
) -> Recording:
    """Integrate a loop over its grid.

    `progress` is called with the fraction done, about 20 times a second. An interrupt ends the
    march and keeps what was logged. `compiled=False` runs the same kernels as plain Python.
    `allocate` gives the room for the logged rows; the recording's signals are views of it.
    """
    # Asked before the march, as it raises for signals of one name
    about = plan.about
    vectors, last, advance = begin_march(plan, compiled, allocate)
    # A run that diverges overflows before it ends, and its recording tells
    with np.errstate(all="ignore"), interrupts_deferred():
        ending = march(
            advance,
            last,
            vectors.under_way,
            progress and (lambda reached: progress(reached / last)),
        )
        return replace(recording_of(plan, vectors, ending), about=about)


def begin_march(
    plan: Plan, compiled: bool, allocate: Allocate = np.empty
) -> tuple[Vectors, int, Callable[[], int]]:
    """The vectors of a loop at its start, the instant after the last, and the march up to it.

    The march is `compiled` or plain Python; it takes no arguments, and returns the instant that it
    reached. `allocate` gives room for the log. Raises LawError for parts that do not fit.
    """
    plan.loop.check_fit(plan.grid.step)
    # Instants are 0 to `steps`, and a march leaves its last number out
    vectors, last = plan.vectors(plan.grid.rows, allocate), plan.layout.steps + 1
    advance = marcher(plan, compiled)(vectors, plan.layout, plan.grid.step)
    return vectors, last, partial(advance, 0, last)


def run_together(plans: Sequence[Plan], *, compiled: bool = True) -> list[Recording]:
    """Integrate several loops at once, each in a thread of its own.

    Returns for each of `plans` the recording that `run` gives. An interrupt ends all marches and
    keeps what was logged.
    """
    begun = [begin_march(plan, compiled) for plan in plans]
    works = [Work(advance, vectors.under_way) for vectors, _, advance in begun]
    with np.errstate(all="ignore"), interrupts_deferred():
        endings = march_together(works, [last for _, last, _ in begun])
        return [
            replace(recording_of(plan, vectors, ending), about=plan.about)
            for plan, (vectors, *_), ending in zip(plans, begun, endings, strict=True)
        ]


def to_end(
    plan: Plan, *, compiled: bool = True, progress: Callable[[float], None] | None = None
) -> Recording:
    """As `run`, for work that needs the whole run: an interrupt raises KeyboardInterrupt."""
    recording = run(plan, compiled=compiled, progress=progress)
    if recording.status == "interrupted":
        raise KeyboardInterrupt
    return recording


def ready(plan: Plan, compiled: bool, compiling: Callable[[float], None] | None = None) -> None:
    """Make every check of a run before its first step, and have its march compiled and loaded.

    `compiling` is called with the fraction that is compiled, if there is anything to compile.
    Raises LawError.
    """
    check_law(plan)
    plan.loop.check_fit(plan.grid.step)
    ask_part(lambda: "the closed loop", plan.vectors)
    marcher(plan, compiled, compiling)


def marcher(
    plan: Plan, compiled: bool, compiling: Callable[[float], None] | None = None
) -> Marcher:
    """What makes the march of loops like the plan's over such vectors, with a step [s].

    It is compiled if need be, and `compiling` hears the fraction. A march keeps its vectors.
    """
    if not compiled:
        p = Parts(*(signatures.bind(*part) for part in plan.functions))
        return lambda c, n, h: (
            lambda first, last, steps=None: rk4.advance_plainly(
                p, first, last, h, c, n if steps is None else n._replace(steps=steps)
            )
        )
    from podusv_cli.engine.machine import compile  # a loop in plain Python needs no compiler

    march = compile.Piece(rk4.advance, signatures.ADVANCE)
    compile.prepare([*(compile.adapter(*part) for part in plan.functions), march], compiling)
    adapters, routine = [compile.entry(*part) for part in plan.functions], compile.routine(march)

    def over(vectors: Vectors, layout: Layout, h: float) -> March:
        """A function that marches one run over these vectors, with step `h` [s]."""
        pointers, sizes = signatures.pointers(vectors), signatures.whole_numbers(layout)

        def march(first: int, last: int, steps: int = layout.steps) -> int:
            """March from instant `first` up to `last`; the instant that was reached."""
            sizes[STEPS] = steps
            return int(routine(*adapters, first, last, h, pointers, sizes))

        return march

    return over


def recording_of(plan: Plan, vectors: Vectors, ending: Ending) -> Recording:
    """The recording of a march over these vectors that ended so, its signals views of the log.

    A law that crashed or hung counts as diverged; the message says when and why.
    """
    layout, law = plan.layout, plan.loop.controller
    rows = -(-ending.reached // layout.log_every)  # rounded up: instant 0 is logged
    table = vectors.log.reshape(-1, layout.width)[:rows]
    named = by_name(plan.names, table, plan.about)
    signals = {name: column for name, column in named.items() if name in plan.about}
    status, message = RECORDED[ending.status], ""
    if status == "interrupted":
        # As many instants are good as were reached, and the first is at t = 0
        message = f"interrupted after t = {max(ending.reached - 1, 0) * plan.grid.step:.6g} s"
    if status == "diverged":
        message = f"diverged {why(plan, vectors, ending)}; {_last_words(signals)}"
    fixed = {part.name: array for part, array in law.fixed_signals().items()}
    return Recording(status, law.label, signals, fixed, vectors.seen.copy(), message)


def why(plan: Plan, vectors: Vectors, ending: Ending) -> str:
    """When and why a march that nobody interrupted did not reach its last instant, in words."""
    at = ending.reached * plan.grid.step
    return f"at t = {at:.6g} s: {ending.cause or _culprit(vectors, plan.names, at)}"


def _culprit(vectors: Vectors, labels: list[str], at: float) -> str:
    """Which state or signal is the first that is not finite, or beyond `LARGEST`, in words.

    `labels` are `Plan.names`, `at` [s] is the time. The estimate behind the row has no name.
    """
    now = np.concatenate([[at], vectors.s, vectors.row[:-BEFORE]])
    named = zip(labels, now, strict=True)
    # So written it finds NaN, too
    bad = next((name for name, x in named if not abs(x) <= rk4.LARGEST), "?")
    return f"{bad} is not finite"


def _last_words(signals: Mapping[str, Vector]) -> str:
    """The last logged values, for the message of a run that diverged."""
    last = ", ".join(
        f"{name} {signals[name][-1]:.4g}"
        for name in ("time", *STATE, *DEMAND)
        if len(signals[name])
    )
    return f"last logged values: {last or 'none'}"
