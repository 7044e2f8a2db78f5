"""What most boats run: line-of-sight guidance, a heading autopilot, and control of the speed.

Source: T. I. Fossen, M. Breivik and R. Skjetne, "Line-of-sight path following of underactuated
marine craft", IFAC Proceedings 36 (2003), 211-216. The bow points at a point that lies the
lookahead ahead of the nearest point of the path. No part of it knows the drift, so in a cross load
it stays beside the path.

Proved: the poles of the speed's and the heading's loops of an undamped hull. Not proved: anything
about guidance and loops together, or limits. Anti-windup: back-calculation. Equations:
docs/laws/los_pid.md.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np

from podusv_cli.components import rules as by
from podusv_cli.components.controllers.base import Slots, each
from podusv_cli.components.controllers.guidance import (
    STEERED,
    LineOfSight,
    course_frame,
    line_of_sight,
    wanted_speed,
)
from podusv_cli.components.controllers.velocity_loop import Axis, Loop, pi_loop
from podusv_cli.core.component import Rule, Ruled, value
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.kinematics import wrap
from podusv_cli.core.signal import Signal

FORCE, MOMENT = 0, 1  # positions in the memory
INTEGRALS = (
    Signal("force_i", "N", "surge force that the integral of the speed error makes"),
    Signal("moment_i", "N m", "yaw moment that the integral of the heading error makes"),
)


class LosPid(LineOfSight):
    """Steers the bow to the line of sight, with PID control of heading and PI control of speed."""

    kind: Literal["los_pid"] = "los_pid"
    signals: ClassVar[tuple[Signal, ...]] = STEERED
    rules: ClassVar[dict[str, Rule]] = LineOfSight.rules | {
        "omega_u": by.SURGE,
        "omega_psi": by.YAW,
    }
    omega_u: Ruled = value(1.0, "rad/s", "bandwidth of the speed loop, a double pole", gt=0)
    omega_psi: Ruled = value(1.2, "rad/s", "bandwidth of the heading loop, a triple pole", gt=0)

    def slots(self) -> Slots:
        """The memory: the integrals."""
        return each(INTEGRALS)

    def wants_loads(self) -> bool:
        """Whether it has to know the loads that act: always, for anti-windup."""
        return True

    # demand (2) [N, N m], tau (3) [N, N, N m]; changes rate (2), of integrals that are loads.
    @staticmethod
    @kernel
    def after_saturation(demand: Vector, tau: Vector, k: Any, rate: Vector) -> None:
        """Back-calculation with the tracking times 1/omega (Astrom and Hagglund)."""
        rate[FORCE] += k.omega_u * (tau[0] - demand[0])
        rate[MOMENT] += k.omega_psi * (tau[2] - demand[1])

    def steering(self) -> tuple[str, float]:
        """Key and gain [1/s] with which it turns the hull."""
        return "omega_psi", self.omega_psi

    def velocity_loops(self, axes: tuple[Axis, Axis], nu: Vector) -> list[Loop]:
        """Loops of the axes: surge with its integral, yaw with heading and integral.

        Integrals are per told inertia. Yaw has a triple pole at -omega_psi = -w, whose polynomial
        has the coefficients 3 w, 3 w^2, w^3.
        """
        surge, yaw = axes
        to_r, w = yaw.told / yaw.inertia, self.omega_psi
        return [
            pi_loop(surge, "omega_u", self.omega_u),
            Loop(
                yaw.name,
                "omega_psi",
                yaw.damping,
                to_r * np.array([-3.0 * w, -3.0 * w * w, 1.0]),
                np.array([[1.0, 0.0, 0.0], [0.0, -w * w * w, 0.0]]),
                name="PID loop",
                told=np.array([0.0, w / to_r]),
            ),
        ]

    # x (6), memory and rate (2), target (6); writes tau (2) [N, N m], rate and signals (4). Gains
    # are those of a double pole at -omega_u and a triple one at -omega_psi.
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
        """The heading is damped by the yaw rate itself; its integral holds a steady turn."""
        at = course_frame(x, target, k)
        sight, _ = line_of_sight(at, max(at.along, 0.0), 0.0, 0.0, k)
        psi_r = wrap(at.course + sight)
        u_d = wanted_speed(x, at, k)
        w_u, w_psi = k.omega_u, k.omega_psi
        u_e, psi_e = u_d - x[3], wrap(psi_r - x[2])
        tau[0] = 2.0 * k.m11 * w_u * u_e + memory[FORCE]
        tau[1] = 3.0 * k.m33 * w_psi * (w_psi * psi_e - x[5]) + memory[MOMENT]
        rate[FORCE] = k.m11 * w_u * w_u * u_e
        rate[MOMENT] = k.m33 * w_psi * w_psi * w_psi * psi_e
        signals[0], signals[1], signals[2], signals[3] = at.along, at.across, psi_r, u_d
