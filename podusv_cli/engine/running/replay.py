"""Logged states gone through again: the rates there, and what one evaluation of a law costs."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import DEMAND_SIZE
from podusv_cli.engine.loop.closed_loop import STATE
from podusv_cli.engine.loop.columns import by_name
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.machine import signatures
from podusv_cli.engine.step import rk4
from podusv_cli.engine.step.delay_line import COUNT, DEMANDS
from podusv_cli.engine.step.layout import Layout, Vectors


def logged_rows(plan: Plan, recording: Recording, most: int) -> Vector:
    """At most `most` rows of the recording of a plan, evenly spread: (rows, 1 + 10 + 6 + slots).

    Time, target with a place for the distance and a heading, vessel's state, law's memory, as
    `rk4.evaluate_all` reads them.
    """
    times = recording["time"]
    chosen = np.linspace(0, len(times) - 1, min(most, len(times))).astype(int)
    names = [*STATE, *dict.fromkeys(plan.states["law"])]
    logged = np.column_stack([recording[name][chosen] for name in names])
    targets = plan.loop.path.whole_targets(times[chosen].tolist())
    return np.column_stack([times[chosen], targets, logged])


def replayer(
    plan: Plan, recording: Recording, *, most: int = 250, evaluations: int = 4000
) -> Callable[[], float]:
    """A function that times one evaluation of the law [ns], as the mean of one replay.

    A replay goes over at most `most` logged rows until it has `evaluations`, in machine code. So
    many that the clock's own time and resolution do not count.
    """
    from podusv_cli.engine.machine import compile  # a loop in plain Python needs no compiler

    rows, loop = logged_rows(plan, recording, most), plan.loop
    count, width = rows.shape
    rounds = -(-evaluations // count)
    # Rate, signals and scratch begin at multiples of the width, see `rk4.evaluate_all`
    room = max(width, len(loop.controller.signals)) * 2 + loop.controller.workspace()
    constants = plan.law_constants
    p = np.array(list(constants.values()))
    buffers = (rows.ravel(), p, plan.law_table, np.zeros(DEMAND_SIZE), np.zeros(room))
    vectors = [signatures.pointer(buffer) for buffer in buffers]
    replay: Callable[..., None] = compile.routine(
        compile.Piece(rk4.evaluate_all, signatures.EVALUATE_ALL)
    )
    law = compile.entry("law", loop.controller.law, tuple(constants))

    def time_law_ns() -> float:
        """The time of one evaluation of the law [ns], over all rounds."""
        began = time.thread_time_ns()  # of the processor: what else it does is not the law's
        replay(law, rounds, count, width, *vectors)
        return float((time.thread_time_ns() - began) / (rounds * count))

    return time_law_ns


@dataclass(frozen=True)
class Replayed:
    """The right-hand side at logged states: rates by the state's names, and all signals.

    `signals` holds the target's velocity and acceleration as well, and those of the law at the
    logged state, even where control is sampled.
    """

    rates: dict[str, Vector]
    signals: dict[str, Vector]


def rates_at(plan: Plan, *, compiled: bool = True) -> Callable[..., Vector]:
    """A function from rows of (t, s) to rows of the rates of s there, then the loop's row.

    The columns are `plan.names` but the time. Control is taken as continuous, also where the run's
    was sampled, and as without delay. The rates of an estimator are left out: they depend on
    measurements, which the loop's state does not hold. As second argument the function takes rows
    of demands that reach the actuator in place of the law's.
    """
    layout, vectors = plan.layout._replace(hold_every=0, measured=0), plan.vectors()
    vectors.delay_line[COUNT] = 0.0  # nothing is under way: a demand passes at once
    bound = _rates_binder(plan, compiled)
    usual = bound(vectors, layout)

    def at(rows: Vector, given: Vector | None = None) -> Vector:
        """Rates and signals (rows, states + columns) at each of `rows` (rows, 1 + states): t, s.

        `given` (rows, 2), or (rows, 3) with a sway force, are demands that act instead of those of
        the law.
        """
        out, run = np.zeros((len(rows), layout.states + layout.columns)), usual
        if given is not None:  # as if they had been on their way to the actuator
            whole = np.zeros((len(rows), DEMAND_SIZE))
            whole[:, : given.shape[1]] = given
            line = np.concatenate([np.zeros(DEMANDS), whole.ravel()])
            line[COUNT] = len(rows)
            run = bound(vectors._replace(delay_line=line), layout._replace(by_delay_line=1))
        run(len(rows), rows.ravel(), out.reshape(-1))
        return out

    return at


def rates_replay(plan: Plan, *, compiled: bool = True) -> Callable[[Recording], Replayed]:
    """A function that gives the loop's right-hand side at every row of a recording of it.

    As `rates_at` has it, in machine code if `compiled`.
    """
    labels, split, about = plan.names, 1 + plan.layout.states, plan.about
    state = list(dict.fromkeys(labels[:split]))
    rates = rates_at(plan, compiled=compiled)

    def replay_rates(recording: Recording) -> Replayed:
        """Rates and signals at each instant of a log, by name."""
        out = rates(np.column_stack([recording[name] for name in state]))
        return Replayed(
            by_name(labels[1:split], out[:, : split - 1], about),
            by_name(labels[split:], out[:, split - 1 :], about),
        )

    return replay_rates


def _rates_binder(plan: Plan, compiled: bool) -> Callable[[Vectors, Layout], Callable[..., None]]:
    """`rk4.rates_along` with the functions of this loop given, in plain Python or compiled.

    Bound to `Vectors` and `Layout`, it takes count, logged rows and out.
    """
    if not compiled:
        parts = [signatures.bind(*part) for part in plan.functions]
        return lambda *sizes: lambda *rows: rk4.rates_along(*parts, *rows, *sizes)
    from podusv_cli.engine.machine import compile  # a loop in plain Python needs no compiler

    adapters = [compile.entry(*part) for part in plan.functions]
    run = compile.routine(compile.Piece(rk4.rates_along, signatures.RATES_ALONG))

    def bind(vectors: Vectors, layout: Layout) -> Callable[..., None]:
        places, sizes = signatures.pointers(vectors), signatures.whole_numbers(layout)

        def compiled_run(count: int, logged: Vector, out: Vector) -> None:
            """Evaluate the loop at `count` logged rows, by machine code; writes `out` (flat)."""
            rows = signatures.pointer(logged), signatures.pointer(out)
            run(*adapters, count, *rows, places, sizes)

        return compiled_run

    return bind
