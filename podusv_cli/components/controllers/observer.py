"""Extended state observer of the velocities: the load that the nominal vessel does not explain.

With the nominal mass matrix M, Coriolis and damping forces f and the loads tau that act,

    nu_hat' = M^-1 (tau + f + b_hat) + 2 omega (nu - nu_hat),   b_hat' = M omega^2 (nu - nu_hat)

with omega diagonal. Both poles of each axis are at its -omega, also where sway and yaw are coupled
by m23 and m32. Source: J. Han, "From PID to active disturbance rejection control", IEEE
Trans. Industrial Electronics 56 (2009), 900-906; linear, and tuned by omega alone, after Z. Gao,
"Scaling and bandwidth-parameterization based controller tuning", American Control Conference
(2003), 4989-4996.

The observer is the only integrator of a law that uses it. It is told the loads that act, so it
does not wind up while the actuator limits the demand.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from podusv_cli.components import rules as by
from podusv_cli.components.controllers.base import Controller, Slots, each
from podusv_cli.components.controllers.velocity_loop import Axis, Loop
from podusv_cli.components.vessels.plant import surge_force, sway_force, yaw_moment
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import Rule, Ruled, value
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal

U_HAT, V_HAT, R_HAT, B_U, B_V, B_R = range(6)  # positions in the memory
OBSERVED = (
    Signal("u_hat", "m/s", "surge velocity, observed", r"\hat u"),
    Signal("v_hat", "m/s", "sway velocity, observed", r"\hat v"),
    Signal("r_hat", "rad/s", "yaw rate, observed", r"\hat r"),
    Signal("b_obs_u", "N", "surge load that the nominal vessel does not explain", r"\hat b_u"),
    Signal("b_obs_v", "N", "sway load that the nominal vessel does not explain", r"\hat b_v"),
    Signal("b_obs_r", "N m", "yaw load that the nominal vessel does not explain", r"\hat b_r"),
)


# Two equations for two unknowns; k.by_yaw is m23/m33, k.by_sway m32/m22.
@kernel
def sway_yaw_rates(sway: float, yaw: float, k: Any) -> tuple[float, float]:
    """(v', r') under a sway force [N] and a yaw moment [N m], by the nominal mass matrix."""
    v_rate = (sway - k.by_yaw * yaw) / (k.m22 - k.by_yaw * k.m32)
    return v_rate, (yaw - k.by_sway * sway) / (k.m33 - k.by_sway * k.m23)


# x (6) state, tau (2) [N, N m]. Reads memory and writes rate at U_HAT, V_HAT, R_HAT, B_U, B_V, B_R.
# Every axis has a double pole at -omega; the loads' rates go through the mass matrix, hence m23 and
# m32.
@kernel
def observe(x: Vector, memory: Vector, tau: Vector, k: Any, rate: Vector) -> None:
    """Rates of the observer as if the demand `tau` acted; `after_saturation` adds what differs."""
    u, v, r = x[3], x[4], x[5]
    e_u, e_v, e_r = u - memory[U_HAT], v - memory[V_HAT], r - memory[R_HAT]
    surge = tau[0] + surge_force(u, v, r, k) + memory[B_U]
    sway = sway_force(u, v, r, k) + memory[B_V]
    yaw = tau[1] + yaw_moment(u, v, r, k) + memory[B_R]
    v_rate, r_rate = sway_yaw_rates(sway, yaw, k)
    rate[U_HAT] = surge / k.m11 + 2.0 * k.omega_u * e_u
    rate[V_HAT] = v_rate + 2.0 * k.omega_v * e_v
    rate[R_HAT] = r_rate + 2.0 * k.omega_r * e_r
    square_v, square_r = k.omega_v * k.omega_v, k.omega_r * k.omega_r
    rate[B_U] = k.m11 * k.omega_u * k.omega_u * e_u
    rate[B_V] = k.m22 * k.omega_v * k.omega_v * e_v + k.m23 * square_r * e_r
    rate[B_R] = k.m33 * k.omega_r * k.omega_r * e_r + k.m32 * square_v * e_v


class ObservingController(Controller):
    """A law whose memory is the observer."""

    rules: ClassVar[dict[str, Rule]] = by.OBSERVER

    omega_u: Ruled = value(2.5, "rad/s", "bandwidth of the observer in surge", gt=0)
    omega_v: Ruled = value(2.0, "rad/s", "bandwidth of the observer in sway", gt=0)
    omega_r: Ruled = value(1.2, "rad/s", "bandwidth of the observer in yaw", gt=0)

    def slots(self) -> Slots:
        """The memory: observed velocities and loads."""
        return each(OBSERVED)

    def start(self, x: Vector, target: Vector, nominal: Vessel) -> Vector:
        """The memory: velocities as they are, and no loads."""
        memory = super().start(x, target, nominal)
        memory[: V_HAT + 2] = x[3:6]
        return memory

    def wants_loads(self) -> bool:
        """Always: the observer has to know the loads that act."""
        return True

    # demand (2) [N, N m], tau (3) [N, N, N m]; changes rate at U_HAT, V_HAT and R_HAT.
    @staticmethod
    @kernel
    def after_saturation(demand: Vector, tau: Vector, k: Any, rate: Vector) -> None:
        """Put the loads that act in place of the demand."""
        v_rate, r_rate = sway_yaw_rates(tau[1], tau[2] - demand[1], k)
        rate[U_HAT] += (tau[0] - demand[0]) / k.m11
        rate[V_HAT] += v_rate
        rate[R_HAT] += r_rate

    def constants_with(self, nominal: Vessel) -> dict[str, float]:
        """The law's constants, with what sway and yaw take from each other in the mass matrix."""
        coupling = {"by_yaw": nominal.m23 / nominal.m33, "by_sway": nominal.m32 / nominal.m22}
        return super().constants_with(nominal) | coupling

    def axis_gains(self, axes: tuple[Axis, Axis]) -> tuple[tuple[str, float, float], ...]:
        """Key, gain [1/s] and observer bandwidth of surge and yaw; none that are linear here."""
        return ()

    def velocity_loops(self, axes: tuple[Axis, Axis], nu: Vector) -> list[Loop]:
        """Error e = nu and memory (e_hat, b_hat/m): tau = -m_told (k e + b_hat/m_told - d e).

        The nominal damping that the law cancels is taken to be the true one.
        """
        return [_loop(axis, *gain) for axis, gain in zip(axes, self.axis_gains(axes), strict=False)]


def _loop(axis: Axis, key: str, gain: float, omega: float) -> Loop:
    """nu' = -d nu + g.(nu, nu_hat, b), with b the observed load per told inertia.

    `gain` [1/s] is the law's, named `key`; `omega` [rad/s] is the observer's bandwidth. The law
    cancels the damping, and the observer is told what acts.
    """
    ratio, d = axis.told / axis.inertia, axis.damping
    return Loop(
        axis.name,
        key,
        d,
        np.array([d - ratio * gain, 0.0, -ratio]),
        np.array([[2.0 * omega - gain, -2.0 * omega, 0.0], [omega * omega, -omega * omega, 0.0]]),
        told=np.array([1.0 / ratio, 0.0]),
    )
