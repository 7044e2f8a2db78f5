"""Gains of momentum_vector's yaw part that are optimal for the hull as it is told.

On a straight line the neutral point's y, psi, z = v + x_n r and r obey

    y' = V psi + z,   psi' = r,   z' = -p V r - d z,   r' = alpha,

and the law, which steers the origin at y - x_n psi, is

    alpha = -Q (k_b (y - x_n psi)/V + psi + eta z/V) - S r,

a feedback of all four. Here it is the one with the least integral of
q_y y^2 + q_psi psi^2 + q_r r^2 + alpha^2. Its weights are those for which Q0, S0 and k_b0 are
optimal where sway does not answer yaw (p = 0). The closed loop's polynomial
s^4 + a s^3 + b s^2 + c s + e has (Kalman, "When is a linear control system optimal?", 1964; derived
in docs/theory.md)

    a^2 - 2 b = A_3,   b^2 - 2 a c + 2 e = A_2,   c^2 - 2 b e = A_1,   e^2 = A_0,

which leaves one equation in a. Its largest root makes the loop stable, and Newton's method comes
down to it from above.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from podusv_cli.components.controllers.momentum_schedule import Answer, schedule
from podusv_cli.core.kernel import kernel

LQR = 1.0  # the place of "lqr" among the choices of `gains`
NEWTON = 8  # steps; at the default gains a is exact to 1e-9 for p below 9
SLIGHT = 1e-3  # a smaller |p|, or d [1/s], is taken for this


class YawGains(NamedTuple):
    """Gains of the linear loop at this speed and sway."""

    eta: float  # weight on the sway that yaw causes
    k_b: float  # gain across the path [1/s]
    S: float  # gain of the yaw rate [1/s]
    Q_per_S: float  # wanted yaw rate per angle [1/s]


class Factor(NamedTuple):
    """The polynomial s^4 + a s^3 + b s^2 + c s + e of the optimal loop, as far as it is needed."""

    a: float  # 1/s
    b: float  # 1/s2
    c: float  # 1/s3


def weights(Q: float, S: float, k_b: float) -> dict[str, float]:
    """Weights q_r [1/s2], q_psi [1/s4] and V sqrt(q_y) [1/s3], as constants of a law.

    For p = 0 gains Q [1/s2], S [1/s] and k_b [1/s] are optimal with them if S^2 >= 2 Q and
    Q >= 2 S k_b; else a weight would be negative, and is 0. `chain_S` [1/s] is the S that is
    optimal for p = 0.
    """
    q_r, q_psi = max(S * S - 2.0 * Q, 0.0), max(Q * (Q - 2.0 * S * k_b), 0.0)
    squares = np.roots([1.0, -q_r, q_psi, -((Q * k_b) ** 2)])
    chain_S = float(np.sqrt(squares + 0j).real.sum())
    return {"q_r": q_r, "q_psi": q_psi, "across": Q * k_b, "chain_S": chain_S}


@kernel
def stable_factor(d: float, off: float, k: Any) -> Factor:
    """The stable one for the damping d [1/s] and off = |1 - p|."""
    e, square = k.across * d, d * d
    A_3, A_2 = square + k.q_r, k.q_r * square + k.q_psi
    A_1 = k.q_psi * square + k.across * k.across * off * off
    a = k.chain_S * math.sqrt(max(off, 1.0)) + d
    b = 0.5 * (a * a - A_3)
    c = 0.5 * (b * b + 2.0 * e - A_2) / a
    for _ in range(NEWTON):
        slope = 2.0 * (c * (b - c / a) - a * e)
        a -= (c * c - 2.0 * b * e - A_1) / slope
        b = 0.5 * (a * a - A_3)
        c = 0.5 * (b * b + 2.0 * e - A_2) / a
    return Factor(a, b, c)


@kernel
def optimal(at: Answer, V: float, k: Any) -> YawGains:
    """The optimal gains at the speed V [m/s], for sway that answers yaw exactly as told."""
    d = max(at.d, SLIGHT)
    p = math.copysign(max(abs(at.p), SLIGHT), at.p)
    found = stable_factor(d, abs(1.0 - p), k)
    S, heading = found.a - d, (found.c - k.across * (1.0 - p)) / d
    Q = max(heading + k.across * k.x_n / V, SLIGHT)
    eta = (heading + S * d - found.b) / (p * Q)
    return YawGains(eta, k.across / Q, S, Q / S)


@kernel
def yaw_gains(at: Answer, V: float, k: Any) -> YawGains:
    """Those of the schedule, or the optimal ones, at the speed V [m/s]."""
    if k.gains == LQR:
        return optimal(at, V, k)
    safe = schedule(at, k)
    return YawGains(safe.eta, safe.k_b, k.S, k.Q_per_S)
