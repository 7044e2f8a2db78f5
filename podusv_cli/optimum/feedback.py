"""A motion as a schedule: its demand, and the gains that hold a vessel to it."""

from __future__ import annotations

from typing import Any

import numpy as np

from podusv_cli.core.kernel import Vector, bundle
from podusv_cli.optimum.collocation import STATES, casadi, dynamics
from podusv_cli.optimum.problem import Motion, OptimumProblem

BANDWIDTH = 1.0  # rad/s, about that with which the vessel is held to the motion
MOST_ROWS = 3500  # that fit into a resolved scenario
# By how many loads the demand has
HEADERS = {
    2: "t, tau_u, tau_r, x, y, psi, u, v, r, then the gains of tau_u and tau_r",
    3: "t, tau_u, tau_r, tau_v, x, y, psi, u, v, r, then the gains of all three",
}


def schedule(problem: OptimumProblem, motion: Motion) -> str:
    """The text of a schedule that repeats the motion, for the law `schedule`: header and rows."""
    gains = _gains(problem, motion).reshape(len(motion.times), -1)
    chosen = _choose_rows(motion.demands)
    rows = np.column_stack([motion.times, motion.demands, motion.states])
    lines = (
        ", ".join([*(f"{x:.10g}" for x in rows[i]), *(f"{x:.4g}" for x in gains[i])])
        for i in chosen
    )
    return "\n".join([HEADERS[problem.demands], *lines, ""])


def _choose_rows(demands: Vector) -> list[int]:
    """The rows that a schedule has: all, or every so many and those where the demand bends most.

    `demands` is (times, 2) [N, N m], or (times, 3) with a sway force [N].
    """
    last, half = len(demands) - 1, MOST_ROWS // 2
    if last < MOST_ROWS:
        return list(range(last + 1))
    bends = abs(np.diff(demands, 2, axis=0))  # at rows 1 to last - 1, so 1 is added below
    # A demand that never bends has a largest bend of 0
    sharpest = np.argsort((bends / bends.max(axis=0).clip(1e-300)).sum(axis=1))[-half:] + 1
    return sorted({*range(0, last, -(-last // half)), *sharpest.tolist(), last})


def _gains(problem: OptimumProblem, motion: Motion) -> Vector:
    """The gains of the linear-quadratic regulator along the motion, at each of its times.

    Shape (times, demands, 6). From the end backwards, over matrices that are discretised by the
    trapezoidal rule. The weights are 1 for every state, and for a demand what makes 1 m or 1 rad
    worth an acceleration of BANDWIDTH squared.
    """
    vessel, h = problem.loop.vessel, float(motion.times[1] - motion.times[0])
    inertia = [vessel.m11, vessel.m33, vessel.m22][: problem.demands]  # in the order of a demand
    weight = np.diag([m**-2 for m in inertia]) / BANDWIDTH**4
    unit = np.eye(STATES)
    cost, gains = unit, np.zeros((len(motion.times), problem.demands, STATES))
    for i, (A, B) in reversed(list(enumerate(zip(*_slopes(problem, motion), strict=True)))):
        left = np.linalg.inv(unit - 0.5 * h * A)
        A_h, B_h = left @ (unit + 0.5 * h * A), left @ (h * B)
        gains[i] = np.linalg.solve(h * weight + B_h.T @ cost @ B_h, B_h.T @ cost @ A_h)
        cost = h * unit + A_h.T @ cost @ (A_h - B_h @ gains[i])
    return gains


def _slopes(problem: OptimumProblem, motion: Motion) -> tuple[Vector, Vector]:
    """The vessel's rates' derivatives by state (times, 6, 6) and demand (times, 6, demands).

    Exact, along the motion, by CasADi.
    """
    ca, rate = casadi(), dynamics(bundle(problem.loop.vessel.constants()), problem.demands)
    sizes = (STATES, problem.demands, 3)
    arguments: list[Any] = [ca.SX.sym(f"a{i}", size) for i, size in enumerate(sizes)]
    both = ca.jacobian(rate(*arguments), ca.vertcat(*arguments[:2]))
    slopes = ca.Function("slopes", arguments, [both]).map(len(motion.times))(
        motion.states.T, motion.demands.T, problem.loads(motion.times.tolist()).T
    )
    # CasADi's map puts the matrices (6, 6 + demands) of all times side by side
    columns = np.array(slopes).reshape(STATES, len(motion.times), -1).transpose(1, 0, 2)
    return columns[:, :, :STATES], columns[:, :, STATES:]
