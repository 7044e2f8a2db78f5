"""Maneuvering of a fully actuated vessel: it follows a curve whose parameter has its own dynamics.

Source: R. Skjetne, T. I. Fossen and P. V. Kokotovic, "Adaptive maneuvering, with experiments, for a
model ship in a marine control laboratory", Automatica 41 (2005), 289-298; the text was not at hand.
The law is that of public programs that cite it. The curve is podusv's timetable (`path_time`).

Proved, with the nominal hull and without limits: without a load all errors vanish exponentially
for every update but the filtered one; a constant load leaves none with gamma above 0. Not proved:
the filtered update, other loads, another hull, limits, sampling. Anti-windup: back-calculation.
docs/laws/maneuvering.md has equations and proof.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np

from podusv_cli.components.controllers.base import Slots, each
from podusv_cli.components.controllers.path_time import (
    ALONG_PATH,
    EXTRA,
    PATH_TIME,
    SPEED,
    TIMED,
    PathTimed,
    path_pace,
)
from podusv_cli.components.controllers.pose_errors import ERRORS, pose_errors
from podusv_cli.components.controllers.velocity_loop import ALONE, Axis, Loop
from podusv_cli.components.vessels.plant import surge_force, sway_force, yaw_moment
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal

LOAD = len(TIMED)  # position in the memory of three numbers
LEARNT_LOAD = (
    Signal("load_x", "N", "learnt load to the north", r"\hat b_x"),
    Signal("load_y", "N", "learnt load to the east", r"\hat b_y"),
    Signal("load_n", "N m", "learnt moment", r"\hat b_\psi"),
)
AT_ALPHA = 1.0  # the place of "alpha" among the choices of `forces`


class Maneuvering(PathTimed):
    """Follows a curve with a heading at a speed of its own; the curve waits for the vessel."""

    kind: Literal["maneuvering"] = "maneuvering"
    signals: ClassVar[tuple[Signal, ...]] = (*ERRORS, *ALONG_PATH)
    k_p: float = value(0.1, "1/s", "gain of the position error", gt=0)
    k_psi: float = value(0.2, "1/s", "gain of the heading error", gt=0)
    k_d: float = value(0.5, "1/s", "gain of the velocity errors, times the inertia", gt=0)
    gamma: float = value(0.0, "N/m", "gain of the learnt load; of its moment in N m/rad", ge=0)
    forces: Literal["nu", "alpha"] = value(
        "nu", "", "whose damping and Coriolis forces are cancelled: the vessel's, or those at alpha"
    )

    def asks_sway(self) -> bool:
        """Whether its demand has a sway force: always."""
        return True

    def wants_heading(self) -> bool:
        """Whether it reads a heading: always."""
        return True

    def slots(self) -> Slots:
        """The memory: the path's time with its rate's filtered part and speed, then the load."""
        return each((*TIMED, *LEARNT_LOAD))

    def start(self, x: Vector, target: Vector, nominal: Vessel) -> Vector:
        """The memory (6,): the path's beginning, at the wanted speed, and no load."""
        return np.array([0.0, 0.0, self.speed, 0.0, 0.0, 0.0])

    def wants_loads(self) -> bool:
        """Whether it has to know the loads that act: for anti-windup, where it learns a load."""
        return self.gamma > 0.0

    def velocity_loops(self, axes: tuple[Axis, Axis], nu: Vector) -> list[Loop]:
        """As of `pose_backstepping`: m nu' = -(k_d + gain of the position) m nu, at any nu.

        For the axes surge and yaw. The law cancels the hull's damping, which is added here.
        """
        loops = []
        for axis, gain in zip(axes, (self.k_d + self.k_p, self.k_d + self.k_psi), strict=True):
            growth = np.array([axis.damping - gain * axis.told / axis.inertia])
            loops.append(Loop(axis.name, "k_d", axis.damping, growth, ALONE))
        return loops

    # x (6,), demand and tau (3,); changes rate (6,).
    @staticmethod
    @kernel
    def after_saturation(x: Vector, demand: Vector, tau: Vector, k: Any, rate: Vector) -> None:
        """Back-calculation: no load is learnt from the velocity error that the limit makes."""
        c, s = cos_sin(x[2])
        ahead = (tau[0] - demand[0]) / (k.m11 * k.k_d)
        aside = (tau[1] - demand[2]) / (k.m22 * k.k_d)
        rate[LOAD] -= k.gamma * (c * ahead - s * aside)
        rate[LOAD + 1] -= k.gamma * (s * ahead + c * aside)
        rate[LOAD + 2] -= k.gamma * (tau[2] - demand[1]) / (k.m33 * k.k_d)

    # x (6,), memory (6,), target (10,) at the path's time; writes tau (3,), rate and signals (6,).
    # z_1 is the error of the pose, z_2 (z_u, z_v, z_r) that of the velocity to alpha; (rate_u,
    # rate_v, rate_r) is alpha'. Demands are surge, yaw, sway.
    @staticmethod
    @kernel
    def law(
        t: float,
        x: Vector,
        memory: Vector,
        target: Vector,
        k: Any,
        tau: Vector,
        rate: Vector,
        signals: Vector,
    ) -> None:
        """tau = M alpha' - f - z_1 - K_d M z_2 - R^T b, with alpha' along s' = v_s + w."""
        u, v, r = x[3], x[4], x[5]
        e = pose_errors(x, target)
        a_2, b_2 = e.u_d_rate - r * e.v_d, e.v_d_rate + r * e.u_d
        path = path_pace(t, e, a_2, b_2, memory, k)
        v_s, pace, grows = path.wanted, path.rate, path.wanted_rate
        rate[PATH_TIME], rate[EXTRA], rate[SPEED] = pace, path.extra_rate, path.speed_rate

        z_u, z_v = u - e.u_d * v_s + k.k_p * e.a, v - e.v_d * v_s + k.k_p * e.b
        z_r = r - e.r_d * v_s + k.k_psi * e.psi
        rate_u = (a_2 * pace + r * e.v_d) * v_s + e.u_d * grows
        rate_v = (b_2 * pace - r * e.u_d) * v_s + e.v_d * grows
        rate_u -= k.k_p * (u - e.u_d * pace + r * e.b)
        rate_v -= k.k_p * (v - e.v_d * pace - r * e.a)
        rate_r = e.r_d_rate * pace * v_s + e.r_d * grows - k.k_psi * (r - e.r_d * pace)

        north, east = memory[LOAD], memory[LOAD + 1]
        rate[LOAD] = k.gamma * (e.cos * z_u - e.sin * z_v)
        rate[LOAD + 1] = k.gamma * (e.sin * z_u + e.cos * z_v)
        rate[LOAD + 2] = k.gamma * z_r
        if k.forces == AT_ALPHA:
            u, v, r = u - z_u, v - z_v, r - z_r
        p, q, turn = rate_u - k.k_d * z_u, rate_v - k.k_d * z_v, rate_r - k.k_d * z_r
        tau[0] = k.m11 * p - surge_force(u, v, r, k) - e.a - e.cos * north - e.sin * east
        tau[2] = k.m22 * q + k.m23 * turn - sway_force(u, v, r, k) - e.b
        tau[2] -= e.cos * east - e.sin * north
        tau[1] = k.m32 * q + k.m33 * turn - yaw_moment(u, v, r, k) - e.psi - memory[LOAD + 2]
        signals[0], signals[1], signals[2] = e.a, e.b, e.psi
        signals[3], signals[4], signals[5] = pace, v_s, path.across
