"""A current: water that moves."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Literal

import numpy as np

from podusv_cli.components.disturbances.base import FLOW, Disturbance
from podusv_cli.components.vessels.plant import lacking, surge_force, sway_force, yaw_moment
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel, tail
from podusv_cli.core.random_words import gauss_markov
from podusv_cli.core.signal import Signal
from podusv_cli.core.steps import misfit


# V_c [m/s], beta_c [rad] where it flows to; x (6) is the vessel's state over ground; k has the
# hull's coefficients and `form`. Writes b (3) [N, N, N m].
# u_c_dot and v_c_dot are the current's rate in the hull's axes, which turn with r: 0 with
# `form: no_acceleration`, whose number is 1. The loads are differences between the hull's forces at
# the velocity through the water and over ground, see `Current`. `lacking` has what a vessel with a
# share of C(nu) lacks of these forces; it is added last, so that with all of it no bit changes.
@kernel
def load_of_flow(V_c: float, beta_c: float, x: Vector, k: Any, b: Vector) -> None:
    """The load that makes the equations of calm water those of water that moves at V_c."""
    u, v, r = x[3], x[4], x[5]
    cosine, sine = cos_sin(beta_c - x[2])
    u_c, v_c = V_c * cosine, V_c * sine
    turned = 1.0 if k.form == 0.0 else 0.0
    u_c_dot, v_c_dot = turned * r * v_c, -turned * r * u_c
    b[0] = surge_force(u - u_c, v - v_c, r, k) - surge_force(u, v, r, k) + k.m11 * u_c_dot
    b[1] = sway_force(u - u_c, v - v_c, r, k) - sway_force(u, v, r, k) + k.m22 * v_c_dot
    b[2] = yaw_moment(u - u_c, v - v_c, r, k) - yaw_moment(u, v, r, k) + k.m32 * v_c_dot
    past, still = lacking(u - u_c, v - v_c, r, k), lacking(u, v, r, k)
    b[0] += past[0] - still[0]
    b[1] += past[1] - still[1]
    b[2] += past[2] - still[2]


class Current(Disturbance):
    """Water that flows at the same velocity everywhere; the hull moves through it.

    With nu_r = nu - nu_c, the velocity through the water, the vessel obeys (Fossen 2011, 8.3)
    M nu_r' + C(nu_r) nu_r + D(nu_r) nu_r = tau, where nu_c' = (r v_c, -r u_c, 0) because the hull
    turns in the current. `b` is what this adds to the equations in calm water, so it depends on the
    state: -C(nu_r) nu_r - D(nu_r) nu_r + C(nu) nu + D(nu) nu + M nu_c'.

    Speed and direction may each wander about their means as first-order Gauss-Markov processes,
    with exact steps of `interval` and straight lines between them. The water's own acceleration,
    which is small where `time_constant` is long, is left out.
    """

    kind: Literal["current"] = "current"
    speed: float = value(0.1, "m/s", "mean speed", ge=0)
    direction: float = value(0.0, "rad", "mean direction that it flows to, from north to east")
    speed_std: float = value(0.0, "m/s", "standard deviation of the speed", ge=0)
    direction_std: float = value(0.0, "rad", "standard deviation of the direction", ge=0)
    time_constant: float = value(200.0, "s", "time constant of both", gt=0)
    interval: float = value(1.0, "s", "between two random numbers", gt=0)
    seed: int = value(1, "", "of the random numbers", ge=0, lt=2**63)
    form: Literal["irrotational", "no_acceleration"] = value(
        "irrotational",
        "",
        "no_acceleration leaves out M nu_c', as some papers do; then a hull "
        "that turns feels the ground",
    )

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Speed and direction of the flow, written behind the load."""
        return FLOW

    def constants_with(self, vessel: Vessel) -> dict[str, float]:
        """Its constants, and the coefficients of the hull."""
        return vessel.constants() | self.constants()

    def table_for(self, vessel: Vessel, duration: float) -> Vector:
        """Index of the last piece, then speed [m/s] and direction [rad] at 0, interval, ...

        Shape (1 + 2 count,), for a run of `duration` [s].
        """
        # Steady: one piece, which reaches as far as is wanted. Else one number lies behind the end.
        count = 2 if self._steady() else math.ceil(duration / self.interval) + 2
        speed = self.speed + self.speed_std * self._wandering("speed", count)
        direction = self.direction + self.direction_std * self._wandering("direction", count)
        return np.concatenate([[count - 2.0], np.column_stack([speed, direction]).ravel()])

    def _steady(self) -> bool:
        """Whether neither speed nor direction wanders."""
        return self.speed_std == self.direction_std == 0.0

    def _wandering(self, quantity: str, count: int) -> Vector:
        """A process of variance 1 at `count` instants (count,), steady from the start.

        `quantity` names its stream of random numbers, so speed and direction are independent.
        """
        if self._steady():
            return np.zeros(count)
        stream = (self.seed, "current", quantity)
        return gauss_markov(stream, count, self.interval / self.time_constant)

    def conflicts(self, vessel: Vessel, step: float) -> Iterator[tuple[str, str]]:
        """An interval that the step [s] does not divide: a kink in a step costs accuracy."""
        if not self._steady() and (fault := misfit(self.interval, step)):
            yield "interval", fault

    # t [s], x (6) state; table: the index of the last piece, then V_c [m/s] and beta_c [rad] every
    # k.interval [s]. Writes b (5): the load [N, N, N m], then both. Beyond the end the last pair
    # holds.
    @staticmethod
    @kernel
    def evaluate(t: float, x: Vector, k: Any, table: Vector, b: Vector) -> None:
        """The load of a flow on straight lines between two numbers of its table."""
        at = min(t / k.interval, table[0] + 1.0)
        piece = min(int(at), int(table[0]))
        here, share = tail(table, 1 + 2 * piece), at - piece
        V_c = here[0] + share * (here[2] - here[0])
        beta_c = here[1] + share * (here[3] - here[1])
        load_of_flow(V_c, beta_c, x, k, b)
        b[3], b[4] = V_c, beta_c
