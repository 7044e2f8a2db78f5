"""Tracking and positioning of a fully actuated vessel: vectorial backstepping with an integral.

Source: T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control (2021), MIMO
nonlinear backstepping, after T. I. Fossen and S. P. Berge, "Nonlinear vectorial backstepping design
for global exponential tracking of marine vessels in the presence of actuator dynamics", CDC 1997;
neither was at hand. The integral in the body frame is podusv's.

Proved, with the nominal hull and without limits: without loads and integral all errors vanish
exponentially, with any gain of the integral they vanish; constant loads on a heading that stays
leave none. Not proved: another hull, other loads, limits. Anti-windup: back-calculation.
docs/laws/pose_backstepping.md has equations and proof.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np

from podusv_cli.components.controllers.base import Slots, each
from podusv_cli.components.controllers.pose_errors import ERRORS, pose_errors
from podusv_cli.components.controllers.pose_law import PoseLaw
from podusv_cli.components.controllers.velocity_loop import ALONE, Axis, Loop
from podusv_cli.components.vessels.plant import surge_force, sway_force, yaw_moment
from podusv_cli.core.component import value
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal

INTEGRALS = (
    Signal("zeta_u", "m s", "integral of the error along the bow", r"\zeta_u"),
    Signal("zeta_v", "m s", "integral of the error across the bow", r"\zeta_v"),
    Signal("zeta_r", "rad s", "integral of the heading error", r"\zeta_r"),
)


class PoseBackstepping(PoseLaw):
    """Vectorial backstepping for position and heading."""

    kind: Literal["pose_backstepping"] = "pose_backstepping"
    signals: ClassVar[tuple[Signal, ...]] = ERRORS
    k_p: float = value(0.1, "1/s", "gain of the position error", gt=0)
    k_psi: float = value(0.2, "1/s", "gain of the heading error", gt=0)
    k_i: float = value(0.0, "1/s2", "gain of the integral of errors", ge=0)
    k_d: float = value(0.5, "1/s", "gain of the velocity errors, times the inertia", gt=0)

    def slots(self) -> Slots:
        """The memory: the integrals."""
        return each(INTEGRALS)

    def wants_loads(self) -> bool:
        """Whether it has to know the loads that act: for anti-windup, with integral action."""
        return self.k_i > 0.0

    def velocity_loops(self, axes: tuple[Axis, Axis], nu: Vector) -> list[Loop]:
        """m nu' = -(k_d + gain of the position) m nu for the axes surge and yaw, at any nu.

        The law cancels the hull's damping, so it is added to the feedback of a `Loop`, which has
        it. Its inertia is the told one over the true one.
        """
        gains = (("k_d", self.k_d + self.k_p), ("k_d", self.k_d + self.k_psi))
        return [
            Loop(
                axis.name,
                key,
                axis.damping,
                np.array([axis.damping - gain * axis.told / axis.inertia]),
                ALONE,
            )
            for axis, (key, gain) in zip(axes, gains, strict=True)
        ]

    # Changes rate (3,).
    @staticmethod
    @kernel
    def after_saturation(demand: Vector, tau: Vector, k: Any, rate: Vector) -> None:
        """Back-calculation over the gain of each error, 1 + m k_d k_p."""
        rate[0] -= (tau[0] - demand[0]) / (1.0 + k.m11 * k.k_d * k.k_p)
        rate[1] -= (tau[1] - demand[2]) / (1.0 + k.m22 * k.k_d * k.k_p)
        rate[2] -= (tau[2] - demand[1]) / (1.0 + k.m33 * k.k_d * k.k_psi)

    # x (6,), memory (3,), target (10,); writes tau (3,), rate (3,) and signals (3,). (rate_u,
    # rate_v, rate_r) is alpha', (p, q, w) alpha' - K_d z_2. Demands are surge, yaw, sway.
    @staticmethod
    @kernel
    def law(
        x: Vector,
        memory: Vector,
        target: Vector,
        k: Any,
        tau: Vector,
        rate: Vector,
        signals: Vector,
    ) -> None:
        """tau = M alpha' - f(nu) - z_1 - K_d M z_2."""
        u, v, r = x[3], x[4], x[5]
        e = pose_errors(x, target)
        i_a, i_b, i_psi = memory[0], memory[1], memory[2]
        rate[0], rate[1], rate[2] = e.a + r * i_b, e.b - r * i_a, e.psi
        alpha_u = e.u_d - k.k_p * e.a - k.k_i * i_a
        alpha_v = e.v_d - k.k_p * e.b - k.k_i * i_b
        alpha_r = e.r_d - k.k_psi * e.psi - k.k_i * i_psi
        rate_u = e.u_d_rate - k.k_p * e.a_rate - k.k_i * rate[0]
        rate_v = e.v_d_rate - k.k_p * e.b_rate - k.k_i * rate[1]
        rate_r = e.r_d_rate - k.k_psi * e.psi_rate - k.k_i * rate[2]
        p = rate_u - k.k_d * (u - alpha_u)
        q = rate_v - k.k_d * (v - alpha_v)
        w = rate_r - k.k_d * (r - alpha_r)
        tau[0] = k.m11 * p - surge_force(u, v, r, k) - e.a
        tau[2] = k.m22 * q + k.m23 * w - sway_force(u, v, r, k) - e.b
        tau[1] = k.m32 * q + k.m33 * w - yaw_moment(u, v, r, k) - e.psi
        signals[0], signals[1], signals[2] = e.a, e.b, e.psi
