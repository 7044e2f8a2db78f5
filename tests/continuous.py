"""The closed loop as s' = f(t, s), for integrators other than the engine's own."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.simulate import marcher
from podusv_cli.engine.step.grid import TimeGrid

Slope = Callable[[float, Vector], Vector]


def continuous(loop: ClosedLoop, duration: float, *, compiled: bool = True) -> tuple[Slope, Vector]:
    """f(t, s) for t up to `duration` [s], and s(0).

    s is the vessel's state, the actuator's, the law's memory. f raises ArithmeticError where a
    number is not finite. Raises ValueError for a law that takes samples, for measurements and for
    a delay, which are no ordinary differential equations.
    """
    if loop.measured:
        raise ValueError("a law that works with measurements has no continuous right-hand side")
    if loop.controller.takes_samples():
        raise ValueError("a law that takes samples has no continuous right-hand side")
    if loop.path.follows:
        raise ValueError("a path that is followed has no continuous right-hand side")
    if loop.actuator.delay() > 0:
        raise ValueError("an actuator with a delay has no continuous right-hand side")
    grid = TimeGrid(1.0, 1, log_every=2)
    layout = Plan(loop, grid).layout
    plan = Plan(loop, TimeGrid(duration, 1))
    vectors, march = plan.vectors(), marcher(plan, compiled)

    def slope(t: float, s: Vector) -> Vector:
        # The march over instant 1 of a grid with step t and no step after it: rates, no more.
        vectors.s[:] = s
        with np.errstate(all="ignore"):
            if march(vectors, layout, t)(1, 2) != 2:
                raise ArithmeticError(f"not finite at t = {t:.6g} s")
        return vectors.stages[: layout.states].copy()

    return slope, vectors.s.copy()
