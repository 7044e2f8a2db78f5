"""Is a law's velocity loop, linearised, carried stably by RK4's step and by the sampling?

A loop has the states (e, m): the velocity error e of one axis, and the parts m of the law's memory
that feed back into it. With the plant's own damping d,

    e' = -d e + g . (e, m),   m' = F (e, m).

The rest of the closed loop is slower and left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import singledispatch

import numpy as np

from podusv_cli.controllers.base import Controller
from podusv_cli.controllers.network import activation
from podusv_cli.controllers.pid import Pid
from podusv_cli.controllers.polar_backstepping import PolarBackstepping
from podusv_cli.core.kernel import Vector, bundle
from podusv_cli.scenario.model import Scenario
from podusv_cli.vessels.plant import surge_force, yaw_moment

BURST = 20  # steps within which a start that is too stiff shows
MUCH = 2.0  # times the error at the start


@dataclass(frozen=True)
class Loop:
    """A linearised velocity loop; `key` is the gain that makes it fast."""

    axis: str
    key: str
    damping: float  # d [1/s]
    feedback: Vector  # g, shape (1 + n,)
    memory: Vector  # F, shape (n, 1 + n)

    @property
    def matrix(self) -> Vector:
        """Rates of (e, m), shape (1 + n, 1 + n)."""
        rows = np.vstack([self.feedback, self.memory])
        rows[0, 0] -= self.damping
        return rows

    @property
    def fastest(self) -> float:
        """Largest eigenvalue's magnitude [1/s]."""
        return float(np.abs(np.linalg.eigvals(self.matrix)).max())


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


@dataclass(frozen=True)
class Axis:
    """One axis of the hull: true inertia, what the law takes it for, damping at a velocity."""

    name: str
    inertia: float
    told: float
    damping: float  # d [1/s]


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


@singledispatch
def loops(law: Controller, scenario: Scenario, nu: Vector) -> list[Loop]:
    """The velocity loops of a law at a velocity; none where nothing is known about it."""
    return []


@loops.register
def _(law: PolarBackstepping, scenario: Scenario, nu: Vector) -> list[Loop]:
    # (26), (27) with a = W . Phi at frozen Phi: a' = Gamma (m |Phi|^2 e - sigma a).
    power = float((activation(law.network, nu[None]) ** 2).sum())
    gains = (
        ("Gamma_u", law.k_ue, law.b_hat_u0, law.Gamma_u, law.sigma_u),
        ("Gamma_r", law.k_re, law.b_hat_r0, law.Gamma_r, law.sigma_r),
    )
    return [
        Loop(
            axis.name, key, axis.damping,
            np.array([-k - b_hat / (4.0 * law.partial), -axis.told]) / axis.inertia,
            np.array([[Gamma * axis.told * power, -Gamma * sigma]]),
        )
        for axis, (key, k, b_hat, Gamma, sigma) in zip(axes(scenario, nu), gains, strict=True)
    ]  # fmt: skip


@loops.register
def _(law: Pid, scenario: Scenario, nu: Vector) -> list[Loop]:
    # With e = -u_p: m e' = -K_P e + K_I i + K_D l', i' = -e, l' = (-e - l)/T_d.
    lag = 1.0 / law.T_d
    gains = (
        ("K_Du", law.K_Pu, law.K_Iu, law.K_Du),
        ("K_Dr", law.K_Pr, law.K_Ir, law.K_Dr),
    )
    return [
        Loop(
            axis.name, key, axis.damping,
            np.array([-K_P - K_D * lag, K_I, -K_D * lag]) / axis.inertia,
            np.array([[-1.0, 0.0, 0.0], [-lag, 0.0, -lag]]),
        )
        for axis, (key, K_P, K_I, K_D) in zip(axes(scenario, nu), gains, strict=True)
    ]  # fmt: skip


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


@dataclass(frozen=True)
class Bound:
    """The adaptation (28) of an axis: gains, b_hat at the start, and the true inertia."""

    key: str
    gamma: float
    sigma: float
    initial: float
    partial: float
    inertia: float
