"""The wished-for forces of a fully actuated vessel: whatever the law asks for acts at once."""

from __future__ import annotations

from typing import Literal

from podusv_cli.components.actuators.full import FullActuator
from podusv_cli.core.kernel import Vector, kernel


class IdealFull(FullActuator):
    """Surge force, sway force and yaw moment as they are asked for, without limits or lag."""

    kind: Literal["ideal_full"] = "ideal_full"

    # demand (3) [N, N m, N]; writes tau (3) [N, N, N m].
    @staticmethod
    @kernel
    def drive(demand: Vector, tau: Vector) -> None:
        """tau = (tau_u, tau_v, tau_r) from demand = (tau_u, tau_r, tau_v)."""
        tau[0] = demand[0]
        tau[1] = demand[2]
        tau[2] = demand[1]
