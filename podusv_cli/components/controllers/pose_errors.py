"""What laws of poses have in common: errors, and the motion asked for, along and across the bow."""

from __future__ import annotations

from typing import NamedTuple

from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.kinematics import wrap
from podusv_cli.core.signal import PSI_D, Signal

ERRORS = (
    Signal("z_1u", "m", "position error along the bow"),
    Signal("z_1v", "m", "position error across the bow, to starboard"),
    Signal("psi_t", "rad", "heading error", r"\tilde\psi"),
)


class PoseErrors(NamedTuple):
    """R^T (eta - eta_d), the velocity asked for, and the rates of both, in axes of the hull."""

    cos: float  # of the heading
    sin: float
    a: float  # m, ahead
    b: float  # m, to starboard
    psi: float  # rad, wrapped
    a_rate: float
    b_rate: float
    psi_rate: float
    u_d: float  # m/s, R^T of the target's velocity
    v_d: float
    r_d: float  # rad/s
    u_d_rate: float
    v_d_rate: float
    r_d_rate: float


# x (6), target (10). The rates are those in axes that turn with the hull, hence the terms with r.
@kernel
def pose_errors(x: Vector, target: Vector) -> PoseErrors:
    """Errors of the pose at x = (x, y, psi, u, v, r)."""
    c, s = cos_sin(x[2])
    u, v, r = x[3], x[4], x[5]
    e_x, e_y = x[0] - target[0], x[1] - target[1]
    a, b, psi = c * e_x + s * e_y, c * e_y - s * e_x, wrap(x[2] - target[PSI_D])
    u_d, v_d = c * target[2] + s * target[3], c * target[3] - s * target[2]
    along, across = c * target[4] + s * target[5], c * target[5] - s * target[4]
    r_d, r_d_rate = target[PSI_D + 1], target[PSI_D + 2]
    return PoseErrors(
        c,
        s,
        a,
        b,
        psi,
        u - u_d + r * b,
        v - v_d - r * a,
        r - r_d,
        u_d,
        v_d,
        r_d,
        along + r * v_d,
        across - r * u_d,
        r_d_rate,
    )
