"""The turning circle: steering at one angle from a straight approach on."""

from __future__ import annotations

import math
from typing import Any, Literal

from podusv_cli.components.controllers.base import ManoeuvreTrial, Slots, each
from podusv_cli.components.controllers.manoeuvre import SIDE, Steering, has_begun, steer_thrust
from podusv_cli.core.component import value
from podusv_cli.core.kernel import Vector, kernel


class TurningCircle(Steering):
    """Steers at `angle` to starboard from `execute` on (IMO MSC.137(76), 35 deg)."""

    kind: Literal["turning_circle"] = "turning_circle"
    angle: float = value(
        math.radians(35.0), "rad", "angle of the thrust to starboard", gt=0, le=0.5 * math.pi
    )

    def slots(self) -> Slots:
        """The memory: whether it steers."""
        return each((SIDE,))

    def trial(self) -> ManoeuvreTrial:
        """The turning circle, in which nothing is reversed."""
        return ManoeuvreTrial("turning circle", self.execute)

    # t [s]; writes memory (1): 1 once the trial has begun.
    @staticmethod
    @kernel
    def sample(t: float, memory: Vector, k: Any) -> None:
        """Begin."""
        memory[0] = 1.0 if has_begun(t, k) else 0.0

    # memory and rate (1); writes tau (2) [N, N m] and signals[0], the angle [rad].
    @staticmethod
    @kernel
    def law(memory: Vector, k: Any, tau: Vector, rate: Vector, signals: Vector) -> None:
        """Straight, then at the angle."""
        steer_thrust(k.angle if memory[0] > 0.0 else 0.0, 1.0, k, tau, signals)
        rate[0] = 0.0
