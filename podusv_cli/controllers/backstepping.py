"""Full backstepping: the same law with analytic derivatives of the virtual control.

Stands for the comparison law of the paper's reference [25], whose text podusv does not have; it is
therefore called Li-type. Derivatives use the nominal vessel as in (12): no disturbance, no inertia
coupling between sway and yaw.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar, Literal

from podusv_cli.controllers.polar_backstepping import PolarBackstepping, polar_backstepping
from podusv_cli.controllers.tracking import Tracking, exact_rate
from podusv_cli.kernels import Vector, kernel, specialise
from podusv_cli.vessels.plant import surge_force, sway_force


@kernel
def direction_rate(e: Tracking, x: Vector, target: Vector, k: Any) -> float:
    """Exact rate of psi_d [rad/s]; zero where the direction is held."""
    return 0.0 if e.distance <= k.hold_below else exact_rate(e.distance, e.psi_d, x, target)


@kernel
def alpha_u_rate(e: Tracking, x: Vector, target: Vector, k: Any) -> float:
    """Rate of alpha_u (21), the expansion that the paper calls X_1 in (40)."""
    u, v, r = x[3], x[4], x[5]
    w = direction_rate(e, x, target, k)
    v_dot = sway_force(u, v, r, k) / k.m22
    cos_e, sin_e = math.cos(e.psi_e), math.sin(e.psi_e)
    # Folding jointly turns psi_d with psi_e; folding as printed turns psi_e alone. P and z_e carry
    # the sign of the first, cos and sin of psi_e that of both.
    side = math.cos(e.half_turn) if k.fold == 1.0 else 1.0
    turned = side * math.cos(e.half_turn)
    z_e_dot = e.P - turned * (u * cos_e + v * sin_e)
    along = side * (target[4] * math.cos(e.psi_d) + target[5] * math.sin(e.psi_d))
    swing = (w - r) * (e.alpha_u * sin_e - v * cos_e)
    return float((k.k_ze * z_e_dot + along + e.Q * w - v_dot * sin_e + swing) / cos_e)


@kernel
def alpha_r_rate(e: Tracking, x: Vector, target: Vector, k: Any, tau_u: float) -> float:
    """Rate of alpha_r (30), the paper's X_2 in (44), for the surge force tau_u [N]."""
    u, v, r = x[3], x[4], x[5]
    w = direction_rate(e, x, target, k)
    u_dot = (surge_force(u, v, r, k) + tau_u) / k.m11
    v_dot = sway_force(u, v, r, k) / k.m22
    psi_e = e.psi_e - e.half_turn
    cos_e, sin_e = math.cos(psi_e), math.sin(psi_e)
    cos_d, sin_d = math.cos(e.psi_d), math.sin(e.psi_d)
    P = target[2] * cos_d + target[3] * sin_d
    across = -target[4] * sin_d + target[5] * cos_d
    distance_rate = P - u * cos_e - v * sin_e
    swing = (u * cos_e + v * sin_e) * (w - r)
    if e.distance <= k.hold_below:
        return float(-k.k_psie * r)
    turn = across - P * w + u_dot * sin_e - v_dot * cos_e + swing - w * distance_rate
    return float(turn / e.distance + k.k_psie * (w - r))


@kernel
def surge_full(
    e: Tracking, x: Vector, target: Vector, beta: Vector, rate: Vector, k: Any
) -> tuple[float, float]:
    """beta_u = alpha_u."""
    return e.alpha_u, alpha_u_rate(e, x, target, k)


@kernel
def yaw_full(
    e: Tracking, x: Vector, target: Vector, beta: Vector, rate: Vector, k: Any, tau_u: float
) -> tuple[float, float]:
    """beta_r = alpha_r."""
    return e.alpha_r, alpha_r_rate(e, x, target, k, tau_u)


class Backstepping(PolarBackstepping):
    """Li-type adaptive backstepping without a filter, the paper's reference [25]."""

    kind: Literal["backstepping"] = "backstepping"
    law: ClassVar[Callable[..., None]] = staticmethod(
        specialise(polar_backstepping, "backstepping", surge=surge_full, yaw=yaw_full)
    )
