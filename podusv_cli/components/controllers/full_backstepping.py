"""Full backstepping: the same law with analytic derivatives of the virtual control.

Source: stands for the comparison law of the paper's reference [25], whose text podusv does not
have. Derivatives use the nominal vessel with m23 r^2 and all its
damping, of which (12) has less, but without disturbance, sway force and inertia coupling between
sway and yaw.

Proved: as for `adaptive_neural`, without filter errors (docs/theory.md). Not proved: any limit of
the actuator, and corners, where the derivative jumps. Anti-windup: `anti_windup: auxiliary`,
outside the proof.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, Literal

from pydantic import field_validator

from podusv_cli.components.controllers.polar_backstepping import (
    PolarBackstepping,
    polar_backstepping,
)
from podusv_cli.components.controllers.tracking import Tracking
from podusv_cli.components.vessels.plant import surge_force, sway_force
from podusv_cli.core.kernel import Vector, kernel, specialise


# x (6) state, target (6); in m/s2. By the chain rule through z_e, P, v and psi_e.
@kernel
def alpha_u_rate(e: Tracking, x: Vector, target: Vector, k: Any) -> float:
    """Rate of alpha_u (21), the expansion that the paper calls X_1 in (40)."""
    u, v, r, w = x[3], x[4], x[5], e.exact_w
    v_dot = sway_force(u, v, r, k) / k.m22
    # Folding jointly turns psi_d with psi_e; folding as printed turns psi_e alone. P and z_e carry
    # the sign of the first, cos and sin of psi_e that of both.
    turned = e.side if e.half_turn == 0.0 else -e.side
    z_e_dot = e.P - turned * (u * e.cos_e + v * e.sin_e)
    along = e.side * (target[4] * e.cos_d + target[5] * e.sin_d)
    swing = (w - r) * (e.alpha_u * e.sin_e - v * e.cos_e)
    return float((k.k_ze * z_e_dot + along + e.Q * w - v_dot * e.sin_e + swing) / e.cos_e)


# x (6) state, target (6); in rad/s2. w = (Q + u sin psi_e - v cos psi_e)/distance is differentiated
# before folding. While the direction is held w is 0, and psi_e' is -r.
@kernel
def alpha_r_rate(e: Tracking, x: Vector, target: Vector, k: Any, tau_u: float) -> float:
    """Rate of alpha_r (30), the paper's X_2 in (44), for the surge force tau_u [N]."""
    u, v, r, w = x[3], x[4], x[5], e.exact_w
    if e.distance <= k.hold_below:
        return float(-k.k_psie * r)
    u_dot = (surge_force(u, v, r, k) + tau_u) / k.m11
    v_dot = sway_force(u, v, r, k) / k.m22
    turn = 1.0 if e.half_turn == 0.0 else -1.0
    cos_e, sin_e, P = turn * e.cos_e, turn * e.sin_e, e.side * e.P  # before folding
    across = target[5] * e.cos_d - target[4] * e.sin_d
    distance_rate = P - u * cos_e - v * sin_e
    swing = (u * cos_e + v * sin_e) * (w - r)
    turn_rate = across - P * w + u_dot * sin_e - v_dot * cos_e + swing - w * distance_rate
    return float(turn_rate / e.distance + k.k_psie * (w - r))


# Without a filter: returns alpha_u [m/s] and its exact rate; beta and rate stay as they are.
@kernel
def surge_full(
    e: Tracking, x: Vector, target: Vector, beta: Vector, rate: Vector, k: Any
) -> tuple[float, float]:
    """beta_u = alpha_u."""
    return e.alpha_u, alpha_u_rate(e, x, target, k)


# Without a filter: returns alpha_r [rad/s] and its exact rate; beta and rate stay as they are.
@kernel
def yaw_full(
    e: Tracking, x: Vector, target: Vector, beta: Vector, rate: Vector, k: Any, tau_u: float
) -> tuple[float, float]:
    """beta_r = alpha_r."""
    return e.alpha_r, alpha_r_rate(e, x, target, k, tau_u)


class FullBackstepping(PolarBackstepping):
    """Adaptive neural backstepping without a filter: the virtual controls' derivatives in full.

    It stands in for the paper's reference [25], whose text podusv does not have.
    """

    kind: Literal["full_backstepping", "backstepping"] = "full_backstepping"
    law: ClassVar[Callable[..., None]] = staticmethod(
        specialise(polar_backstepping, "full_backstepping", surge=surge_full, yaw=yaw_full)
    )

    @field_validator("kind")
    @classmethod
    def _by_its_name(cls, kind: str) -> str:
        """`backstepping`, its name in older scenarios, stays readable."""
        return "full_backstepping"
