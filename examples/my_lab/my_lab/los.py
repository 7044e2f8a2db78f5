"""Line-of-sight guidance with PID on heading and speed."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

import numpy as np

from podusv_cli.plugin import Controller, Signal, Slots, Vector, Vessel, kernel, value

E_Y = Signal("e_y", "m", "cross-track error: how far right of the path the vessel is")
CHI_D = Signal("chi_d", "rad", "course that the line of sight asks for")
INTEGRAL = Signal("integral_psi", "rad s", "integral of the heading error")


class LineOfSight(Controller):
    """Line-of-sight guidance with PID on the heading and P on the speed.

    chi_d = chi - atan(e_y / lookahead), where chi is the course of the path (Fossen 2011, 10.3.2).
    The speed follows that of the target, and more where the vessel lags behind it.
    """

    kind: Literal["los"] = "los"
    signals: ClassVar[tuple[Signal, ...]] = (E_Y, CHI_D)
    lookahead: float = value(3.0, "m", "distance ahead on the path at which the vessel aims", gt=0)
    K_x: float = value(0.2, "1/s", "speed that is added for each metre behind the target", ge=0)
    K_u: float = value(60.0, "kg/s", "gain of the speed error", ge=0)
    K_p: float = value(40.0, "N m", "gain of the heading error", ge=0)
    K_i: float = value(1.0, "N m/s", "gain of its integral", ge=0)
    K_d: float = value(30.0, "N m s", "gain of the yaw rate", ge=0)

    def slots(self) -> Slots:
        """The integral of the heading error."""
        return ((INTEGRAL, 1),)

    def start(self, x: Vector, target: Vector, nominal: Vessel) -> Vector:
        """The integral at zero."""
        return np.zeros(1)

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
        """Errors along and across the path, then PID."""
        chi = math.atan2(target[3], target[2])
        speed = math.sqrt(target[2] * target[2] + target[3] * target[3])
        dx, dy = x[0] - target[0], x[1] - target[1]
        behind = -math.cos(chi) * dx - math.sin(chi) * dy
        e_y = -math.sin(chi) * dx + math.cos(chi) * dy
        chi_d = chi - math.atan(e_y / k.lookahead)
        e_psi = math.sin(chi_d - x[2])  # without a jump at pi
        tau[0] = k.K_u * (speed + k.K_x * behind - x[3])
        tau[1] = k.K_p * e_psi + k.K_i * memory[0] - k.K_d * x[5]
        rate[0] = e_psi
        signals[0], signals[1] = e_y, chi_d
