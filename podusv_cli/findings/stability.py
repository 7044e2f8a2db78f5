"""Is a law's velocity loop carried stably by RK4's step and by the sampling?"""

from __future__ import annotations

import numpy as np

from podusv_cli.controllers.velocity_loop import Axis, Bound, Cause, Loop
from podusv_cli.core.kernel import Vector, bundle
from podusv_cli.scenario.model import Scenario
from podusv_cli.vessels.plant import surge_force, yaw_moment

BURST = 20  # steps within which a start that is too stiff shows
MUCH = 2.0  # times the error at the start


def rk4_growth(loop: Loop, step: float) -> float:
    """By how much one step of RK4 multiplies the loop's worst mode; 1 where the loop itself grows.

    Above 1 the integrator is unstable though the loop is not.
    """
    if not np.isfinite(loop.matrix).all() or np.linalg.eigvals(loop.matrix).real.max() > 0.0:
        return 1.0
    return _radius(_rk4(loop.matrix, step))


def sampled_growth(loop: Loop, step: float, count: int) -> float:
    """The same for one period of `count` steps with the law's output and measurement held.

    During a period (e, c, e_held, m): e' = -d e + c with c = g . (e, m) at the sample, and
    m' = F (e_held, m).
    """
    n = len(loop.memory)
    rates = np.zeros((3 + n, 3 + n))
    rates[0, :2] = -loop.damping, 1.0
    rates[3:, 2:] = loop.memory
    sampled = np.zeros((3 + n, 1 + n))
    sampled[0, 0] = sampled[2, 0] = 1.0
    sampled[1] = loop.feedback
    sampled[3:, 1:] = np.eye(n)
    through = np.linalg.matrix_power(_rk4(rates, step), count) @ sampled
    return _radius(np.delete(through, [1, 2], axis=0))


def _rk4(matrix: Vector, step: float) -> Vector:
    one, z = np.eye(len(matrix)), step * matrix
    return np.asarray(one + z @ (one + z @ (one + z @ (one + z / 4.0) / 3.0) / 2.0))


def _radius(matrix: Vector) -> float:
    if not np.isfinite(matrix).all():
        return np.inf
    return float(np.abs(np.linalg.eigvals(matrix)).max())


def axes(scenario: Scenario, nu: Vector) -> tuple[Axis, Axis]:
    """Surge and yaw at the velocity nu = (u, v, r)."""
    k, (u, v, r), small = bundle(scenario.vessel.constants()), nu.tolist(), 1e-4
    surge = surge_force(u - small, v, r, k) - surge_force(u + small, v, r, k)
    yaw = yaw_moment(u, v, r - small, k) - yaw_moment(u, v, r + small, k)
    vessel, told = scenario.vessel, scenario.nominal
    return (
        Axis("surge", vessel.m11, told.m11, surge / (2 * small * vessel.m11)),
        Axis("yaw", vessel.m33, told.m33, yaw / (2 * small * vessel.m33)),
    )


def loops(scenario: Scenario, nu: Vector, cause: Cause | None = None) -> list[Loop]:
    """The velocity loops of the scenario's law at a velocity, all or those of one cause."""
    found = scenario.controller.velocity_loops(axes(scenario, nu), nu)
    return [loop for loop in found if cause in (None, loop.cause)]


def bursts(loop: Loop, bound: Bound, error: float, step: float) -> bool:
    """Whether RK4 with this step lets a velocity error grow that the bound's adaptation quells.

    The loop with e' = ... - b_hat phi(e)/m and (28), marched from e(0) = error.
    """
    matrix, count = loop.matrix, len(loop.memory) + 1

    def rates(s: Vector) -> Vector:
        phi = s[0] / (4.0 * bound.partial)
        linear = matrix @ s[:count]
        linear[0] -= (s[-1] - bound.initial) * phi / bound.inertia
        rising = bound.gamma * (s[0] * phi - bound.sigma * (s[-1] - bound.initial))
        return np.append(linear, rising)

    s = np.zeros(count + 1)
    s[0], s[-1] = error, bound.initial
    for _ in range(BURST):
        k1 = rates(s)
        k2 = rates(s + 0.5 * step * k1)
        k3 = rates(s + 0.5 * step * k2)
        s = s + step / 6.0 * (k1 + 2.0 * (k2 + k3) + rates(s + step * k3))
        if not abs(s[0]) <= MUCH * abs(error):
            return True
    return False
