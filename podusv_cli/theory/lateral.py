"""Sway and yaw of laws that turn the velocity vector, linearised on a straight line.

The target goes north at the speed V, the law is told the vessel and the loads exactly, the actuator
makes moment and surge force without limits. Then the observer and surge are loops of their own, and
what is left has four states: y [m] to starboard of the line, psi [rad], v [m/s], r [rad/s].
docs/theory.md derives both polynomials.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from podusv_cli.components.controllers.momentum_schedule import resting_gain, schedule
from podusv_cli.components.controllers.momentum_schedule import sway_answer as momentum_answer
from podusv_cli.components.controllers.momentum_vector import MomentumVector
from podusv_cli.components.controllers.velocity_vector import VelocityVector
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.kernel import Vector, bundle


class SwayAnswer(NamedTuple):
    """How the sway of a hull that goes straight answers yaw: v' = -p V r - d v."""

    p: float  # p_eff = (m11 V - Y_r)/(m22 V)
    d: float  # sway damping over m22 [1/s]


class MomentumGains(NamedTuple):
    """Gains of `momentum_vector` at one speed."""

    eta: float  # weight on the sway that yaw causes
    k_b: float  # gain across the path [1/s]
    Q: float  # 1/s2
    S: float  # 1/s
    h: float  # k_b x_n/V, since the origin and not the neutral point is steered


def sway_answer(vessel: Vessel, V: float, v: float = 0.0) -> SwayAnswer:
    """p_eff and d at the speed V [m/s] and the sway v [m/s] that the loads cause; m23 left out."""
    sway, yaw = _sway_slopes(vessel, V, v)
    return SwayAnswer(-yaw / (vessel.m22 * V), -sway / vessel.m22)


def _sway_slopes(vessel: Vessel, u: float, v: float) -> tuple[float, float]:
    """Derivatives of the sway force after v [kg/s] and r [kg m/s] at r = 0."""
    after_r = vessel.Y_r + vessel.Y_vr * abs(v) - vessel.m11 * u
    return vessel.Y_v + 2.0 * vessel.Y_vv * abs(v), after_r


def _yaw_slopes(vessel: Vessel, u: float, v: float) -> tuple[float, float]:
    """Derivatives of the yaw moment after v [kg m/s] and r [kg m2/s] at r = 0."""
    after_v = vessel.N_v + 2.0 * vessel.N_vv * abs(v) + (vessel.m11 - vessel.m22) * u
    return after_v, vessel.N_r + vessel.N_vr * abs(v) - vessel.m23 * u


def velocity_vector_loop(
    law: VelocityVector, vessel: Vessel, V: float, v: float = 0.0, share: float = 0.0
) -> Vector:
    """Rates of (y, psi, v, r) with `velocity_vector`, by the full mass matrix; shape (4, 4).

    At the speed V [m/s] and the sway v [m/s] that the loads cause. Every vector below has the
    factors (4,) of (y, psi, v, r) in one quantity of the loop.

    `share` is the sway force that comes with a yaw moment of 1 N m [1/m]. Without it, m23 and m32,
    and with V above V_m, the characteristic polynomial is that of `velocity_vector_polynomial`.
    """
    c = min(1.0, V * V / (law.V_m * law.V_m))
    sway, yaw = np.zeros((2, 4))
    sway[2:], yaw[2:] = _sway_slopes(vessel, V, v), _yaw_slopes(vessel, V, v)
    # The moment that balances the hull's comes with a sway force of pods `thrust_lever` [m] astern
    across = sway + yaw / (law.thrust_lever or np.inf)
    y_rate, r = np.array([0.0, V, 1.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0])
    turn = -c * law.k_p / V * y_rate  # of V_c
    v_s = np.array([0.0, 0.0, 1.0, 0.0]) * (1.0 + law.T_v * across[2] / vessel.m22)
    v_s += law.T_v * across[3] / vessel.m22 * turn
    g, V_b = c * law.k_psi, np.array([-law.k_p, -V, 0.0, 0.0])  # sway part of V_c
    r_d = g * (V_b - v_s) / V + turn
    alpha = g * (turn - r) + law.k_r * (r_d - r)
    moment = vessel.m33 * alpha - yaw
    mass = np.array([[vessel.m22, vessel.m23], [vessel.m32, vessel.m33]])
    return np.vstack(
        [y_rate, r, np.linalg.solve(mass, [sway + share * moment, vessel.m33 * alpha])]
    )


def velocity_vector_polynomial(law: VelocityVector, at: SwayAnswer) -> Vector:
    """Coefficients (5,) of the characteristic polynomial of `velocity_vector`, s^4 first.

    For m23 = m32 = 0 above V_m; `at` is how sway answers yaw.
    """
    (p, d), a, b, T = at, law.k_psi, law.k_r, law.T_v
    q = law.k_p * (a + b)
    return np.array(
        [
            1.0,
            d + a + b,
            a * b * (T * d * p + (1.0 - p) * (1.0 + T * law.k_p * p)) + d * (a + b) + q * (1.0 - p),
            a * b * (T * d * law.k_p * p + d + law.k_p * (1.0 - p)) + d * q,
            d * law.k_p * a * b,
        ]
    )


def momentum_vector_polynomial(at: SwayAnswer, gains: MomentumGains) -> Vector:
    """Coefficients (5,) of the polynomial of `momentum_vector` with these gains, s^4 first.

    `at` is the answer of the neutral point's sway z: z' = -p V r - d z.
    """
    (p, d), (eta, k_b, Q, S, h) = at, gains
    return np.array(
        [
            1.0,
            S + d,
            Q * (1.0 - h - eta * p) + S * d,
            Q * (d * (1.0 - h) + k_b * (1.0 - p)),
            Q * k_b * d,
        ]
    )


def momentum_vector_gains(
    law: MomentumVector, vessel: Vessel, V: float, v: float = 0.0
) -> tuple[SwayAnswer, MomentumGains]:
    """What the law takes p and d for, and its gains at the speed V [m/s] and load sway v [m/s].

    `vessel` is what the law is told. The target is reached (distance 0) and goes straight on at V.
    """
    k = bundle(law.constants_with(vessel))
    answer = momentum_answer(V, v, v, 0.0, 0.0, k)
    eta, k_b = schedule(answer, k)
    k_b = min(k_b, resting_gain(0.0, V, k))
    return SwayAnswer(*answer), MomentumGains(eta, k_b, k.Q, k.S, k_b * k.x_n / V)


def growth(polynomial: Vector) -> float:
    """Largest real part of the roots [1/s] of a polynomial's coefficients (n,), highest first."""
    return float(np.roots(polynomial).real.max())
