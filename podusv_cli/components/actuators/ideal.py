"""The wished-for force: whatever the law asks for acts at once."""

from __future__ import annotations

from typing import ClassVar, Literal

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.core.kernel import Vector, kernel


class Ideal(Actuator):
    """No limits, no lag, no sway force, as in the paper's simulations."""

    kind: Literal["ideal"] = "ideal"
    feels_motion: ClassVar[bool] = False
    cuts: ClassVar[bool] = True

    # demand (2) [N, N m]; writes tau (3) [N, N, N m].
    @staticmethod
    @kernel
    def drive(demand: Vector, tau: Vector) -> None:
        """tau = (tau_u, 0, tau_r)."""
        tau[0] = demand[0]
        tau[1] = 0.0
        tau[2] = demand[1]
