"""The march of several runs side by side, a run in every lane.

A number that is read from a vector differs from lane to lane; what is stored differs, too.
"""

from __future__ import annotations

from typing import Any

from podusv_cli.core.kernel import LANES, Vector, kernel, lane_numbers, lane_true, lanes_any, tail
from podusv_cli.engine.step.layout import STOP, Parts, spread
from podusv_cli.engine.step.rk4 import arrive, finite, named_layout, named_vectors, show_probe, step

REACHED = STOP + 1  # in `under_way`: how many instants each lane reached, below 0 while it marches


# `vector` has LANES numbers, one a lane, for each of `count`; writes out (count).
@kernel
def copy_lane(lane: int, count: int, vector: Any, out: Vector) -> None:
    """The numbers of one lane."""
    numbers = lane_numbers(vector)
    for i in range(count):
        out[i] = numbers[i * LANES + lane]


# `vector` as in `copy_lane`.
@kernel
def follow_lane(lane: int, other: int, count: int, vector: Any) -> None:
    """Give a lane the numbers of another one."""
    numbers = lane_numbers(vector)
    for i in range(count):
        numbers[i * LANES + lane] = numbers[i * LANES + other]


# c are the vectors, n the layout, `size` the length of the probe's numbers. Writes `under_way` at
# REACHED, and `ends` (LANES, states + columns + size).
@kernel
def end_lanes(k: int, lost: Any, c: Any, n: Any, size: int, under_way: Vector, ends: Vector) -> int:
    """Keep state, row and probe's numbers of lanes that end here; how many lanes go on.

    A lane that has ended goes on with the state of one that has not, and without an effect on it: a
    loop of a law need not end for numbers that are not finite.
    """
    living, last = 0, 0
    for lane in range(LANES):
        if under_way[REACHED + lane] < 0.0:
            if lane_true(lost, lane):
                under_way[REACHED + lane] = k
                out = tail(ends, lane * (n.states + n.columns + size))
                copy_lane(lane, n.states, c.s, out)
                copy_lane(lane, n.columns, c.row, tail(out, n.states))
                copy_lane(lane, size, c.seen, tail(out, n.states + n.columns))
            else:
                living, last = living + 1, lane
    for lane in range(LANES):
        if living > 0 and lane_true(lost, lane):
            follow_lane(lane, last, n.states, c.s)
            follow_lane(lane, last, n.states, c.stages)
    return living


# `under_way` holds the instant, a flag to stop and where each lane ended; `ends` as in `end_lanes`.
# The first time a lane is lost, its numbers are put aside by `end_lanes`.
@spread
@kernel
def advance_lanes(
    p: Parts,
    first: int,
    last: int,
    h: float,
    vectors: Any,
    layout: Any,
    size: int,
    under_way: Vector,
    ends: Vector,
) -> int:
    """`rk4.advance` for all lanes, without a log.

    A lane whose numbers are not finite goes on without an effect on the others. Returns the first
    instant that was not begun, or at which no lane was left, or `last`.
    """
    c, n = named_vectors(vectors), named_layout(layout)
    for k in range(first, last):
        if under_way[STOP] != 0.0:
            return k
        under_way[0] = k
        arrive(k, first, h, p, c, n)
        lost = not (finite(n.states, c.s) and finite(n.columns, c.row))
        if lanes_any(lost) and end_lanes(k, lost, c, n, size, under_way, ends) == 0:
            return k
        show_probe(k, h, p, c, n)
        if k < n.steps:
            step(k * h, h, p, c, n)
    return last
