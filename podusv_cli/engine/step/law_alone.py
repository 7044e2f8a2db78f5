"""A sampled law without its loop: one period of it, from a sample to the next demand.

What the loop does with a law at instants and between them (`sampled`, `rk4.rates`), for whoever has
a vessel in place of the simulated one. The vectors are those of a loop whose state is (x, memory)
and whose row is (target, distance, signals, demand, tau).
"""

from __future__ import annotations

from podusv_cli.core.kernel import Vector, kernel, unpacker
from podusv_cli.engine.step.layout import Function, Layout, Vectors
from podusv_cli.engine.step.sampled import remember, sample_and_hold

named_vectors, named_layout = unpacker(Vectors._fields), unpacker(Layout._fields)


# path, law, sample and after are compiled parts; vectors and layout as in `rk4.advance`. Leaves the
# demand in the row. The memory first goes on over the period that ends, in steps of h [s]; where
# the law takes its sample into the memory first, `sample_and_hold` does that.
@kernel
def demand(
    path: Function,
    law: Function,
    sample: Function,
    after: Function,
    k: int,
    h: float,
    vectors: Vector,
    layout: Vector,
) -> None:
    """The demand for the sample that is in state and row at instant k, a multiple of the period.

    The loads in the row are those that acted since the instant before.
    """
    c, n = named_vectors(vectors), named_layout(layout)
    if k > 0 and n.update_first == 0:
        for i in range(k - n.hold_every, k):
            remember(i * h, h, h, law, after, c, n)
    sample_and_hold(k, k * h, h, path, law, sample, after, c, n)
