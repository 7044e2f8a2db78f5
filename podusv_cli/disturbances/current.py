"""A current: water that moves."""

from __future__ import annotations

from typing import Any, Literal

from podusv_cli.core.component import value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal
from podusv_cli.disturbances.base import Disturbance
from podusv_cli.vessels.plant import surge_force, sway_force, yaw_moment
from podusv_cli.vessels.vessel import Vessel

V_C = Signal("V_c", "m/s", "speed of the current")
BETA_C = Signal("beta_c", "rad", "direction that the current flows to", r"\beta_c", wrapped=True)


class Current(Disturbance):
    """Water that flows at the same velocity everywhere; the hull moves through it.

    With nu_r = nu - nu_c, the velocity through the water, the vessel obeys (Fossen 2011, 8.3)
    M nu_r' + C(nu_r) nu_r + D(nu_r) nu_r = tau, where nu_c' = (r v_c, -r u_c, 0) because the hull
    turns in the current. `b` is what this adds to the equations in calm water, so it depends on the
    state: -C(nu_r) nu_r - D(nu_r) nu_r + C(nu) nu + D(nu) nu + M nu_c'.
    """

    kind: Literal["current"] = "current"
    speed: float = value(0.1, "m/s", "mean speed", ge=0)
    direction: float = value(0.0, "rad", "mean direction that it flows to, from north to east")
    form: Literal["irrotational", "no_acceleration"] = value(
        "irrotational", "", "no_acceleration leaves out M nu_c', as some papers do; then a hull "
        "that turns feels the ground",
    )  # fmt: skip

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Speed and direction."""
        return V_C, BETA_C

    def constants_with(self, vessel: Vessel) -> dict[str, float]:
        """Its constants, and the coefficients of the hull."""
        return vessel.constants() | self.constants()

    @staticmethod
    @kernel
    def evaluate(t: float, x: Vector, k: Any, table: Vector, b: Vector) -> None:
        """The load that makes the equations of calm water those of moving water."""
        V_c, beta_c = k.speed, k.direction
        u, v, r = x[3], x[4], x[5]
        cosine, sine = cos_sin(beta_c - x[2])
        u_c, v_c = V_c * cosine, V_c * sine
        turned = 1.0 if k.form == 0.0 else 0.0
        u_c_dot, v_c_dot = turned * r * v_c, -turned * r * u_c
        b[0] = surge_force(u - u_c, v - v_c, r, k) - surge_force(u, v, r, k) + k.m11 * u_c_dot
        b[1] = sway_force(u - u_c, v - v_c, r, k) - sway_force(u, v, r, k) + k.m22 * v_c_dot
        b[2] = yaw_moment(u - u_c, v - v_c, r, k) - yaw_moment(u, v, r, k) + k.m32 * v_c_dot
        b[3], b[4] = V_c, beta_c
