"""The delay line: the way of a demand to an actuator that has a command path, or that fails.

A delay of m steps gives a stage of the RK4 step the demand that the law formed at the same stage m
steps before. That is RK4 for the delay differential equation as one large ordinary one (the method
of steps; Bellen and Zennaro, Numerical Methods for Delay Differential Equations, 2003): fourth
order without any interpolation, and exact for a demand that is held.
"""

from __future__ import annotations

import numpy as np

from podusv_cli.core.kernel import Vector, kernel, shared, tail
from podusv_cli.core.signal import DEMAND_SIZE
from podusv_cli.core.steps import whole_steps
from podusv_cli.engine.step.grid import TimeGrid

STAGES = 4  # of a step of RK4
# In the vector: the place of the next demand, how many are under way, what the actuator is given
# (a demand, when the step began [s]), then the demands under way.
NEXT, COUNT, GIVEN = 0, 1, 2
BEGAN = GIVEN + DEMAND_SIZE
DEMANDS = BEGAN + 1


def delay_line(delay: float, grid: TimeGrid) -> Vector:
    """The vector (n,) at the start of a run, laid out as above: zero demands are under way.

    Raises ValueError for a delay [s] that is no whole number of steps.
    """
    steps = whole_steps(delay, grid.step)
    if steps is None or (delay > 0 and steps == 0):
        raise ValueError(
            f"the actuator's command is delayed by {delay:g} s, no whole number of steps of "
            f"{grid.step:g} s"
        )
    count = STAGES * min(steps, grid.steps + 1)  # of a later command nothing is seen
    numbers = np.zeros(DEMANDS + DEMAND_SIZE * count)
    numbers[COUNT] = count
    return numbers


# `line` is the ring of demands, laid out as above; writes BEGAN and NEXT.
@kernel
def begin_step(k: int, t: float, line: Vector) -> None:
    """Note that step k begins at time t."""
    line[BEGAN] = t
    count = shared(line[COUNT])
    if count > 0.0:
        line[NEXT] = STAGES * k % int(count)


# demand (3) [N, N m, N]; changes `line` at GIVEN, and the place that NEXT points to. The demand of
# a whole delay ago lies just where this one goes, so the ring needs no second pointer.
@kernel
def pass_on(demand: Vector, line: Vector) -> None:
    """Take this stage's demand, and give the actuator that of the same stage a delay before."""
    for i in range(DEMAND_SIZE):
        line[GIVEN + i] = demand[i]
    if shared(line[COUNT]) > 0.0:
        at = int(shared(line[NEXT]))
        place = tail(line, DEMANDS + DEMAND_SIZE * at)
        for i in range(DEMAND_SIZE):
            line[GIVEN + i] = place[i]
            place[i] = demand[i]
        line[NEXT] = at + 1
