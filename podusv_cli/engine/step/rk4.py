"""The closed loop as kernels: right-hand side, RK4 step, and the march along the time grid.

State s: the vessel's (x, y, psi, u, v, r), the actuator's states, the estimator's, the place on a
path that is followed, the law's memory.
Row: target, distance to it, law's signals, demand, tau, b and the disturbance's signals,
actuator's signals, measured values, the target that the law is shown where that is another;
offsets are in `Layout`.
"""

from __future__ import annotations

import math
from typing import Any

from podusv_cli.components.vessels.plant import plant
from podusv_cli.components.vessels.vessel import COEFFICIENTS
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel, scratch, shared, tail, unpacker
from podusv_cli.core.signal import TARGET_SIZE
from podusv_cli.engine.step.delay_line import BEGAN, GIVEN, begin_step, pass_on
from podusv_cli.engine.step.layout import (
    DISTANCE,
    HELD_DEMAND,
    HELD_SIGNALS,
    HELD_TARGET,
    HELD_X,
    STOP,
    Function,
    Layout,
    Parts,
    Vectors,
    shift_state,
    spread,
)
from podusv_cli.engine.step.sampled import perceive, sample_and_hold

LARGEST = 1e300  # sums and differences of such numbers are still finite


# Vector to named coefficients of the vessel; the plant is the one part that never varies.
coefficients = unpacker(COEFFICIENTS)
# Machine code gets both as bare numbers, one by the other.
named_vectors, named_layout = unpacker(Vectors._fields), unpacker(Layout._fields)


# s (6 or more) state, flow (2) [m/s, rad]; writes x (6).
@kernel
def through_water(s: Vector, flow: Vector, x: Vector) -> None:
    """x = the vessel's state with (u, v) relative to water that flows at (V_c, beta_c)."""
    cosine, sine = cos_sin(flow[1] - s[2])
    for i in range(6):
        x[i] = s[i]
    x[3] -= flow[0] * cosine
    x[4] -= flow[0] * sine


# s (states); writes ds from 6 on, and the row from n.tau on. c are the vectors, n says where things
# lie. The states of the actuator follow the vessel's six.
@kernel
def drive(t: float, s: Vector, ds: Vector, demand: Vector, p: Parts, c: Vectors, n: Layout) -> None:
    """The actuator's loads, rates and signals, from the vessel's motion through the water."""
    row, x = c.row, s
    if n.flow > 0:
        x = scratch(6)
        through_water(s, tail(row, n.flow), x)
    p.actuator(
        t,
        x,
        tail(s, 6),
        demand,
        c.actuator,
        c.actuator_table,
        tail(row, n.tau),
        tail(ds, 6),
        tail(row, n.flags),
    )


# s (states); writes the row from n.b on.
@kernel
def load(t: float, s: Vector, p: Parts, c: Vectors, n: Layout, again: bool, stage: bool) -> None:
    """Put the disturbance at t and s into the row; in a stage within a step its load is enough.

    `again`: the evaluation before was at this very t, so what depends on time alone is in the row.
    """
    if not (again and n.load_of_time == 1):
        p.disturbance(
            t,
            s,
            c.disturbance,
            c.disturbance_table,
            tail(c.row, n.b),
            1.0 if again else 0.0,
            1.0 if stage else 0.0,
        )


# t [s], s (states); writes ds (states) and the row (columns). c are the vectors, n says where
# things lie. In turn: the target (again only where it depends on the state), the law, or with
# sampled control its memory alone, which `update_first` leaves to the samples; the delay line; the
# actuator; what the law makes of the loads that act; the estimator; and last the plant, which
# overwrites ds up to 6.
@kernel
def rates(t: float, s: Vector, ds: Vector, p: Parts, c: Vectors, n: Layout, again: bool) -> None:
    """Right-hand side of the closed loop at time t, whose load is in the row; fills the row.

    `again` as in `load`.
    """
    row = c.row
    demand, tau, b = tail(row, n.demand), tail(row, n.tau), tail(row, n.b)
    memory, memory_rate = tail(s, n.memory), tail(ds, n.memory)
    given, aim = tail(s, n.estimate), tail(row, n.shown)  # state and target that the law is given
    k, table, work = c.law, c.law_table, c.work
    if not again or n.follows > 0:
        p.path(t, given, tail(s, n.place), c.path, c.path_table, row, aim)
    if n.hold_every > 0 and n.update_first > 0:
        for i in range(n.states - n.memory):
            memory_rate[i] = 0.0
    elif n.hold_every > 0:
        held = c.held
        p.law(
            shared(held[0]),
            tail(held, HELD_X),
            memory,
            tail(held, HELD_TARGET),
            k,
            table,
            tail(held, HELD_DEMAND),
            memory_rate,
            tail(held, HELD_SIGNALS),
            work,
        )
    else:
        p.law(t, given, memory, aim, k, table, demand, memory_rate, tail(row, n.signals), work)
    wanted = demand
    if n.by_delay_line > 0:
        pass_on(demand, c.delay_line)
        wanted = tail(c.delay_line, GIVEN)
    drive(t, s, ds, wanted, p, c, n)
    if n.wants_loads > 0 and not (n.hold_every > 0 and n.update_first > 0):
        seen = given
        if n.hold_every > 0:
            seen = tail(c.held, HELD_X)
        p.after_saturation(t, seen, memory, demand, tau, k, table, memory_rate)
    if n.measured > 0:
        p.follow(t, c.sensed, tau, given, c.estimator, c.estimator_table, tail(ds, n.estimate))
    plant(s, tau, b, coefficients(c.vessel), ds)


# s (states); reads the target in row and writes row[DISTANCE] [m].
@kernel
def measure(s: Vector, row: Vector) -> None:
    """The distance to the target (18)."""
    x_e, y_e = row[0] - s[0], row[1] - s[1]
    row[DISTANCE] = math.sqrt(x_e * x_e + y_e * y_e)


# t, h [s]. Changes c.s; c.stages (5, states) holds k1 to k4 and the state of a stage. The third
# stage is at the time of the second, so what depends on time alone is not computed `again`.
@kernel
def step(t: float, h: float, p: Parts, c: Vectors, n: Layout) -> None:
    """Classical RK4 from t to t + h; the first stage has been evaluated already."""
    s, count = c.s, n.states
    k1 = c.stages
    k2, k3, k4 = tail(k1, count), tail(k1, 2 * count), tail(k1, 3 * count)
    y = tail(k1, 4 * count)
    shift_state(count, s, 0.5 * h, k1, y)
    load(t + 0.5 * h, y, p, c, n, False, True)
    rates(t + 0.5 * h, y, k2, p, c, n, False)
    shift_state(count, s, 0.5 * h, k2, y)
    load(t + 0.5 * h, y, p, c, n, True, True)
    rates(t + 0.5 * h, y, k3, p, c, n, True)
    shift_state(count, s, h, k3, y)
    load(t + h, y, p, c, n, False, True)
    rates(t + h, y, k4, p, c, n, False)
    for i in range(count):
        s[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])


# Counts and compares, without a way out of the loop, so that the compiler makes vector code of it.
@kernel
def finite(count: int, vector: Vector) -> bool:
    """Whether all entries are numbers that can still be worked with."""
    bad = 0
    for i in range(count):
        bad += 0 if abs(vector[i]) <= LARGEST else 1
    return bad == 0


# Writes the row of c.log that belongs to instant k.
@kernel
def write_row(k: int, t: float, c: Vectors, n: Layout) -> None:
    """Log t, s and the row."""
    s, row = c.s, c.row
    out = tail(c.log, k // n.log_every * (1 + n.states + n.columns))
    out[0] = t
    for i in range(n.states):
        out[1 + i] = s[i]
    for i in range(n.columns):
        out[1 + n.states + i] = row[i]


# h [s]; `first` is the instant at which this march began, before which no stage is known. The load
# comes before the measurement, which sees the waves; the place on the path before the samples,
# which need the target.
# `again` compares times: (k - 1) h + h may round to another number than k h, and what depends on
# the time is then computed for k h.
@kernel
def arrive(k: int, first: int, h: float, p: Parts, c: Vectors, n: Layout) -> None:
    """Measure, sample and evaluate instant k."""
    t = k * h
    again = k > first and t == (k - 1) * h + h  # where the last stage of the step before was
    if n.by_delay_line > 0:
        begin_step(k, t, c.delay_line)
    load(t, c.s, p, c, n, again, False)
    if n.measured > 0:
        perceive(k, t, p.measurement, p.correct, c, n)
    if n.follows > 0:
        p.locate(t, tail(c.s, n.estimate), c.s, tail(c.s, n.place), c.path, c.path_table)
    if n.sample_every > 0 or n.hold_every > 0:
        sample_and_hold(k, t, h, p.path, p.law, p.sample, p.after_saturation, c, n)
    rates(t, c.s, c.stages, p, c, n, again)
    measure(c.s, c.row)


# h [s]; trapezoidal sums, so the first and the last instant have half a weight.
@kernel
def show_probe(k: int, h: float, p: Parts, c: Vectors, n: Layout) -> None:
    """Show instant k to the probe, with its weight in an integral."""
    weight = 0.5 * h if k == 0 or k == n.steps else h
    p.probe(k * h, weight, c.s, c.row, c.probe, c.seen)


# h [s]; `first` is the instant at which this march began.
# What is not finite reaches neither probe nor log: what they have of the instants before is kept.
@kernel
def instant(k: int, first: int, h: float, p: Parts, c: Vectors, n: Layout) -> bool:
    """Evaluate, probe and log instant k; whether all its numbers are finite."""
    c.under_way[0] = k
    arrive(k, first, h, p, c, n)
    if not (finite(n.states, c.s) and finite(n.columns, c.row)):
        return False
    show_probe(k, h, p, c, n)
    if k % n.log_every == 0:
        write_row(k, k * h, c, n)
    return True


# h [s]; `vectors` and `layout` as machine code takes them. Behind instant n.steps there is no step.
@spread
@kernel
def advance(p: Parts, first: int, last: int, h: float, vectors: Any, layout: Any) -> int:
    """March over the instants first .. last - 1.

    Returns the first instant that is not finite, or that was not begun, or `last`.
    """
    c, n = named_vectors(vectors), named_layout(layout)
    for k in range(first, last):
        if c.under_way[STOP] != 0.0 or not instant(k, first, h, p, c, n):
            return k
        if k < n.steps:
            step(k * h, h, p, c, n)
    return last


def advance_plainly(p: Parts, first: int, last: int, h: float, c: Vectors, n: Layout) -> int:
    """`advance` as plain Python, whose `math` raises where machine code gives no number.

    March from instant `first` to `last`, step `h` [s], over the vectors `c` laid out by `n`, with
    the functions `p`; returns the instant that was reached. An error within an instant ends the
    march there; one within a step makes the next instant's state NaN, as machine code would.
    """
    for k in range(first, last):
        try:
            if c.under_way[STOP] != 0.0 or not instant(k, first, h, p, c, n):
                return k
        except (ArithmeticError, ValueError):
            return k
        try:
            if k < n.steps:
                step(k * h, h, p, c, n)
        except (ArithmeticError, ValueError):
            c.s[:] = math.nan
    return last


# rows (count, width); tau (2) and out are overwritten by each call: only the time matters.
@kernel
def evaluate_all(
    law: Function,
    rounds: int,
    count: int,
    width: int,
    rows: Vector,
    p: Vector,
    table: Vector,
    tau: Vector,
    out: Vector,
) -> None:
    """Call the law `rounds` times on each of `count` rows of (t, target, x, memory).

    `out` takes rate, signals and scratch, each up to `width` numbers.
    """
    for _ in range(rounds):
        for i in range(count):
            row = tail(rows, i * width)
            law(
                row[0],
                tail(row, 1 + TARGET_SIZE),
                tail(row, 7 + TARGET_SIZE),
                tail(row, 1),
                p,
                table,
                tau,
                out,
                tail(out, width),
                tail(out, 2 * width),
            )


# logged (count, 1 + states), out (count, states + columns). Each row stands alone, so nothing is
# known of a stage before.
@spread
@kernel
def rates_along(
    p: Parts, count: int, logged: Vector, out: Vector, vectors: Any, layout: Any
) -> None:
    """For each of `count` logged rows of t, s: the rates of s, then the row, into `out`."""
    c, n = named_vectors(vectors), named_layout(layout)
    for i in range(count):
        here = tail(logged, i * (1 + n.states))
        there = tail(out, i * (n.states + n.columns))
        if n.by_delay_line > 0:
            c.delay_line[BEGAN] = here[0]
        load(here[0], tail(here, 1), p, c, n, False, False)
        rates(here[0], tail(here, 1), there, p, c, n, False)
        measure(tail(here, 1), c.row)
        for j in range(n.columns):
            there[n.states + j] = c.row[j]
