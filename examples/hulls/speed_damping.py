"""Hulls whose linear damping goes with their speed, as Clarke's formulas have it: a plug-in."""

import math
from typing import Any, Literal

from podusv_cli.plugin import Disturbance, Vector, Vessel, kernel, value


class SpeedDamping(Disturbance):
    """What linear damping at the hull's speed has beside the vessel's own, which holds at `at`.

    b = (U/at - 1) D nu with U = sqrt(u^2 + v^2) and the vessel's X_u, Y_v, Y_r, N_v, N_r, so that
    the vessel's damping and b together are U/at times the former. U is the speed over ground.
    """

    kind: Literal["speed_damping"] = "speed_damping"
    at: float = value(1.0, "m/s", "speed at which the vessel's linear damping holds", gt=0)
    surge: float = value(
        1.0, "", "share of X_u that goes with the speed; 0 where it stays", ge=0, le=1
    )

    def constants_with(self, vessel: Vessel) -> dict[str, float]:
        """Its own numbers, and the derivatives of the vessel."""
        return vessel.constants() | self.constants()

    @staticmethod
    @kernel
    def evaluate(x: Vector, k: Any, b: Vector) -> None:
        """The load at state x = (x, y, psi, u, v, r)."""
        u, v, r = x[3], x[4], x[5]
        more = math.sqrt(u * u + v * v) / k.at - 1.0
        b[0] = more * k.surge * k.X_u * u
        b[1] = more * (k.Y_v * v + k.Y_r * r)
        b[2] = more * (k.N_v * v + k.N_r * r)
