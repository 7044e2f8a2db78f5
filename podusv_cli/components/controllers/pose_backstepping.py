"""Trajectory tracking and positioning of a fully actuated vessel: vectorial backstepping with PI.

Source: T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control (2021), MIMO
nonlinear backstepping; and T. I. Fossen and S. P. Berge, CDC 1997. With R = R(psi) and
S = [0 -1 0; 1 0 0; 0 0 0],

    z_1 = R^T (eta - eta_d);  alpha = R^T eta_d' - K_p z_1 - K_i zeta;  zeta' = z_1 - r S zeta
    z_2 = nu - alpha;  tau = M alpha' - f(nu) - z_1 - K_d M z_2

where f is Coriolis and damping force of the nominal vessel. Then z_1' = -r S z_1 - K_p z_1 + z_2 -
K_i zeta and M z_2' = -z_1 - K_d M z_2 without loads.

Proved there: without loads and limits, the origin of (z_1, z_2) is globally exponentially stable
(K_i = 0). Anti-windup: the integral holds while the loads are not what was asked for.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from podusv_cli.components.controllers.base import Controller, Slots, each
from podusv_cli.components.vessels.plant import surge_force, sway_force, yaw_moment
from podusv_cli.core.component import value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.kinematics import wrap
from podusv_cli.core.signal import PSI_D, Signal

LIKE = 1e-9  # of a demand; loads that differ by more were limited
INTEGRALS = (
    Signal("zeta_u", "m s", "integral of the error along the bow", r"\zeta_u"),
    Signal("zeta_v", "m s", "integral of the error across the bow", r"\zeta_v"),
    Signal("zeta_r", "rad s", "integral of the heading error", r"\zeta_r"),
)


class PoseBackstepping(Controller):
    """Vectorial backstepping for position and heading."""

    kind: Literal["pose_backstepping"] = "pose_backstepping"
    asks_sway: ClassVar[bool] = True
    wants_heading: ClassVar[bool] = True
    signals = (
        Signal("z_1u", "m", "error along the bow"),
        Signal("z_1v", "m", "error across the bow"),
        Signal("psi_t", "rad", "heading error", r"\tilde\psi"),
    )
    k_p: float = value(0.1, "1/s", "gain of the position error", gt=0)
    k_psi: float = value(0.2, "1/s", "gain of the heading error", gt=0)
    k_i: float = value(0.0, "1/s2", "gain of the integral of errors", ge=0)
    k_d: float = value(0.5, "1/s", "gain of the velocity errors, times the inertia", gt=0)

    def slots(self) -> Slots:
        """The integrals."""
        return each(INTEGRALS)

    def wants_loads(self) -> bool:
        """For anti-windup."""
        return self.k_i > 0.0

    @staticmethod
    @kernel
    def after_saturation(demand: Vector, tau: Vector, rate: Vector) -> None:
        """Hold the integrals of those axes that are limited."""
        if abs(tau[0] - demand[0]) > LIKE * abs(demand[0]):
            rate[0] = 0.0
        if abs(tau[1] - demand[2]) > LIKE * abs(demand[2]):
            rate[1] = 0.0
        if abs(tau[2] - demand[1]) > LIKE * abs(demand[1]):
            rate[2] = 0.0

    @staticmethod
    @kernel
    def law(
        x: Vector, memory: Vector, target: Vector, k: Any, tau: Vector, rate: Vector,
        signals: Vector,
    ) -> None:  # fmt: skip
        """tau = M alpha' - f(nu) - z_1 - K_d M z_2."""
        c, s = cos_sin(x[2])
        u, v, r = x[3], x[4], x[5]
        ex, ey = x[0] - target[0], x[1] - target[1]
        a, b, psi = c * ex + s * ey, c * ey - s * ex, wrap(x[2] - target[PSI_D])
        du, dv = c * target[2] + s * target[3], c * target[3] - s * target[2]
        au, av = c * target[4] + s * target[5], c * target[5] - s * target[4]
        # rates of the errors in the body frame
        a_t, b_t, psi_t = u - du + r * b, v - dv - r * a, r - target[PSI_D + 1]
        i_a, i_b, i_psi = memory[0], memory[1], memory[2]
        rate[0], rate[1], rate[2] = a + r * i_b, b - r * i_a, psi
        alpha_u = du - k.k_p * a - k.k_i * i_a
        alpha_v = dv - k.k_p * b - k.k_i * i_b
        alpha_r = target[PSI_D + 1] - k.k_psi * psi - k.k_i * i_psi
        rate_u = au + r * dv - k.k_p * a_t - k.k_i * rate[0]
        rate_v = av - r * du - k.k_p * b_t - k.k_i * rate[1]
        rate_r = target[PSI_D + 2] - k.k_psi * psi_t - k.k_i * rate[2]
        p = rate_u - k.k_d * (u - alpha_u)
        q = rate_v - k.k_d * (v - alpha_v)
        w = rate_r - k.k_d * (r - alpha_r)
        tau[0] = k.m11 * p - surge_force(u, v, r, k) - a
        tau[2] = k.m22 * q + k.m23 * w - sway_force(u, v, r, k) - b
        tau[1] = k.m32 * q + k.m33 * w - yaw_moment(u, v, r, k) - psi
        signals[0], signals[1], signals[2] = a, b, psi
