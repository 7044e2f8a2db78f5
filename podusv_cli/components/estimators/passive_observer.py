"""Nonlinear passive observer with a wave filter, after Fossen and Strand (1999).

T. I. Fossen and J. P. Strand, "Passive nonlinear observer design for ships using Lyapunov methods:
full-scale experiments with a supply vessel", Automatica 35 (1999). Of each axis i = x, y, psi it
tells the slow motion, eta_est, from the motion that the waves add to what sensors see, xi_2:

    xi_1' = xi_2 + K_11 e                           e = w - eta_est - xi_2
    xi_2' = -omega_0^2 xi_1 - 2 lambda_w omega_0 xi_2 + K_12 e
    eta_est' = R(w_psi) nu_est + K_2 e
    b_est' = -b_est/T_b + K_3 e
    M nu_est' = f(nu_est) + tau + R(w_psi)^T (b_est + K_4 e)

and their rule for the gains of the wave filter, which puts the poles of e at -omega_c and at the
frequency omega_0 with the damping zeta_n in place of lambda_w:

    K_11 = -2 (zeta_n - lambda_w) omega_c/omega_0,  K_12 = 2 (zeta_n - lambda_w) omega_0,
    K_2 = omega_c

K_4 and K_3 = omega_b K_4 are free there, with 1/T_b << omega_b < omega_0 < omega_c. Here K_4 is
omega_c omega_v times the inertia, the mean of surge and sway for the position; so the velocities
are corrected at about the rate omega_v.

Two things are not the paper's. With `model: full`, f is the nominal vessel's whole damping and
Coriolis force; the paper has linear damping alone, for vessels that hardly move, and proves
convergence for it. And w is not the measurement itself but a prediction of it: w is put to the
measured value at each delivery, and w' = R(w_psi) nu_est + the wave model's velocity until the next
(I. Karafyllis and C. Kravaris, IEEE Trans. Automatic Control 54 (2009)). With the last value held
in its place the estimate would be half the time between deliveries behind. While nothing is
delivered e dies away, and the nominal vessel under the load found so far is left.
"""

from __future__ import annotations

from typing import Any, Literal, Self

import numpy as np
from pydantic import model_validator

from podusv_cli.components.estimators.base import ESTIMATE, LOADS, POSE_ALONE, Estimator
from podusv_cli.components.measurements.base import FRESH, VALUE
from podusv_cli.components.vessels.plant import lacking, plant, surge_force, sway_force, yaw_moment
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel, scratch
from podusv_cli.core.kinematics import wrap
from podusv_cli.core.signal import Signal

# Where the state has the parts of three numbers each that are behind the estimate.
SWING, WAVE, LOAD, SEEN = 6, 9, 12, 15
STATES = (
    *ESTIMATE,
    Signal("xi_est_x", "m s", "wave filter's integral of the wave motion north"),
    Signal("xi_est_y", "m s", "wave filter's integral of the wave motion east"),
    Signal("xi_est_psi", "rad s", "wave filter's integral of the wave motion in heading"),
    Signal("w_est_x", "m", "estimated wave motion, north"),
    Signal("w_est_y", "m", "estimated wave motion, east"),
    Signal("w_est_psi", "rad", "estimated wave motion in heading"),
    *LOADS,
    Signal("z_est_x", "m", "measurement of x predicted since the last delivery"),
    Signal("z_est_y", "m", "measurement of y predicted since the last delivery"),
    Signal("z_est_psi", "rad", "measurement of psi predicted since the last delivery"),
)


# drift [m/s or rad/s] is the pose's rate without correction, e [m or rad] measured less expected.
# Reads state and writes rate at axis i (0, 1, 2: x, y, psi).
@kernel
def axis(i: int, drift: float, e: float, gain: float, state: Vector, k: Any, rate: Vector) -> None:
    """Rates of everything but the velocities on axis i; `gain` is its K_3."""
    swing, wave = state[SWING + i], state[WAVE + i]
    swell = -k.omega_0 * (k.omega_0 * swing + 2.0 * k.lambda_w * wave)
    rate[i] = drift + k.K_2 * e
    rate[SWING + i] = wave + k.K_11 * e
    rate[WAVE + i] = swell + k.K_12 * e
    rate[LOAD + i] = gain * e - state[LOAD + i] / k.T_b
    rate[SEEN + i] = drift + swell


# Reads velocities state[3:6]; changes b (3) [N, N, N m]. `plant` has all forces of the vessel, so
# what goes beyond linear damping is taken off here as a load.
@kernel
def add_nonlinear_forces(state: Vector, k: Any, b: Vector) -> None:
    """Add to the load what leaves linear damping alone of the nominal vessel's forces."""
    u, v, r = state[3], state[4], state[5]
    less = lacking(u, v, r, k)
    b[0] += k.X_u * u - surge_force(u, v, r, k) - less[0]
    b[1] += k.Y_v * v + k.Y_r * r - sway_force(u, v, r, k) - less[1]
    b[2] += k.N_v * v + k.N_r * r - yaw_moment(u, v, r, k) - less[2]


class PassiveObserver(Estimator):
    """Slow motion, wave motion and slow loads from the measured pose (Fossen and Strand 1999)."""

    kind: Literal["passive_observer"] = "passive_observer"
    model: Literal["full", "linear"] = value(
        "full", "", "the nominal vessel with all its forces, or with linear damping alone"
    )
    omega_0: float = value(6.0, "rad/s", "frequency of the waves as the vessel meets them", gt=0)
    lambda_w: float = value(0.1, "", "damping of the wave model", gt=0)
    zeta_n: float = value(1.0, "", "damping of the wave filter; equal to lambda_w: no filter", gt=0)
    omega_c: float = value(8.0, "rad/s", "cut-off frequency of the position", gt=0)
    omega_v: float = value(2.0, "rad/s", "rate at which velocities are corrected", gt=0)
    omega_b: float = value(0.25, "rad/s", "rate at which loads are found", gt=0)
    T_b: float = value(1000.0, "s", "time constant with which a load is forgotten", gt=0)

    @model_validator(mode="after")
    def _published_conditions(self) -> Self:
        """Raises ValueError where the conditions of its proof do not hold."""
        if not 1.0 / self.T_b < self.omega_b < self.omega_0 < self.omega_c:
            raise ValueError(
                "the passive observer needs 1/T_b < omega_b < omega_0 < omega_c: "
                f"1/T_b = {1.0 / self.T_b:g}, omega_b = {self.omega_b:g}, "
                f"omega_0 = {self.omega_0:g}, omega_c = {self.omega_c:g} rad/s"
            )
        if self.zeta_n < self.lambda_w:
            raise ValueError(
                f"zeta_n = {self.zeta_n:g} is below lambda_w = {self.lambda_w:g}: the wave filter "
                "would pass the waves amplified; take a zeta_n of about 1"
            )
        return self

    @property
    def states(self) -> tuple[Signal, ...]:
        """The estimate, the wave model twice, the loads, the predicted measurement."""
        return STATES

    def constants_with(self, nominal: Vessel) -> dict[str, float]:
        """The constants, with the gains K_ij of the module's text that follow from the fields."""
        notch, stiff = 2.0 * (self.zeta_n - self.lambda_w), self.omega_c * self.omega_v
        force, moment = stiff * (nominal.m11 + nominal.m22) / 2.0, stiff * nominal.m33
        return super().constants_with(nominal) | {
            "K_11": -notch * self.omega_c / self.omega_0,
            "K_12": notch * self.omega_0,
            "K_2": self.omega_c,
            "K_3": self.omega_b * force,
            "K_3_psi": self.omega_b * moment,
            "K_4": force,
            "K_4_psi": moment,
        }

    # seen as the sensors write it (VALUE, FRESH); changes state at SEEN (3) [m, m, rad], which
    # between deliveries goes on as predicted.
    @staticmethod
    @kernel
    def correct(seen: Vector, state: Vector) -> None:
        """Put the predicted measurement to what was delivered; a heading by the nearest turn."""
        for i in range(2):
            if seen[FRESH + i] != 0.0:
                state[SEEN + i] = seen[VALUE + i]
        if seen[FRESH + 2] != 0.0:
            expected = state[2] + state[WAVE + 2]
            state[SEEN + 2] = expected + wrap(seen[VALUE + 2] - expected)

    # tau (3) [N, N, N m]; writes rate, as long as the state. e [m, m, rad] is what was measured
    # less what is expected with the wave motion; the load is fixed to the earth, and turned for the
    # plant.
    @staticmethod
    @kernel
    def follow(tau: Vector, state: Vector, k: Any, rate: Vector) -> None:
        """The observer's equations."""
        cosine, sine = cos_sin(state[SEEN + 2])
        e_x = state[SEEN] - state[0] - state[WAVE]
        e_y = state[SEEN + 1] - state[1] - state[WAVE + 1]
        e_psi = state[SEEN + 2] - state[2] - state[WAVE + 2]
        north, east = state[LOAD] + k.K_4 * e_x, state[LOAD + 1] + k.K_4 * e_y
        b = scratch(3)
        b[0] = cosine * north + sine * east
        b[1] = cosine * east - sine * north
        b[2] = state[LOAD + 2] + k.K_4_psi * e_psi
        if k.model != 0.0:
            add_nonlinear_forces(state, k, b)
        plant(state, tau, b, k, rate)
        u, v = state[3], state[4]
        axis(0, cosine * u - sine * v, e_x, k.K_3, state, k, rate)
        axis(1, sine * u + cosine * v, e_y, k.K_3, state, k, rate)
        axis(2, state[5], e_psi, k.K_3_psi, state, k, rate)

    def start(self, x: Vector, nominal: Vessel) -> Vector:
        """The state at t = 0: the truth, no waves, no loads, the pose as predicted measurement."""
        return np.concatenate([x, np.zeros(SEEN - len(ESTIMATE)), x[:3]])

    def needs(self) -> tuple[bool, ...]:
        """What has to be measured: the pose."""
        return POSE_ALONE

    def shortest_lag(self) -> float:
        """That of the fastest pole: -omega_c, or the wave filter's, overdamped above zeta_n = 1."""
        beyond = np.sqrt(max(self.zeta_n**2 - 1.0, 0.0))
        return float(1.0 / max(self.omega_c, self.omega_0 * (self.zeta_n + beyond)))
