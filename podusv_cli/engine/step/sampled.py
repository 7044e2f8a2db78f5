"""What happens at instants only: measurements, and the samples of sampled control."""

from __future__ import annotations

from podusv_cli.components.measurements.base import KNOWN
from podusv_cli.core.kernel import Vector, kernel, shared, tail
from podusv_cli.engine.step.layout import (
    BEFORE,
    HELD_DEMAND,
    HELD_SIGNALS,
    HELD_TARGET,
    HELD_X,
    Function,
    Layout,
    Vectors,
    shift_state,
)


# Reads memory; writes rate, both as long as the law's memory. c are the vectors, n the layout. What
# else the law writes goes into c.held, where nobody reads it.
@kernel
def held_rates(
    t: float, memory: Vector, rate: Vector, law: Function, after: Function, c: Vectors, n: Layout
) -> None:
    """Rates of the law's memory at t with the last sample held, while the loads in the row act."""
    row, held = c.row, c.held
    law(
        shared(held[0]),
        tail(held, HELD_X),
        memory,
        tail(held, HELD_TARGET),
        c.law,
        c.law_table,
        tail(held, HELD_DEMAND),
        rate,
        tail(held, HELD_SIGNALS),
        c.work,
    )
    if n.wants_loads > 0:
        x, demand, tau = tail(held, HELD_X), tail(row, n.demand), tail(row, n.tau)
        after(t, x, memory, demand, tau, c.law, c.law_table, rate)


# t [s]. Changes the law's memory in c.s, with c.stages as its room. h and `passing` [s] differ
# where the law's own time stands still. k1 to k4 and y, the state of a stage, are (states -
# memory,).
@kernel
def remember(
    t: float, passing: float, h: float, law: Function, after: Function, c: Vectors, n: Layout
) -> None:
    """A step h of RK4 of the law's memory, with the sample held; the time goes on by `passing`."""
    count, memory = n.states - n.memory, tail(c.s, n.memory)
    k1 = tail(c.stages, n.memory)
    k2, k3, k4 = tail(k1, n.states), tail(k1, 2 * n.states), tail(k1, 3 * n.states)
    y = tail(k1, 4 * n.states)
    held_rates(t, memory, k1, law, after, c, n)
    shift_state(count, memory, 0.5 * h, k1, y)
    held_rates(t + 0.5 * passing, y, k2, law, after, c, n)
    shift_state(count, memory, 0.5 * h, k2, y)
    held_rates(t + 0.5 * passing, y, k3, law, after, c, n)
    shift_state(count, memory, h, k3, y)
    held_rates(t + passing, y, k4, law, after, c, n)
    for i in range(count):
        memory[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])


# k and t [s] are the instant, h [s] the step; changes the law's memory in c.s, and c.held: time,
# state, target, demand, signals. The law's own sample comes first, then what is held, then with
# `update_first` the period that ends, then the demand. The rate that the law writes here is not
# used.
@kernel
def sample_and_hold(
    k: int,
    t: float,
    h: float,
    path: Function,
    law: Function,
    sample: Function,
    after: Function,
    c: Vectors,
    n: Layout,
) -> None:
    """What happens at instants only: the law's own samples, and the hold of sampled control."""
    given, row, held = tail(c.s, n.estimate), c.row, c.held
    memory, aim = tail(c.s, n.memory), tail(row, n.shown)
    p, table = c.law, c.law_table
    path(t, given, tail(c.s, n.place), c.path, c.path_table, row, aim)
    if n.sample_every > 0 and k % n.sample_every == 0:
        sample(t, given, memory, aim, p, table)
    if n.hold_every > 0 and k % n.hold_every == 0:
        held[0] = t
        for i in range(6):
            held[HELD_X + i] = given[i]
        for i in range(n.target):
            held[HELD_TARGET + i] = aim[i]
        if n.update_first > 0 and k > 0:
            for _ in range(n.hold_every):  # the period that ends, with its loads
                remember(t, 0.0, h, law, after, c, n)
        law(
            t,
            given,
            memory,
            aim,
            p,
            table,
            tail(row, n.demand),
            tail(c.stages, n.memory),
            tail(row, n.signals),
            c.work,
        )


# t [s]. Writes c.sensed, the row and the estimate in c.s. `before` keeps the estimate that the
# metrics need from the other side of a jump; the row has those quantities only that are measured at
# all.
@kernel
def perceive(
    k: int, t: float, measurement: Function, correct: Function, c: Vectors, n: Layout
) -> None:
    """Measure at instant k, and take what is delivered into the estimate.

    Leaves the measured values behind the other signals in the row, which has the disturbance, and
    the estimate as it was before behind the row's columns.
    """
    b, sensed, measured = tail(c.row, n.b), c.sensed, tail(c.row, n.sensed)
    given, before = tail(c.s, n.estimate), tail(c.row, n.columns)
    for i in range(BEFORE):
        before[i] = given[i]
    measurement(t, float(k), c.s, b, c.measurement, c.measurement_table, sensed)
    correct(t, sensed, given, c.estimator, c.estimator_table)
    logged = 0
    for i in range(6):
        if shared(sensed[KNOWN + i]) != 0.0:
            measured[logged] = sensed[i]
            logged += 1
