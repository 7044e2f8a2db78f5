"""Kinetics of a surface vessel in the horizontal plane: M nu' + C(nu) nu + D(nu) nu = tau + b.

The paper's (12) is the case where only the six diagonal linear terms are not zero. A vessel may
have a share of C nu only (`coriolis`); with all of it, adding what lacks changes no bit.
"""

from __future__ import annotations

from typing import Any

from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.kinematics import earth_velocity


# In the three forces u and v are in m/s, r in rad/s; k has the vessel's constants. Damping
# coefficients are negative where they brake.
@kernel
def surge_force(u: float, v: float, r: float, k: Any) -> float:
    """Coriolis and damping force along surge [N], row 1 of -C nu - D nu."""
    damping = (k.X_u + k.X_uu * abs(u) + k.X_uuu * u * u) * u
    return float((k.m22 * v + k.m23 * r) * r + damping)


@kernel
def sway_force(u: float, v: float, r: float, k: Any) -> float:
    """Coriolis and damping force along sway [N], row 2 of -C nu - D nu."""
    from_sway = (k.Y_v + k.Y_vv * abs(v) + k.Y_rv * abs(r)) * v
    from_yaw = (k.Y_r + k.Y_vr * abs(v) + k.Y_rr * abs(r)) * r
    return float(-k.m11 * u * r + from_sway + from_yaw)


@kernel
def yaw_moment(u: float, v: float, r: float, k: Any) -> float:
    """Coriolis and damping moment about yaw [N m], row 3 of -C nu - D nu."""
    from_sway = (k.N_v + k.N_vv * abs(v) + k.N_rv * abs(r)) * v
    from_yaw = (k.N_r + k.N_vr * abs(v) + k.N_rr * abs(r)) * r
    return float(k.m11 * u * v - (k.m22 * v + k.m23 * r) * u + from_sway + from_yaw)


@kernel
def lacking(u: float, v: float, r: float, k: Any) -> tuple[float, float, float]:
    """What has to be added to these forces [N, N, N m] for a vessel with a share of C nu only."""
    less, momentum = k.coriolis - 1.0, k.m22 * v + k.m23 * r
    yaw = k.m11 * u * v - momentum * u
    return less * (momentum * r), -less * (k.m11 * u * r), less * yaw


# x (6), tau and b (3) [N, N, N m], k the vessel's constants; writes rate (6). Sway and yaw are
# solved together, since m23 and m32 couple them; surge stands alone. `less` comes last in each sum,
# so that a vessel with all of C nu has the same bits as without it.
@kernel
def plant(x: Vector, tau: Vector, b: Vector, k: Any, rate: Vector) -> None:
    """Rate of the state (x, y, psi, u, v, r) under forces tau and b, each (surge, sway, yaw).

    SI units and rad. Coriolis terms as in (6), inertia as in (5) with its off-diagonal entries.
    """
    earth_velocity(x, rate)
    u, v, r = x[3], x[4], x[5]
    less = lacking(u, v, r, k)
    surge = surge_force(u, v, r, k) + tau[0] + b[0] + less[0]
    sway = sway_force(u, v, r, k) + tau[1] + b[1] + less[1]
    yaw = yaw_moment(u, v, r, k) + tau[2] + b[2] + less[2]
    determinant = k.m22 * k.m33 - k.m23 * k.m32
    rate[3] = surge / k.m11
    rate[4] = (k.m33 * sway - k.m23 * yaw) / determinant
    rate[5] = (k.m22 * yaw - k.m32 * sway) / determinant
