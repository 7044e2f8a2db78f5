"""PID on the velocity errors.

Source: the paper's reference [35], as the paper describes it; docs/model.md has the equations.
Proved: nothing. Not proved: stability together with the guidance, which keeps its standoff.
Anti-windup: back-calculation, with `anti_windup: auxiliary`.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from podusv_cli.components.controllers.base import Slots, each
from podusv_cli.components.controllers.crab import observe_sway, take_aim
from podusv_cli.components.controllers.tracking import (
    HELD,
    TRACKED,
    Tracking,
    TrackingController,
    track,
)
from podusv_cli.components.controllers.velocity_loop import Axis, Loop
from podusv_cli.core.component import value
from podusv_cli.core.kernel import Vector, kernel, scratch
from podusv_cli.core.signal import Signal

INTEGRAL_U, INTEGRAL_R, LAG_U, LAG_R = 2, 3, 4, 5
PATH = 1.0
MEMORY = (
    Signal("integral_u", "m", "integral of the surge velocity error (PID)", r"\int u_p"),
    Signal("integral_r", "rad", "integral of the yaw rate error (PID)", r"\int r_p"),
    Signal("lag_u", "m/s", "lagged surge velocity error (PID derivative)", "u_{p,f}"),
    Signal("lag_r", "rad/s", "lagged yaw rate error (PID derivative)", "r_{p,f}"),
)


# target (6); returns m/s and rad/s. A target at rest has no yaw rate.
@kernel
def reference(e: Tracking, target: Vector, k: Any) -> tuple[float, float]:
    """(u_d, r_d): the virtual controls, or the target's speed and the yaw rate of its path."""
    if k.reference != PATH:
        return e.alpha_u, e.alpha_r
    squared = target[2] * target[2] + target[3] * target[3]
    if squared == 0.0:
        return 0.0, 0.0
    return math.sqrt(squared), (target[2] * target[5] - target[3] * target[4]) / squared


class Pid(TrackingController):
    """Two PID loops, on surge speed and yaw rate, with a lagged derivative.

    They act on u_p = u_d - u and r_p = r_d - r.

    Section 3.1 defines u_d and r_d as the target's speed and its path's yaw rate. They feed back no
    position error, so by default they are replaced by the virtual controls. A difference quotient
    of the error is unstable with the printed gains at any step (K_Du/m11, K_Dr/m33 > 1), hence the
    derivative (e - lag)/T_d.
    """

    kind: Literal["pid"] = "pid"
    signals: ClassVar[tuple[Signal, ...]] = TRACKED
    K_Pu: float = value(1100.0, "kg/s", "proportional gain in surge", ge=0)
    K_Iu: float = value(10.0, "kg/s2", "integral gain in surge", ge=0)
    K_Du: float = value(90.0, "kg", "derivative gain in surge", ge=0)
    K_Pr: float = value(80.0, "kg m2/s", "proportional gain in yaw", ge=0)
    K_Ir: float = value(1.0, "kg m2/s2", "integral gain in yaw", ge=0)
    K_Dr: float = value(10.0, "kg m2", "derivative gain in yaw", ge=0)
    T_d: float = value(0.1, "s", "time constant of the derivative's lag", gt=0)
    lag_start: Literal["zero", "error"] = value(
        "error", "", "lagged error at the start: 0 (a kick at once), or the error (none)"
    )

    reference: Literal["virtual_controls", "path"] = value(
        "virtual_controls", "", "what u_d and r_d are: (21) and (30), or as in section 3.1"
    )

    @model_validator(mode="after")
    def _tracks(self) -> Self:
        """Raises ValueError for gains of 0 where the shortfall is fed back over them."""
        if self.wants_loads() and min(self.K_Pu, self.K_Pr) <= 0:
            raise ValueError(
                "anti_windup: auxiliary feeds the shortfall back over K_Pu and K_Pr, which have to "
                "be above 0"
            )
        return self

    def slots(self) -> Slots:
        """The memory: held direction, integrals and lagged errors."""
        return HELD + each(MEMORY) + self.swaying()

    def begin(self, x: Vector, target: Vector, k: Any) -> Vector:
        """Memory (slots,) at t = 0: integrals at zero, lagged errors at zero or at the error."""
        memory = super().begin(x, target, k)
        if self.lag_start == "error":
            u_d, r_d = reference(self.first_errors(x, memory, target, k), target, k)
            memory[[LAG_U, LAG_R]] = u_d - x[3], r_d - x[5]
        return memory

    def velocity_loops(self, axes: tuple[Axis, Axis], nu: Vector) -> list[Loop]:
        """Of each axis, with e = -u_p: m e' = -K_P e + K_I i + K_D l', i' = -e, l' = (-e - l)/T_d.

        Linear at any nu; the derivative makes it fast.
        """
        lag = 1.0 / self.T_d
        gains = (
            ("K_Du", self.K_Pu, self.K_Iu, self.K_Du),
            ("K_Dr", self.K_Pr, self.K_Ir, self.K_Dr),
        )
        return [
            Loop(
                axis.name,
                key,
                axis.damping,
                np.array([-K_P - K_D * lag, K_I, -K_D * lag]) / axis.inertia,
                np.array([[-1.0, 0.0, 0.0], [-lag, 0.0, -lag]]),
                cause="derivative",
                name="PID loop",
            )
            for axis, (key, K_P, K_I, K_D) in zip(axes, gains, strict=True)
        ]

    # demand (2), tau (3) [N, N, N m]; the integrals are those of errors, so K_I divides out.
    @staticmethod
    @kernel
    def after_saturation(demand: Vector, tau: Vector, k: Any, rate: Vector) -> None:
        """Back-calculation with the tracking time K_P/K_I (Astrom and Hagglund; Hanus)."""
        rate[INTEGRAL_U] += (tau[0] - demand[0]) / k.K_Pu
        rate[INTEGRAL_R] += (tau[2] - demand[1]) / k.K_Pr

    # x (6), memory and rate (6 or more), target (6); writes tau (2) [N, N m], rate and signals (6).
    # The direction that is held changes at samples alone, so its rates are 0.
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
        """tau = K_P e + K_I integral + K_D (e - lag)/T_d on both axes."""
        aim = take_aim(x, memory, target, k, scratch(6))
        e = track(x, memory, aim, k)
        u_d, r_d = reference(e, target, k)
        u_p, r_p = u_d - x[3], r_d - x[5]
        observe_sway(x, memory, target, k, rate)
        rate[0] = rate[1] = 0.0
        rate[INTEGRAL_U], rate[INTEGRAL_R] = u_p, r_p
        rate[LAG_U] = (u_p - memory[LAG_U]) / k.T_d
        rate[LAG_R] = (r_p - memory[LAG_R]) / k.T_d
        tau[0] = k.K_Pu * u_p + k.K_Iu * memory[INTEGRAL_U] + k.K_Du * rate[LAG_U]
        tau[1] = k.K_Pr * r_p + k.K_Ir * memory[INTEGRAL_R] + k.K_Dr * rate[LAG_R]
        signals[0], signals[1] = e.psi_d, e.psi_e
        signals[2], signals[3] = e.alpha_u, e.alpha_r
        signals[4], signals[5] = -u_p, -r_p
