"""A sampled law without its loop: one period of it, from a sample to the next demand.

What the loop does with a law at instants and between them (`sampled`, `rk4.rates`), for whoever has
a vessel in place of the simulated one. The vectors are those of a loop whose state is (x, memory)
and whose row is (target, distance, signals, demand, tau).
"""

from __future__ import annotations

from podusv_cli.core.kernel import Vector, kernel, tail, unpacker
from podusv_cli.engine.step.layout import (
    HELD_DEMAND,
    HELD_SIGNALS,
    HELD_TARGET,
    HELD_X,
    Function,
    Layout,
    Vectors,
    shifted,
)
from podusv_cli.engine.step.sampled import sample_and_hold

named_vectors, named_layout = unpacker(Vectors._fields), unpacker(Layout._fields)


@kernel
def target_is_there(
    t: float, x: Vector, place: Vector, k: Vector, table: Vector, target: Vector
) -> None:
    """Stands for the path: the row has the target already."""


@kernel
def rates_of_held(
    t: float, memory: Vector, rate: Vector, law: Function, after: Function, c: Vectors, n: Layout
) -> None:
    """Rates of the memory while the sample is held and the loads in the row act."""
    row, held = c.row, c.held
    law(
        held[0], tail(held, HELD_X), memory, tail(held, HELD_TARGET), c.law, c.law_table,
        tail(held, HELD_DEMAND), rate, tail(held, HELD_SIGNALS), c.work,
    )  # fmt: skip
    if n.wants_loads > 0:
        after(t, memory, tail(row, n.demand), tail(row, n.tau), c.law, c.law_table, rate)


@kernel
def hold(first: int, h: float, law: Function, after: Function, c: Vectors, n: Layout) -> None:
    """The memory over the period from this instant on, by RK4."""
    count, memory = n.states - n.memory, tail(c.s, n.memory)
    k1 = c.stages
    k2, k3, k4 = tail(k1, count), tail(k1, 2 * count), tail(k1, 3 * count)
    y = tail(k1, 4 * count)
    for i in range(first, first + n.hold_every):
        t = i * h
        rates_of_held(t, memory, k1, law, after, c, n)
        shifted(count, memory, 0.5 * h, k1, y)
        rates_of_held(t + 0.5 * h, y, k2, law, after, c, n)
        shifted(count, memory, 0.5 * h, k2, y)
        rates_of_held(t + 0.5 * h, y, k3, law, after, c, n)
        shifted(count, memory, h, k3, y)
        rates_of_held(t + h, y, k4, law, after, c, n)
        for j in range(count):
            memory[j] += h / 6.0 * (k1[j] + 2.0 * (k2[j] + k3[j]) + k4[j])


@kernel
def demand(
    path: Function, law: Function, sample: Function, after: Function,
    k: int, h: float, vectors: Vector, layout: Vector,
) -> None:  # fmt: skip
    """The demand for the sample that is in state and row at instant k, a multiple of the period.

    The loads in the row are those that acted since the instant before.
    """
    c, n = named_vectors(vectors), named_layout(layout)
    if k > 0 and n.update_first == 0:
        hold(k - n.hold_every, h, law, after, c, n)
    sample_and_hold(k, k * h, h, path, law, sample, after, c, n)
