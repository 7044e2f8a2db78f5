"""Sliding modes for a pose: they resist loads whose bounds alone are known.

Source: T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control (2021), MIMO sliding
mode control, section 16.4; the book was not at hand. The velocity asked for is that of
`pose_backstepping`; tanh in place of the sign, as in the source.

Proved, with the nominal hull and off the limits: under loads within the bounds the missing velocity
comes into a ball, and the pose with it. Not proved: another hull, other loads, limits.
Anti-windup: it has no memory. docs/laws/pose_sliding_mode.md has equations and proof.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np

from podusv_cli.components.controllers.pose_errors import ERRORS, pose_errors
from podusv_cli.components.controllers.pose_law import PoseLaw
from podusv_cli.components.controllers.velocity_loop import ALONE, Axis, Loop
from podusv_cli.components.vessels.plant import surge_force, sway_force, yaw_moment
from podusv_cli.core.component import value
from podusv_cli.core.elementary import hyperbolic_tangent
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal

MISSING = (
    Signal("s_u", "m/s", "velocity ahead of the one asked for, along the bow"),
    Signal("s_v", "m/s", "velocity beside the one asked for, to starboard"),
    Signal("s_r", "rad/s", "yaw rate beyond the one asked for"),
)


class PoseSlidingMode(PoseLaw):
    """Moves to a pose with a velocity that it enforces against bounded loads."""

    kind: Literal["pose_sliding_mode"] = "pose_sliding_mode"
    signals: ClassVar[tuple[Signal, ...]] = (*ERRORS, *MISSING)
    k_p: float = value(0.1, "1/s", "velocity asked for per position error", gt=0)
    k_psi: float = value(0.2, "1/s", "yaw rate asked for per heading error", gt=0)
    k_d: float = value(0.2, "1/s", "gain of the missing velocity, times the inertia", ge=0)
    load_u: float = value(0.5, "N", "bound of the loads in surge", ge=0)
    load_v: float = value(0.5, "N", "bound of the loads in sway", ge=0)
    load_r: float = value(0.3, "N m", "bound of the loads in yaw", ge=0)
    phi: float = value(0.02, "m/s", "boundary layer of surge and sway velocity", gt=0)
    phi_r: float = value(0.05, "rad/s", "boundary layer of the yaw rate", gt=0)

    def velocity_loops(self, axes: tuple[Axis, Axis], nu: Vector) -> list[Loop]:
        """Within the layer m nu' = -(k_d + gain of the error) m nu - load/phi nu, at any nu.

        For the axes surge and yaw. The law cancels the damping, which is added here; tanh has the
        slope 1/phi at 0.
        """
        layers = (("load_u", self.load_u / self.phi), ("load_r", self.load_r / self.phi_r))
        gains = (self.k_d + self.k_p, self.k_d + self.k_psi)
        return [
            Loop(
                axis.name,
                key,
                axis.damping,
                np.array([axis.damping - (gain * axis.told + steep) / axis.inertia]),
                ALONE,
            )
            for axis, (key, steep), gain in zip(axes, layers, gains, strict=True)
        ]

    # x (6,), target (10,); writes tau (3,) and signals (6,). (p, q, w) is nu_r' - k_d s. Demands
    # are surge, yaw, sway.
    @staticmethod
    @kernel
    def law(x: Vector, target: Vector, k: Any, tau: Vector, signals: Vector) -> None:
        """tau = M nu_r' - f(nu) - k_d M s - K tanh(s/phi) with nu_r = R^T eta_d' - K_p z."""
        u, v, r = x[3], x[4], x[5]
        e = pose_errors(x, target)
        s_u, s_v = u - e.u_d + k.k_p * e.a, v - e.v_d + k.k_p * e.b
        s_r = r - e.r_d + k.k_psi * e.psi
        p = e.u_d_rate - k.k_p * e.a_rate - k.k_d * s_u
        q = e.v_d_rate - k.k_p * e.b_rate - k.k_d * s_v
        w = e.r_d_rate - k.k_psi * e.psi_rate - k.k_d * s_r
        push_u = k.load_u * hyperbolic_tangent(s_u / k.phi)
        push_v = k.load_v * hyperbolic_tangent(s_v / k.phi)
        push_r = k.load_r * hyperbolic_tangent(s_r / k.phi_r)
        tau[0] = k.m11 * p - surge_force(u, v, r, k) - push_u
        tau[2] = k.m22 * q + k.m23 * w - sway_force(u, v, r, k) - push_v
        tau[1] = k.m32 * q + k.m33 * w - yaw_moment(u, v, r, k) - push_r
        signals[0], signals[1], signals[2] = e.a, e.b, e.psi
        signals[3], signals[4], signals[5] = s_u, s_v, s_r
