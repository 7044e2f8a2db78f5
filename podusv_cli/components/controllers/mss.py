"""Path following as MSS's demos have it: adaptive or integral line of sight, and a PID autopilot.

Source: github.com/cybergalactic/MSS, SIMotter.m (commit 108ceda), ALOSpsi.m (0fa4e0a), ILOSpsi.m
and LOSobserver.m (108ceda) of T. I. Fossen's Marine Systems Simulator. `alos` names the papers of
the guidance. The demo drives with constant thrust; the control of the speed is `los_pid`'s.

Proved: poles of the observer and, for Nomoto's model with the time constant T, of the heading
without its integral. Not proved: guidance and autopilot together. Anti-windup: none for the
heading, as in the source; back-calculation for the speed. docs/laws/mss.md has the equations.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from podusv_cli.components import rules as by
from podusv_cli.components.controllers.alos import LEARNT, learning
from podusv_cli.components.controllers.base import Slots, each
from podusv_cli.components.controllers.guidance import (
    STEERED,
    LineOfSight,
    course_frame,
    line_of_sight,
    wanted_speed,
)
from podusv_cli.components.controllers.los_pid import INTEGRALS
from podusv_cli.components.controllers.velocity_loop import Axis, Loop, pi_loop
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import Rule, Ruled, value
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.kinematics import wrap
from podusv_cli.core.signal import Signal

CRAB, OFFSET, FORCE, HEADING_I, ANGLE, LAGGED = range(6)  # positions in the memory
RESET = 0.1  # 1/T_i over wn
MEMORY = (
    *LEARNT,
    INTEGRALS[0],
    Signal("heading_i", "rad s", "integral of the heading less the observed line of sight"),
    Signal("psi_f", "rad", "observed angle of the line of sight", r"\psi_f"),
    Signal("xi", "rad", "observed angle of the line of sight, lagged", r"\xi"),
)


class Mss(LineOfSight):
    """Line of sight less a crab angle that is learnt, an observer of it, and PID of heading."""

    kind: Literal["mss"] = "mss"
    signals: ClassVar[tuple[Signal, ...]] = STEERED
    rules: ClassVar[dict[str, Rule]] = {
        **{name: rule for name, rule in LineOfSight.rules.items() if name != "lookahead"},
        "omega_u": by.SURGE,
    }
    against_windup: ClassVar[str] = "lower wn"
    lookahead: float = value(10.0, "m", "distance ahead on the path that the bow aims at", gt=0)
    learns: Literal["adaptive", "integral", "published"] = value(
        "published",
        "",
        "how the crab angle is found: by ALOS (published), by ILOS (integral), or "
        "as alos does it (adaptive)",
    )
    gamma: float = value(0.001, "rad/(m s)", "gain of the adapted angle", ge=0)
    crab_m: float = value(0.5, "rad", "largest angle of learns: adaptive", gt=0)
    sigma: float = value(0.001, "m/s", "gain of the integral", ge=0)
    K_f: float = value(0.3, "1/s", "gain of the line of sight's observer", gt=0)
    wn: float = value(1.5, "rad/s", "natural frequency of the heading", gt=0)
    zeta: float = value(1.0, "", "damping of the heading", gt=0)
    T: float = value(1.0, "s", "time constant of the yaw rate that is counted on (Nomoto)", gt=0)
    omega_u: Ruled = value(1.0, "rad/s", "bandwidth of the speed loop, a double pole", gt=0)

    @model_validator(mode="after")
    def _damps(self) -> Self:
        """Raises ValueError for gains with which the yaw rate is not damped."""
        if self.damping() <= 0.0:
            raise ValueError("2 zeta wn has to be above 1/T, else the yaw rate grows")
        return self

    def damping(self) -> float:
        """Gain of the yaw rate over the inertia [1/s], by pole placement."""
        return 2.0 * self.zeta * self.wn - 1.0 / self.T

    def slots(self) -> Slots:
        """The memory: what is learnt, the integrals, the observer."""
        return each(MEMORY)

    def start(self, x: Vector, target: Vector, nominal: Vessel) -> Vector:
        """The memory (6,): zeros, and the observer at the vessel's heading, at rest."""
        return np.array([0.0, 0.0, 0.0, 0.0, x[2], x[2]])

    def wants_loads(self) -> bool:
        """Whether it has to know the loads that act: always, for the integral of the speed."""
        return True

    # demand (2) [N, N m], tau (3) [N, N, N m]; changes rate at FORCE, whose integral is a load.
    @staticmethod
    @kernel
    def after_saturation(demand: Vector, tau: Vector, k: Any, rate: Vector) -> None:
        """Back-calculation with the tracking time 1/omega_u."""
        rate[FORCE] += k.omega_u * (tau[0] - demand[0])

    def steering(self) -> tuple[str, float]:
        """Key and gain [1/s] with which it turns: wn/(2 zeta), the slow end of its loop."""
        return "wn", 0.5 * self.wn / self.zeta

    def velocity_loops(self, axes: tuple[Axis, Axis], nu: Vector) -> list[Loop]:
        """Loops of the axes: surge with its integral, yaw with heading and its integral.

        By pole placement over the told inertia.
        """
        surge, yaw = axes
        square = self.wn * self.wn
        gains = np.array([-self.damping(), -square, -RESET * self.wn * square])
        return [
            pi_loop(surge, "omega_u", self.omega_u),
            Loop(
                yaw.name,
                "wn",
                yaw.damping,
                yaw.told / yaw.inertia * gains,
                np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
                name="PID loop",
            ),
        ]

    # x (6), memory and rate (6), target (6); writes tau (2) [N, N m], rate and signals (4). The
    # observer's two states, the angle and its lag, differ by its rate r_d. held and damped [rad/s2]
    # are the PID's parts over the inertia.
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
        """Pole placement: K_p = m33 wn^2, K_d = m33 (2 zeta wn - 1/T), T_i = 10/wn."""
        at = course_frame(x, target, k)
        rate[CRAB], rate[OFFSET] = learning(at.across, memory[CRAB], memory[OFFSET], k)
        sight, _ = line_of_sight(at, 0.0, memory[OFFSET], 0.0, k)
        psi_r = wrap(at.course - memory[CRAB] + sight)
        r_d = memory[ANGLE] - memory[LAGGED]
        rate[ANGLE] = r_d + k.K_f * wrap(psi_r - memory[ANGLE])
        rate[LAGGED] = r_d * (1.0 + k.K_f + 2.0 * math.sqrt(k.K_f))
        off = wrap(x[2] - memory[ANGLE])
        rate[HEADING_I] = off
        held = k.wn * k.wn * (off + RESET * k.wn * memory[HEADING_I])
        damped = (2.0 * k.zeta * k.wn - 1.0 / k.T) * (x[5] - r_d)
        tau[1] = k.m33 * (r_d / k.T - held - damped)
        u_d = wanted_speed(x, at, k)
        tau[0] = 2.0 * k.m11 * k.omega_u * (u_d - x[3]) + memory[FORCE]
        rate[FORCE] = k.m11 * k.omega_u * k.omega_u * (u_d - x[3])
        signals[0], signals[1], signals[2], signals[3] = at.along, at.across, psi_r, u_d
