"""The march of several runs side by side, a run in every lane."""

from __future__ import annotations

from typing import Any

from podusv_cli.core.kernel import LANES, Vector, kernel, tail
from podusv_cli.engine.closed_loop import (
    finite,
    measure,
    named_plan,
    named_wires,
    rates,
    step,
)
from podusv_cli.engine.layout import STOP, Function
from podusv_cli.engine.sampled import sample_and_hold

REACHED = STOP + 1  # in `under_way`: by lane the instants that a run reached, or -1
EVERY = None  # the mask of all lanes


def lanes_not(mask: Any) -> Any: ...
def lanes_and(one: Any, other: Any) -> Any: ...
def lanes_any(mask: Any) -> Any: ...
def lane_true(mask: Any, lane: int) -> Any: ...
def lane_numbers(vector: Any) -> Any: ...


@kernel
def bury(k: int, lost: Any, under_way: Vector, s: Vector, row: Vector, seen: Vector,
         states: int, columns: int, size: int, ends: Vector) -> int:
    living = 0
    for lane in range(LANES):
        if under_way[REACHED + lane] < 0.0:
            if lane_true(lost, lane):
                under_way[REACHED + lane] = k
                out = tail(ends, lane * (states + columns + size))
                for i in range(states):
                    out[i] = lane_numbers(s)[i * LANES + lane]
                for i in range(columns):
                    out[states + i] = lane_numbers(row)[i * LANES + lane]
                for i in range(size):
                    out[states + columns + i] = lane_numbers(seen)[i * LANES + lane]
            else:
                living += 1
    return living


@kernel
def advance_lanes(
    path: Function, disturbance: Function, law: Function, sample: Function, actuator: Function,
    after: Function, observe: Function, first: int, last: int, h: float, wires: Any, plan: Any,
    size: int, under_way: Vector, ends: Vector,
) -> int:  # fmt: skip
    c, n = named_wires(wires), named_plan(plan)
    for k in range(first, last):
        if under_way[STOP] != 0.0:
            return k
        under_way[0] = k
        t = k * h
        again = k > first and t == (k - 1) * h + h
        if n.sample_every > 0 or n.hold_every > 0:
            sample_and_hold(EVERY, k, t, h, path, law, sample, after, c, n)
        rates(EVERY, t, c.s, c.stages, path, disturbance, law, actuator, after, c, n, again)
        measure(EVERY, c.s, c.row)
        good = lanes_and(finite(EVERY, n.states, c.s), finite(EVERY, n.columns, c.row))
        lost = lanes_not(good)
        if lanes_any(lost):
            if bury(k, lost, under_way, c.s, c.row, c.seen, n.states, n.columns, size, ends) == 0:
                return k
        weight = 0.5 * h if k == 0 or k == n.steps else h
        observe(t, weight, c.s, c.row, c.observer, c.seen)
        if k < n.steps:
            step(EVERY, k * h, h, path, disturbance, law, actuator, after, c, n)
    return last
