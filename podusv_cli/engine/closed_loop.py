"""The closed loop as kernels: right-hand side, RK4 step, and the march along the time grid.

State s: the vessel's (x, y, psi, u, v, r), then the actuator's states, then the law's memory.
Row: target, distance to it, law's signals, demand, tau, b, actuator's signals; offsets are in
`Plan`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from podusv_cli.core.kernel import Vector, kernel, tail, unpacker
from podusv_cli.vessels.plant import plant
from podusv_cli.vessels.vessel import COEFFICIENTS

Function = Callable[..., None]
LARGEST = 1e300


class Plan(NamedTuple):
    """Sizes, offsets and periods of a closed loop, all whole numbers."""

    states: int  # length of s
    memory: int  # offset of the law's memory in s
    signals: int  # offsets in the row
    demand: int
    tau: int
    b: int
    flags: int
    columns: int  # length of the row
    steps: int
    log_every: int
    hold_every: int  # 0: the law acts continuously
    sample_every: int  # 0: the law takes no samples
    load_of_time: int  # 1: the disturbance depends on time alone
    wants_loads: int  # 1: the law is told which loads really act

    @property
    def width(self) -> int:
        """Length of a logged row: t, s, row."""
        return 1 + self.states + self.columns


class Wires(NamedTuple):
    """Vectors of a closed loop: constants of every part, then what the march writes to."""

    path: Vector
    path_table: Vector
    disturbance: Vector
    disturbance_table: Vector
    law: Vector
    law_table: Vector
    actuator: Vector
    actuator_table: Vector
    vessel: Vector
    observer: Vector
    s: Vector
    row: Vector
    stages: Vector  # four rates and one intermediate state
    held: Vector  # t, x, target of the last sample; demand and signals that nobody reads
    work: Vector
    seen: Vector  # the observer's
    under_way: Vector  # the instant that is under way; then 1 if the march has to stop
    log: Vector  # rows of t, s, row


DISTANCE = 6  # where the row has z_e (18), behind the target
HELD_X, HELD_TARGET, HELD_DEMAND, HELD_SIGNALS = 1, 7, 13, 15
STOP = 1  # in `under_way`


# Vector to named coefficients of the vessel; the plant is the one part that never varies.
coefficients = unpacker(COEFFICIENTS)
# Machine code gets both as bare numbers, one by the other.
named_wires, named_plan = unpacker(Wires._fields), unpacker(Plan._fields)


@kernel
def rates(
    t: float, s: Vector, ds: Vector,
    path: Function, disturbance: Function, law: Function, actuator: Function, after: Function,
    c: Wires, n: Plan, again: bool,
) -> None:  # fmt: skip
    """Right-hand side of the closed loop at time t; leaves all signals in the row.

    `again`: the evaluation before was at this very t, so what depends on time alone is in the row.
    """
    row = c.row
    demand, tau, b = tail(row, n.demand), tail(row, n.tau), tail(row, n.b)
    memory, memory_rate = tail(s, n.memory), tail(ds, n.memory)
    p, table, work = c.law, c.law_table, c.work
    if not again:
        path(t, c.path, c.path_table, row)
    if not (again and n.load_of_time == 1):
        disturbance(t, s, c.disturbance, c.disturbance_table, b)
    if n.hold_every > 0:
        held = c.held
        law(
            held[0], tail(held, HELD_X), memory, tail(held, HELD_TARGET), p, table,
            tail(held, HELD_DEMAND), memory_rate, tail(held, HELD_SIGNALS), work,
        )  # fmt: skip
    else:
        law(t, s, memory, row, p, table, demand, memory_rate, tail(row, n.signals), work)
    actuator(
        t, s, tail(s, 6), demand, c.actuator, c.actuator_table,
        tau, tail(ds, 6), tail(row, n.flags),
    )  # fmt: skip
    if n.wants_loads > 0:
        after(t, memory, demand, tau, p, table, memory_rate)
    plant(s, tau, b, coefficients(c.vessel), ds)


@kernel
def measure(s: Vector, row: Vector) -> None:
    """The distance to the target (18)."""
    x_e, y_e = row[0] - s[0], row[1] - s[1]
    row[DISTANCE] = math.sqrt(x_e * x_e + y_e * y_e)


@kernel
def sample_and_hold(
    k: int, t: float, path: Function, law: Function, sample: Function, c: Wires, n: Plan
) -> None:
    """What happens at instants only: the law's own samples, and the hold of sampled control."""
    s, row, held = c.s, c.row, c.held
    memory = tail(s, n.memory)
    p, table = c.law, c.law_table
    path(t, c.path, c.path_table, row)
    if n.sample_every > 0 and k % n.sample_every == 0:
        sample(t, s, memory, row, p, table)
    if n.hold_every > 0 and k % n.hold_every == 0:
        held[0] = t
        for i in range(6):
            held[HELD_X + i] = s[i]
            held[HELD_TARGET + i] = row[i]
        law(
            t, s, memory, row, p, table, tail(row, n.demand), tail(c.stages, n.memory),
            tail(row, n.signals), c.work,
        )  # fmt: skip


@kernel
def shifted(count: int, s: Vector, h: float, ds: Vector, out: Vector) -> None:
    """out = s + h ds."""
    for i in range(count):
        out[i] = s[i] + h * ds[i]


@kernel
def step(
    t: float, h: float,
    path: Function, disturbance: Function, law: Function, actuator: Function, after: Function,
    c: Wires, n: Plan,
) -> None:  # fmt: skip
    """Classical RK4 from t to t + h; the first stage has been evaluated already."""
    s, count = c.s, n.states
    k1 = c.stages
    k2, k3, k4 = tail(k1, count), tail(k1, 2 * count), tail(k1, 3 * count)
    y = tail(k1, 4 * count)
    shifted(count, s, 0.5 * h, k1, y)
    rates(t + 0.5 * h, y, k2, path, disturbance, law, actuator, after, c, n, False)
    shifted(count, s, 0.5 * h, k2, y)
    rates(t + 0.5 * h, y, k3, path, disturbance, law, actuator, after, c, n, True)
    shifted(count, s, h, k3, y)
    rates(t + h, y, k4, path, disturbance, law, actuator, after, c, n, False)
    for i in range(count):
        s[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])


@kernel
def finite(count: int, vector: Vector) -> bool:
    """Whether all entries are numbers that can still be worked with."""
    bad = 0
    for i in range(count):
        bad += 0 if abs(vector[i]) <= LARGEST else 1
    return bad == 0


@kernel
def write_row(k: int, t: float, c: Wires, n: Plan) -> None:
    """Log t, s and the row."""
    s, row = c.s, c.row
    out = tail(c.log, k // n.log_every * (1 + n.states + n.columns))
    out[0] = t
    for i in range(n.states):
        out[1 + i] = s[i]
    for i in range(n.columns):
        out[1 + n.states + i] = row[i]


@kernel
def instant(
    k: int, first: int, h: float, path: Function, disturbance: Function, law: Function,
    sample: Function, actuator: Function, after: Function, observe: Function, c: Wires, n: Plan,
) -> bool:  # fmt: skip
    """Sample, evaluate, observe and log instant k; whether all its numbers are finite."""
    t = k * h
    c.under_way[0] = k
    again = k > first and t == (k - 1) * h + h  # where the last stage of the step before was
    if n.sample_every > 0 or n.hold_every > 0:
        sample_and_hold(k, t, path, law, sample, c, n)
    rates(t, c.s, c.stages, path, disturbance, law, actuator, after, c, n, again)
    measure(c.s, c.row)
    if not (finite(n.states, c.s) and finite(n.columns, c.row)):
        return False
    weight = 0.5 * h if k == 0 or k == n.steps else h
    observe(t, weight, c.s, c.row, c.observer, c.seen)
    if k % n.log_every == 0:
        write_row(k, t, c, n)
    return True


@kernel
def advance(
    path: Function, disturbance: Function, law: Function, sample: Function, actuator: Function,
    after: Function, observe: Function, first: int, last: int, h: float, wires: Any, plan: Any,
) -> int:  # fmt: skip
    """March over the instants first .. last - 1.

    Returns the first instant that is not finite, or that was not begun, or `last`.
    """
    c, n = named_wires(wires), named_plan(plan)
    for k in range(first, last):
        if c.under_way[STOP] != 0.0:
            return k
        if not instant(k, first, h, path, disturbance, law, sample, actuator, after, observe, c, n):
            return k
        if k < n.steps:
            step(k * h, h, path, disturbance, law, actuator, after, c, n)
    return last


def advance_plainly(
    path: Function, disturbance: Function, law: Function, sample: Function, actuator: Function,
    after: Function, observe: Function, first: int, last: int, h: float, c: Wires, n: Plan,
) -> int:  # fmt: skip
    """`advance` as plain Python, whose `math` raises where machine code gives no number."""
    for k in range(first, last):
        try:
            if c.under_way[STOP] != 0.0 or not instant(
                k, first, h, path, disturbance, law, sample, actuator, after, observe, c, n
            ):
                return k
        except (ArithmeticError, ValueError):
            return k
        try:
            if k < n.steps:
                step(k * h, h, path, disturbance, law, actuator, after, c, n)
        except (ArithmeticError, ValueError):
            c.s[:] = math.nan
    return last


@kernel
def evaluate_all(
    law: Function, rounds: int, count: int, width: int,
    rows: Vector, p: Vector, table: Vector, tau: Vector, out: Vector,
) -> None:  # fmt: skip
    """Call the law `rounds` times on each of `count` rows of (t, target, x, memory).

    `out` takes rate, signals and scratch, each up to `width` numbers.
    """
    for _ in range(rounds):
        for i in range(count):
            row = tail(rows, i * width)
            law(
                row[0], tail(row, 7), tail(row, 13), tail(row, 1), p, table,
                tau, out, tail(out, width), tail(out, 2 * width),
            )  # fmt: skip


@kernel
def rates_along(
    path: Function, disturbance: Function, law: Function, actuator: Function, after: Function,
    count: int, logged: Vector, out: Vector, wires: Any, plan: Any,
) -> None:  # fmt: skip
    """For each of `count` logged rows of t, s: the rates of s, then the row, into `out`."""
    c, n = named_wires(wires), named_plan(plan)
    for i in range(count):
        here = tail(logged, i * (1 + n.states))
        there = tail(out, i * (n.states + n.columns))
        rates(here[0], tail(here, 1), there, path, disturbance, law, actuator, after, c, n, False)
        measure(tail(here, 1), c.row)
        for j in range(n.columns):
            there[n.states + j] = c.row[j]
