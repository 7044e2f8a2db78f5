"""How far a law may count on sway that yaw causes: weight and gain for hull, speed and loads.

No moment changes the momentum M (v + x_n r) of the hull's neutral point: it moves by

    z' = -P r - d z,   z = v + x_n r

alone, so the sway that answers yaw takes 1/d to decay. With p = P/V > 1 the way from yaw to the
lateral position has a zero at d/(p - 1) in the right half plane, and a law that inverts the way is
unstable. A law is stable with a weight eta below 1/p on this sway, and a gain across the path below
d/(p - 1). docs/theory.md has the polynomial.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.kernel import kernel

T_D = 1.0  # s; a hull whose sway decays within this has less weight on it
ETA_SHARE = 0.75  # of 1/p, the weight that the linear loop bears at most
ACROSS_SHARE = 0.3  # of d/(p - 1), the gain that it bears at most
BANDWIDTH_SHARE = 0.9  # of Q (1 - eta p)/S, how fast the heading follows
ROUTH_SHARE = 0.95  # of the gain that Routh's third condition bears for p > 1
SLOW = 2.0  # times V_m; a target below this counts as one at rest, and less so up to twice this
NEAR = 10.0  # s, times V_m; nearer to it the gain is the smaller one, and less so up to twice this
REST_SHARE = 0.8  # of |Y_v|/m11
ANGLE = 0.19  # rad; the moment is in proportion to the angle up to here at least


class SwayResponse(NamedTuple):
    """How sway answers yaw: z' = -p V r - d z."""

    p: float  # P/V
    d: float  # 1/s


class GainSchedule(NamedTuple):
    """Gains of the linear loop at this speed and sway."""

    eta: float  # weight on the sway that yaw causes
    k_b: float  # gain across the path [1/s]


def neutral(nominal: Vessel, thrust_lever: float | None) -> dict[str, float]:
    """M [kg], x_n [m] and 1/thrust_lever [1/m], as constants of a law.

    With a thrust lever a moment comes with its sway force, so the sum of the sway equation and of
    the yaw equation over the lever has no moment in it.
    """
    per = 1.0 / thrust_lever if thrust_lever else 0.0
    mass = nominal.m22 + nominal.m32 * per
    x_n = (nominal.m23 + nominal.m33 * per) / mass
    return {"per_lever": per, "neutral_mass": mass, "x_n": x_n}


def pace_constants(m33: float, N_m: float, Q0: float, S0: float) -> dict[str, float]:
    """The pace f, Q = f^2 Q0 [1/s2], S = f S0 [1/s] and Q/S, as constants of a law.

    `m33` [kg m2] is the told inertia in yaw, `N_m` [N m] the largest moment that is asked for.
    """
    f = pace(m33, N_m, Q0)
    return {"pace": f, "Q": f * f * Q0, "S": f * S0, "Q_per_S": f * Q0 / S0}


def pace(m33: float, N_m: float, Q0: float) -> float:
    """How fast the law may be, f; below 1 where it would ask for more than N_m at `ANGLE`.

    `m33` [kg m2] is the inertia in yaw, `Q0` [1/s2] the gain that f = 1 stands for.
    """
    return min(1.0, math.sqrt(N_m / (ANGLE * m33 * Q0)))


# distance [m], speed [m/s] of the target; `near` and `slow` go from 0 to 1. Both fall from 1, at
# NEAR or SLOW times V_m, to 0 at twice that, so the gain has no jump.
@kernel
def resting_gain(distance: float, speed: float, k: Any) -> float:
    """k_p [1/s], or what a hull bears near a slow target.

    Sway of a hull that turns towards a target at rest grows where the gain exceeds |Y_v|/m11.
    """
    if speed >= 2.0 * SLOW * k.V_m:
        return float(k.k_p)
    near = min(max(2.0 - distance / (NEAR * k.V_m), 0.0), 1.0)
    slow = min(max(2.0 - speed / (SLOW * k.V_m), 0.0), 1.0)
    bearable = min(k.k_p, REST_SHARE * abs(k.Y_v) / k.m11)
    return float(k.k_p + near * slow * (bearable - k.k_p))


# turn [rad/s] of the target. Per lever, the yaw equation is added to the sway equation, see
# `neutral`. The sway present is that of the loads and of yaw, as if at right angles; less of it
# damps less. `from_yaw` [kg m/s] is the derivative by r of sway force and moment over the lever,
# but for m11 V.
@kernel
def sway_answer(V: float, v: float, v_l: float, turn: float, more: float, k: Any) -> SwayResponse:
    """p and d of the nominal vessel at the speed V [m/s], sway v [m/s], load sway v_l [m/s].

    `more` [m/s] is added to P.
    """
    sway, bend = abs(v_l), abs(turn)
    linear = k.Y_v + k.Y_rv * bend + k.per_lever * (k.N_v + k.N_rv * bend + (k.m11 - k.m22) * V)
    present = math.sqrt(v_l * v_l + (v - v_l) * (v - v_l))
    d = max((2.0 * abs(k.Y_vv) * present - linear) / k.neutral_mass, 0.0)
    from_yaw = k.Y_r + k.Y_vr * sway + k.per_lever * (k.N_r + k.N_vr * sway - k.m23 * V)
    P = (k.m11 * V - from_yaw) / k.neutral_mass - k.x_n * d + more
    return SwayResponse(P / V, d)


@kernel
def routh_gain(p: float, d: float, eta: float, k: Any) -> float:
    """A gain across the path below which Routh's third condition holds, for p > 1 [1/s].

    (a_3 a_2 - a_1) a_1 > a_3^2 a_0 with the coefficients of docs/theory.md for h = 0, where one
    of the two a_1 that are multiplied is taken as Q d, which is more.
    """
    a_3 = k.S + d
    room = max(a_3 * (k.Q * (1.0 - eta * p) + k.S * d) - k.Q * d, 0.0)
    return float(d * room / (a_3 * a_3 * d + (p - 1.0) * room))


# For p <= 1 yaw has no zero in the right half plane, so only the bandwidth limits the gain across.
# Each bound on k_b is a share of what stability or the bandwidth allows.
@kernel
def schedule(at: SwayResponse, k: Any) -> GainSchedule:
    """eta and k_b; `trust` is by how much the true p may exceed the told one."""
    p = k.trust * at.p
    eta = 1.0 / (1.0 + T_D * at.d / k.pace)
    k_b = k.pace * k.k_b0
    if p > ETA_SHARE:
        eta = min(eta, ETA_SHARE / p)
    if p > 1.0:
        k_b = min(k_b, ACROSS_SHARE * at.d / (p - 1.0), ROUTH_SHARE * routh_gain(p, at.d, eta, k))
    return GainSchedule(eta, min(k_b, BANDWIDTH_SHARE * k.Q_per_S * max(1.0 - eta * p, 0.0)))
