"""Dynamic positioning of a fully actuated vessel: PID on position and heading.

Source: T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control (2021), section
15.3, with gains by pole placement; structure and gains checked against the public Marine Systems
Simulator, the book was not at hand. The feedforward is podusv's; it is zero at a pose that stays.

Proved, off the limits and without loads: without the integral, a hull that damps its motion comes
to a pose that stays, from any start, whatever its inertia. Not proved: the integral, a pose that
moves, loads, limits. Anti-windup: back-calculation. docs/laws/pose_pid.md has equations and proof.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np

from podusv_cli.components.controllers.base import Slots, each
from podusv_cli.components.controllers.pose_errors import ERRORS, pose_errors
from podusv_cli.components.controllers.pose_law import PoseLaw
from podusv_cli.components.controllers.velocity_loop import ALONE, Axis, Loop
from podusv_cli.core.component import value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal

SLOW = 0.1  # of the frequency of an axis: that of its integral
INTEGRALS = (
    Signal("int_x", "m s", "integral of the position error, north", r"\int\tilde x"),
    Signal("int_y", "m s", "integral of the position error, east", r"\int\tilde y"),
    Signal("int_psi", "rad s", "integral of the heading error", r"\int\tilde\psi"),
)


class PosePid(PoseLaw):
    """PID on position and heading, with feedforward of the motion that is asked for."""

    kind: Literal["pose_pid"] = "pose_pid"
    signals: ClassVar[tuple[Signal, ...]] = ERRORS
    w_x: float = value(0.5, "rad/s", "natural frequency of the position, north", gt=0)
    w_y: float = value(0.5, "rad/s", "natural frequency of the position, east", gt=0)
    w_r: float = value(1.0, "rad/s", "natural frequency of the heading", gt=0)
    zeta: float = value(1.0, "1", "damping ratio of the three axes", gt=0)
    integral: float = value(SLOW, "1", "frequency of the integrals over that of the axis", ge=0)

    def slots(self) -> Slots:
        """The memory: the integrals."""
        return each(INTEGRALS)

    def wants_loads(self) -> bool:
        """Whether it has to know the loads that act: for anti-windup, with integral action."""
        return self.integral > 0.0

    def velocity_loops(self, axes: tuple[Axis, Axis], nu: Vector) -> list[Loop]:
        """m nu' = -d nu - 2 zeta w m nu for the axes surge and yaw, at any nu.

        Without their positions, which are slower.
        """
        gains = (("w_x", self.w_x), ("w_r", self.w_r))
        return [
            Loop(
                axis.name,
                key,
                axis.damping,
                np.array([-2.0 * self.zeta * w * axis.told / axis.inertia]),
                ALONE,
            )
            for axis, (key, w) in zip(axes, gains, strict=True)
        ]

    # Changes rate (3,): integrals are north and east, loads along and across the bow.
    @staticmethod
    @kernel
    def after_saturation(x: Vector, demand: Vector, tau: Vector, k: Any, rate: Vector) -> None:
        """Back-calculation with the tracking times K_p/K_i (Astrom and Hagglund; Hanus)."""
        c, s = cos_sin(x[2])
        a, b = tau[0] - demand[0], tau[1] - demand[2]
        rate[0] -= (c * a - s * b) / (k.m11 * k.w_x * k.w_x)
        rate[1] -= (s * a + c * b) / (k.m22 * k.w_y * k.w_y)
        rate[2] -= (tau[2] - demand[1]) / (k.m33 * k.w_r * k.w_r)

    # x (6,), memory (3,), target (10,); writes tau (3,), rate (3,) and signals (3,). Demands are
    # surge, yaw, sway.
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
        """PID in the body frame, and feedforward."""
        ex, ey = x[0] - target[0], x[1] - target[1]
        e = pose_errors(x, target)
        c, s = e.cos, e.sin
        rate[0], rate[1], rate[2] = ex, ey, e.psi
        # acceleration that is asked for, in axes of the hull without their turning
        au, av = c * target[4] + s * target[5], c * target[5] - s * target[4]
        ud, vd, rd, ar = e.u_d, e.v_d, e.r_d, e.r_d_rate
        # K_p e + K_i int(e), north, east and in yaw
        slow, damped = k.integral, 2.0 * k.zeta
        north = k.m11 * k.w_x * k.w_x * (ex + slow * k.w_x * memory[0])
        east = k.m22 * k.w_y * k.w_y * (ey + slow * k.w_y * memory[1])
        turn = k.m33 * k.w_r * k.w_r * (e.psi + slow * k.w_r * memory[2])
        u, v, r = x[3] - ud, x[4] - vd, x[5] - rd
        # X_u, Y_v, ... are negative damping: D nu_d is fed forward
        drag_v, drag_r = k.Y_v * vd + k.Y_r * rd, k.N_v * vd + k.N_r * rd
        tau[0] = k.m11 * (au - damped * k.w_x * u) - k.X_u * ud - c * north - s * east
        tau[2] = k.m22 * (av - damped * k.w_y * v) + k.m23 * ar - drag_v + s * north - c * east
        tau[1] = k.m33 * (ar - damped * k.w_r * r) + k.m32 * av - drag_r - turn
        signals[0], signals[1], signals[2] = e.a, e.b, e.psi
