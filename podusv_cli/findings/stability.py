"""Numerical stability of a law's velocity loops: under RK4's step, and under sampling."""

from __future__ import annotations

import numpy as np

from podusv_cli.components.controllers.velocity_loop import AdaptedBound, Axis, Cause, Loop
from podusv_cli.components.vessels.plant import lacking, surge_force, yaw_moment
from podusv_cli.core.kernel import Vector, bundle
from podusv_cli.scenario.model import Scenario

NODES = 20  # of the demand on its way to the actuator
BURST_STEPS = 20  # steps within which the error of a start that is too stiff grows
BURST = 2.0  # growth of the error that counts


def rk4_growth(loop: Loop, step: float) -> float:
    """Spectral radius of one RK4 step [s] of the loop; 1 where the loop itself is unstable.

    Above 1 the integrator is unstable although the loop is stable. An unstable loop is the business
    of other findings.
    """
    if not np.isfinite(loop.matrix).all() or np.linalg.eigvals(loop.matrix).real.max() > 0.0:
        return 1.0
    return _radius(_rk4(loop.matrix, step))


def sampled_growth(loop: Loop, step: float, count: int, *, update_first: bool = False) -> float:
    """Spectral radius of one period of `count` RK4 steps [s], with output and measurement held.

    With `update_first` the memory takes the sample before the output is formed, see `control`.
    During a period (e, c, e_held, m): e' = -d e + c with c = g . (e, m) at the sample, and m' = F
    (e_held, m).
    """
    if update_first:
        return _updated_first(loop, step, count)
    n = len(loop.memory)
    rates = np.zeros((3 + n, 3 + n))
    rates[0, :2] = -loop.damping, 1.0
    rates[3:, 2:] = loop.memory
    # At a sample: c and e_held are set from (e, m).
    sampled = np.zeros((3 + n, 1 + n))
    sampled[0, 0] = sampled[2, 0] = 1.0
    sampled[1] = loop.feedback
    sampled[3:, 1:] = np.eye(n)
    through = np.linalg.matrix_power(_rk4(rates, step), count) @ sampled
    # c and e_held are no state: the next sample sets them anew.
    return _radius(np.delete(through, [1, 2], axis=0))


def _updated_first(loop: Loop, step: float, count: int) -> float:
    """`sampled_growth` where the law's memory is updated before the error is held.

    m' = F (e_held, m) comes first, then e' = -d e + g . (e_held, m). `step` [s] is that of RK4,
    `count` the number of steps between two samples.
    """
    rates = np.vstack([np.zeros(1 + len(loop.memory)), loop.memory])
    updated = np.linalg.matrix_power(_rk4(rates, step), count)
    of_step = _rk4(np.array([[-loop.damping, 1.0], [0.0, 0.0]]), step)
    through = np.linalg.matrix_power(of_step, count)
    period = np.eye(len(updated))
    period[0] = through[0, 1] * loop.feedback
    period[0, 0] += through[0, 0]
    return _radius(period @ updated)


def delayed_growth(loop: Loop, delay: float) -> float:
    """Largest real part [1/s] of the loop's roots where the law's output acts after a delay [s].

    e' = -d e + g . (e, m), the last term a delay before, which the memory of a law that knows the
    loads takes into account. The roots are eigenvalues of the derivative along the delayed demand,
    collocated at Chebyshev's points (Breda, Maset, Vermiglio, SIAM J. Sci. Comput. 27, 2005).
    """
    n, told = len(loop.matrix), np.zeros(len(loop.matrix) - 1) if loop.told is None else loop.told
    late = np.outer(np.append(1.0, told), loop.feedback)
    now = loop.matrix - late
    # The first block of rows is the loop itself; the others move the past along.
    rates = np.kron(2.0 / delay * _chebyshev(NODES), np.eye(n))
    rates[:n] = 0.0
    rates[:n, :n], rates[:n, -n:] = now, late
    if not np.isfinite(rates).all():
        return np.inf
    return float(np.linalg.eigvals(rates).real.max())


def delay_margin(loop: Loop, most: float) -> float:
    """The shortest delay [s] that makes the loop grow, by bisection; `most` [s] is known to."""
    low, high = 0.0, most
    # 30 halvings: `most` to a part in 1e9, far finer than any sampling period.
    for _ in range(30):
        middle = 0.5 * (low + high)
        grows = delayed_growth(loop, middle) > 0.0
        low, high = (low, middle) if grows else (middle, high)
    return high


def _chebyshev(count: int) -> Vector:
    """The matrix (count + 1, count + 1) of derivatives at cos(j pi/count), j = 0 .. count.

    Trefethen 2000, cheb.m.
    """
    x = np.cos(np.pi * np.arange(count + 1) / count)
    c = np.where(np.arange(count + 1) % 2, -1.0, 1.0)
    c[[0, -1]] *= 2.0
    D = np.outer(c, 1.0 / c) / (np.subtract.outer(x, x) + np.eye(count + 1))
    # The diagonal follows from the derivative of a constant, which is 0.
    return np.asarray(D - np.diag(D.sum(axis=1)))


def _rk4(matrix: Vector, step: float) -> Vector:
    """The matrix by which one step [s] of RK4 multiplies the state of x' = matrix x; (n, n)."""
    unit, z = np.eye(len(matrix)), step * matrix
    # Of a linear system, RK4 makes the exponential's series up to z^4.
    return np.asarray(unit + z @ (unit + z @ (unit + z @ (unit + z / 4.0) / 3.0) / 2.0))


def _radius(matrix: Vector) -> float:
    """The largest size of an eigenvalue; inf for a matrix without finite numbers."""
    if not np.isfinite(matrix).all():
        return np.inf
    return float(np.abs(np.linalg.eigvals(matrix)).max())


def axes(scenario: Scenario, nu: Vector) -> tuple[Axis, Axis]:
    """Surge and yaw at the velocity nu (3,) = (u, v, r) [m/s, m/s, rad/s].

    Each has its inertia, true and nominal, and its damping, by central differences.
    """
    k, (u, v, r), small = bundle(scenario.vessel.constants()), nu.tolist(), 1e-4
    # Steps of 1e-4 m/s and rad/s are large beside rounding, small beside what damping bends in.
    surge = surge_force(u - small, v, r, k) - surge_force(u + small, v, r, k)
    yaw = yaw_moment(u, v, r - small, k) - yaw_moment(u, v, r + small, k)
    yaw += lacking(u, v, r - small, k)[2] - lacking(u, v, r + small, k)[2]
    vessel, nominal = scenario.vessel, scenario.nominal
    return (
        Axis("surge", vessel.m11, nominal.m11, surge / (2 * small * vessel.m11)),
        Axis("yaw", vessel.m33, nominal.m33, yaw / (2 * small * vessel.m33)),
    )


def loops(scenario: Scenario, nu: Vector, cause: Cause | None = None) -> list[Loop]:
    """The velocity loops of the scenario's law at nu (3,); all, or those of one cause."""
    every = scenario.controller.velocity_loops(axes(scenario, nu), nu)
    return [loop for loop in every if cause in (None, loop.cause)]


def fast_gain(scenario: Scenario, nu: Vector, loop: Loop) -> str:
    """The law's gain that slows a loop most when it is halved; the loop's own key where several do.

    `nu` (3,) [m/s, m/s, rad/s] is the velocity at which the loop is linear.
    """
    law, about = scenario.controller, axes(scenario, nu)

    def rate_with_halved(key: str) -> float:
        """The rate [1/s] of the loop's fastest mode with half of this gain."""
        halved = law.model_copy(update={key: 0.5 * getattr(law, key)})
        own = [
            slower.fastest
            for slower in halved.velocity_loops(about, nu)
            if (slower.name, slower.axis) == (loop.name, loop.axis)
        ]
        return min(own, default=np.inf)

    # `min` takes the first of equals, so the loop's own key is sorted first.
    gains = [key for key in type(law).model_fields if isinstance(getattr(law, key), float)]
    return min(
        sorted(gains, key=lambda key: key != loop.key), key=rate_with_halved, default=loop.key
    )


def bursts(loop: Loop, bound: AdaptedBound, error: float, step: float) -> bool:
    """Whether a velocity error grows under RK4 although the bound's adaptation should reduce it.

    Integrates the loop with e' = ... - b_hat phi(e)/m and (28) from e(0) = error, by steps [s].
    """
    matrix, count = loop.matrix, len(loop.memory) + 1

    def rates(s: Vector) -> Vector:
        """Rates of `s` (2 + memory,): velocity error [m/s], loop's memory, estimated load [N]."""
        phi = s[0] / (4.0 * bound.partial)
        linear = matrix @ s[:count]
        linear[0] -= (s[-1] - bound.initial) * phi / bound.inertia
        rising = bound.gamma * (s[0] * phi - bound.sigma * (s[-1] - bound.initial))
        return np.append(linear, rising)

    s = np.zeros(count + 1)
    s[0], s[-1] = error, bound.initial
    for _ in range(BURST_STEPS):
        k1 = rates(s)
        k2 = rates(s + 0.5 * step * k1)
        k3 = rates(s + 0.5 * step * k2)
        s = s + step / 6.0 * (k1 + 2.0 * (k2 + k3) + rates(s + step * k3))
        # Also true of NaN.
        if not abs(s[0]) <= BURST * abs(error):
            return True
    return False
