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
from podusv_cli.findings.finding import Case
from podusv_cli.kernels import Vector

RK4_REACH = 2.785  # |h lambda| on the negative real axis up to which RK4 is stable
EULER_REACH = 2.0


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
    if np.linalg.eigvals(loop.matrix).real.max() > 0.0:
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
    return float(np.abs(np.linalg.eigvals(matrix)).max())


@singledispatch
def loops(law: Controller, case: Case) -> list[Loop]:
    """The velocity loops of a law; none where nothing is known about it."""
    return []


@loops.register
def _(law: PolarBackstepping, case: Case) -> list[Loop]:
    # (26), (27) with a = W . Phi at frozen Phi: a' = Gamma (m |Phi|^2 e - sigma a).
    vessel, told, power = case.scenario.vessel, case.scenario.nominal, network_power(law, case)
    k_u = law.k_ue + law.b_hat_u0 / (4.0 * law.partial)
    k_r = law.k_re + law.b_hat_r0 / (4.0 * law.partial)
    rows = (
        ("surge", "Gamma_u", vessel.m11, told.m11, -vessel.X_u, k_u, law.Gamma_u, law.sigma_u),
        ("yaw", "Gamma_r", vessel.m33, told.m33, -vessel.N_r, k_r, law.Gamma_r, law.sigma_r),
    )
    return [
        Loop(
            axis, key, drag / inertia, np.array([-k, -told_inertia]) / inertia,
            np.array([[Gamma * told_inertia * power, -Gamma * sigma]]),
        )
        for axis, key, inertia, told_inertia, drag, k, Gamma, sigma in rows
    ]  # fmt: skip


def network_power(law: PolarBackstepping, case: Case) -> float:
    """Largest |Phi|^2 at the start's velocity and at those that keep up with the target."""
    start = case.scenario.start
    nu = case.reference.nu
    visited = np.vstack([nu[np.isfinite(nu).all(axis=1)], [(start.u, start.v, start.r)]])
    return float((activation(law.network, visited) ** 2).sum(axis=1).max())


@loops.register
def _(law: Pid, case: Case) -> list[Loop]:
    # With e = -u_p: m e' = -K_P e + K_I i + K_D l', i' = -e, l' = (-e - l)/T_d.
    vessel = case.scenario.vessel
    rows = (
        ("surge", "K_Du", vessel.m11, -vessel.X_u, law.K_Pu, law.K_Iu, law.K_Du),
        ("yaw", "K_Dr", vessel.m33, -vessel.N_r, law.K_Pr, law.K_Ir, law.K_Dr),
    )
    lag = 1.0 / law.T_d
    return [
        Loop(
            axis, key, drag / inertia,
            np.array([-K_P - K_D * lag, K_I, -K_D * lag]) / inertia,
            np.array([[-1.0, 0.0, 0.0], [-lag, 0.0, -lag]]),
        )
        for axis, key, inertia, drag, K_P, K_I, K_D in rows
    ]  # fmt: skip
