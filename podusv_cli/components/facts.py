"""What a hull can do with its actuator in its loop: numbers known before a run.

From the nominal vessel, the actuator without failure, and the times of the loop. Components size
their defaults with them (`rules`), relative to the model ship for which the defaults were found:
CyberShip II's hull `paper_nonlinear` with 8 N and 2.5 N m. docs/laws/gains.md has the formulas.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.components.vessels.plant import surge_force, sway_force, yaw_moment
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import describe
from podusv_cli.core.errors import SizingError, in_a_line
from podusv_cli.core.kernel import bundle

# The model ship: length [m], speed at full thrust [m/s], acceleration [m/s2], yaw rate at full
# moment [rad/s], root of moment over inertia [1/s], force [N], moment [N m].
L0, U0, A0, R0, W0, F0, N0 = 1.255, 1.00409, 8.0 / 25.8, 0.95544, math.sqrt(2.5 / 2.76), 8.0, 2.5
PACE0 = 1.3  # 1/s, its gains of the yaw loop, which crosses at about twice this
SURGE0 = 0.75  # 1/s, its gain of the surge velocity
GRAVITY = 9.81  # m/s2
ENOUGH = 1e6  # of the model ship's acceleration; whoever gives this has no limit
DELIVERED = 0.999  # fraction of a demand that counts as all of it
CALM = 0.25  # gain times delay that a hand point bears without swinging
CRUISE = 0.6  # of the speed at full thrust
# The model ship's throttle per speed [s/m] and steering per yaw rate [s/rad] on the trial circle
THROTTLE0, STEERING0 = 0.358133, 0.102592
HALF = 0.5  # of the speed at full thrust, on the trial circle
TRIAL = math.radians(10.0), 0.1  # rad/s and part of N, which are at least needed on it
HALVINGS = 60  # of a speed, until it is a float's last digit
SPINNING = 5.0  # times U/L, the largest yaw rate that is counted on
ASKED = 20  # halvings of a speed for each of which an actuator is asked, some ms each


@dataclass(frozen=True)
class Facts:
    """What defaults are sized by.

    `period` is that of the law [s], 0 where it is continuous; `age` the mean age of what the law
    sees [s]; `noise` that of each measured quantity of the state, 0 where there is none; `duration`
    that of the run [s].
    """

    nominal: Vessel
    actuator: Actuator
    period: float = 0.0
    age: float = 0.0
    noise: tuple[float, ...] = (0.0,) * 6
    duration: float = 0.0

    def _given_demand(self, u: float, demand: tuple[float, float]) -> float:
        """What the actuator gives [N or N m] of a demand (tau_u [N], tau_r [N m]) once it settled.

        On the axis of the demand's larger number, straight ahead at the speed u [m/s]. Raises
        SizingError where the actuator raises.
        """
        x, axis = np.array([0.0, 0.0, 0.0, u, 0.0, 0.0]), int(abs(demand[1]) > abs(demand[0]))
        try:
            # Loads are surge, sway, yaw, where a demand is surge, yaw
            return float(self.actuator.settled(x, np.array(demand))[2 * axis])
        except Exception as error:  # of a plug-in
            raise SizingError(f"{describe(self.actuator)}: {in_a_line(error)}") from error

    def _ahead(self, u: float) -> float:
        """The largest surge force at the speed u [N]; infinite without a limit."""
        asked = ENOUGH * A0 * self.nominal.m11
        given = self._given_demand(u, (asked, 0.0))
        return given if given < DELIVERED * asked else math.inf

    @cached_property
    def L(self) -> float:
        """Length [m]."""
        return self.nominal.length

    @cached_property
    def F(self) -> float:
        """Force ahead at rest [N]; without a limit, that of the model ship scaled by Froude."""
        force = self._ahead(0.0)
        return force if math.isfinite(force) else A0 * self.nominal.m11

    @cached_property
    def U(self) -> float:
        """Speed at full thrust [m/s], at most sqrt(g L); by Froude without a limit of thrust."""
        if not math.isfinite(self._ahead(0.0)):
            return U0 * math.sqrt(self.lam)
        fastest = self._speed(self.F)
        if self._ahead(fastest) == self.F:  # thrust does not fall with speed: nothing to search
            return fastest
        return _rises_to(lambda u: self._drag(u) - self._ahead(u), 0.0, fastest, ASKED)

    def _drag(self, u: float) -> float:
        """The surge damping at the speed u [m/s], as a force [N] that has to be held."""
        return -surge_force(u, 0.0, 0.0, self._k)

    @cached_property
    def _k(self) -> Any:
        """The nominal vessel's constants, for the kernels of forces."""
        return bundle(self.nominal.constants())

    def _speed(self, force: float) -> float:
        """Speed at which the surge damping takes this force [m/s]."""
        return _rises_to(self._drag, force, math.sqrt(GRAVITY * self.L))

    @cached_property
    def N(self) -> float:
        """Least moment left at either side while cruising [N m]; by Froude without a limit."""
        # By Froude rates go with 1/sqrt(lam), so a moment goes with m33 times 1/lam
        asked = ENOUGH * W0 * W0 * self.nominal.m33 / self.lam
        u = CRUISE * self.U
        cruising = self._drag(u)
        given = [side * self._given_demand(u, (cruising, side * asked)) for side in (1.0, -1.0)]
        least = min(given)  # a single rudder or pod may give less to one side
        return least if least < DELIVERED * asked else asked / ENOUGH

    @cached_property
    def throttle(self) -> float:
        """Part of the force F that holds half the top speed, over that speed [s/m]."""
        u = HALF * self.U
        return self._drag(u) / (self.F * u)

    @cached_property
    def steering(self) -> float:
        """Part of the moment N that holds the trial circle, over its yaw rate [s/rad].

        It is the widest one at half the top speed that takes 10 deg/s and a tenth of N, or the
        tightest one where 10 deg/s take more than N.
        """
        rate, least = TRIAL
        # The trial's own yaw rate is in the range even where 5 U/L is less
        highest = max(SPINNING * self.U / self.L, rate)
        if not least <= self._turning(rate) <= 1.0:
            wanted = least if self._turning(rate) < least else 1.0
            rate = _rises_to(self._turning, wanted, highest)
        return self._turning(rate) / rate

    def _turning(self, r: float) -> float:
        """Part of N that holds the yaw rate r [rad/s] at half the top speed, at rest in sway."""
        u = HALF * self.U
        # The search starts from 0, so it runs over v + U: v from -U to U
        drift = _rises_to(lambda v: -sway_force(u, v - self.U, r, self._k), 0.0, 2.0 * self.U)
        return -yaw_moment(u, drift - self.U, r, self._k) / self.N

    @cached_property
    def r_top(self) -> float:
        """Yaw rate at which the yaw damping alone takes N [rad/s], at most 5 U/L."""
        linear, square = -self.nominal.N_r, -self.nominal.N_rr
        highest = SPINNING * self.U / self.L
        return _rises_to(lambda r: (linear + square * r) * r, self.N, highest)

    @cached_property
    def w_N(self) -> float:
        """sqrt(N/m33) [1/s]: how fast the moment turns the hull."""
        # One side may have no moment left, or less than none
        return math.sqrt(max(self.N, 0.0) / self.nominal.m33)

    @cached_property
    def a_F(self) -> float:
        """F/m11 [m/s2]."""
        return self.F / self.nominal.m11

    @cached_property
    def T_u(self) -> float:
        """Delay of the surge loop [s]: the actuator, half a period, the age of what is seen."""
        return self.actuator.lags()[0] + self._late

    @cached_property
    def T_r(self) -> float:
        """Delay of the yaw loop [s]: as `T_u`, with the actuator's lag in yaw."""
        return self.actuator.lags()[1] + self._late

    @property
    def _late(self) -> float:
        """What both loops wait for [s]: the command, half a period, and the age of what is seen."""
        return self.actuator.delay() + 0.5 * self.period + self.age

    @cached_property
    def lam(self) -> float:
        """Length over that of the model ship."""
        return self.L / L0

    @cached_property
    def s(self) -> float:
        """Speed at full thrust over that of the model ship."""
        return self.U / U0

    @cached_property
    def r_f(self) -> float:
        """Yaw rate at full moment over that of the model ship."""
        return self.r_top / R0

    @cached_property
    def a_f(self) -> float:
        """Acceleration over that of the model ship."""
        return self.a_F / A0

    @cached_property
    def w_f(self) -> float:
        """w_N over that of the model ship."""
        return self.w_N / W0

    @cached_property
    def c(self) -> float:
        """Gain times delay; above 0.3 only where the loop would be slower than the hull."""
        # 0.3 leaves a yaw loop of two equal gains about 41 deg of phase (docs/laws/gains.md)
        return min(max(0.6 * self.T_r * self.U / self.L, 0.3), 0.6)

    @cached_property
    def g_r(self) -> float:
        """Pace of yaw over that of the model ship."""
        return min(self.w_f, _over(self.c, PACE0 * self.T_r))

    @cached_property
    def g_u(self) -> float:
        """Pace of surge over that of the model ship."""
        return min((self.a_F / self.U) / (A0 / U0), _over(self.c, SURGE0 * self.T_u))

    @cached_property
    def g_p(self) -> float:
        """Pace of the position: the slower of both."""
        return min(self.g_r, self.g_u)

    @cached_property
    def g_h(self) -> float:
        """Pace of laws that steer a hand point, which bear less delay."""
        bears = min(_over(CALM, PACE0 * self.T_r), _over(CALM, SURGE0 * self.T_u))
        return min(self.g_p, bears)

    def in_words(self) -> str:
        """The facts in a line, with what limits the pace of yaw; or why there are none."""
        try:
            return self._in_words()
        # What quotes the facts is not to fail where an actuator cannot be asked
        except (SizingError, ArithmeticError, ValueError) as error:
            return f"no facts: {in_a_line(error)}"

    def _in_words(self) -> str:
        """The facts with their units, in a sentence."""
        # g_r is the smaller of w_f, the pace that the moment gives, and what the delay allows
        why = "the moment" if self.g_r == self.w_f else "the delay"
        return (
            f"F = {self.F:.4g} N, U = {self.U:.4g} m/s, N = {self.N:.4g} N m, r_top = "
            f"{self.r_top:.3g} rad/s, T_u = {self.T_u:.3g} s, T_r = {self.T_r:.3g} s: yaw at "
            f"{self.g_r:.3g} times the model ship's pace, which {why} limits, surge at "
            f"{self.g_u:.3g} times"
        )


def _over(number: float, delay: float) -> float:
    """A number over a delay [s]; infinite without a delay."""
    return number / delay if delay > 0.0 else math.inf


def _rises_to(
    force: Callable[[float], float], wanted: float, highest: float, halvings: int = HALVINGS
) -> float:
    """The speed in [0, `highest`] at which `force`, which rises with speed, reaches `wanted`.

    Speed and force have the units of `force`. By `halvings` bisections, each one call of `force`.
    """
    low, high = 0.0, highest
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if force(middle) < wanted else (low, middle)
    return 0.5 * (low + high)
