"""Derivatives of a vessel's motion under a load that is fixed to the earth."""

from __future__ import annotations

import math
from typing import Any

from podusv_cli.core.kernel import Vector, kernel, scratch

WIDTH = 9  # columns: x, y, psi, u, v, r, then the load north, east, about the vertical


@kernel
def sign(x: float, variance: float) -> float:
    """The mean of the sign of a number that is known so well, to 0.02; 1 or -1 where it is exact.

    For a normal error it is erf(x/sqrt(2 variance)); this has the same slope at 0.
    """
    if variance > 0.0:
        return float(x / math.sqrt(x * x + 0.5 * math.pi * variance))
    return 1.0 if x >= 0.0 else -1.0


# u, v [m/s], r [rad/s]; `unsure_v` and `unsure_r` are variances, which round the kink of |v| and
# |r|. Writes s (3, 3). |v| v has the smooth derivative 2 |v|, so only the mixed terms need the
# sign.
@kernel
def force_slopes(
    u: float, v: float, r: float, unsure_v: float, unsure_r: float, k: Any, s: Vector
) -> None:
    """Derivatives of (surge force, sway force, yaw moment) by (u, v, r), row by row."""
    s[0] = k.X_u + 2.0 * k.X_uu * abs(u) + 3.0 * k.X_uuu * u * u
    s[1] = k.coriolis * (k.m22 * r)
    s[2] = k.coriolis * (k.m22 * v + 2.0 * k.m23 * r)
    s[3] = -k.coriolis * (k.m11 * r)
    s[4] = k.Y_v + 2.0 * k.Y_vv * abs(v) + k.Y_rv * abs(r) + k.Y_vr * sign(v, unsure_v) * r
    s[5] = k.Y_rv * sign(r, unsure_r) * v + k.Y_r + k.Y_vr * abs(v) + 2.0 * k.Y_rr * abs(r)
    s[5] -= k.coriolis * (k.m11 * u)
    s[6] = k.coriolis * ((k.m11 - k.m22) * v - k.m23 * r)
    s[7] = k.N_v + 2.0 * k.N_vv * abs(v) + k.N_rv * abs(r) + k.N_vr * sign(v, unsure_v) * r
    s[7] += k.coriolis * ((k.m11 - k.m22) * u)
    s[8] = k.N_rv * sign(r, unsure_r) * v + k.N_r + k.N_vr * abs(v) + 2.0 * k.N_rr * abs(r)
    s[8] -= k.coriolis * (k.m23 * u)


# surge, sway [N] and yaw [N m] are derivatives of the forces by the column's state. Changes f (6,
# WIDTH). The inverse of the mass matrix is written out.
@kernel
def accelerate_column(
    column: int, surge: float, sway: float, yaw: float, k: Any, f: Vector
) -> None:
    """Put M^-1 (surge, sway, yaw) into rows 3 to 5 of a column of F."""
    determinant = k.m22 * k.m33 - k.m23 * k.m32
    f[3 * WIDTH + column] = surge / k.m11
    f[4 * WIDTH + column] = (k.m33 * sway - k.m23 * yaw) / determinant
    f[5 * WIDTH + column] = (k.m22 * yaw - k.m32 * sway) / determinant


# state (6 or more), b (3) [N, N, N m]; (cosine, sine) is the heading. Writes f (6, WIDTH). Columns
# 6 to 8 are those of the loads, which are fixed to the earth.
@kernel
def slopes(
    state: Vector,
    unsure_v: float,
    unsure_r: float,
    b: Vector,
    cosine: float,
    sine: float,
    k: Any,
    f: Vector,
) -> None:
    """Rows 0 to 5 of F: derivatives of the rates of (x, y, psi, u, v, r); b is in the body frame.

    By the heading, R^T b has the derivative (b_v, -b_u, 0). `unsure` are variances of v and r.
    """
    u, v, r = state[3], state[4], state[5]
    s = scratch(9)
    for i in range(6 * WIDTH):
        f[i] = 0.0
    f[2], f[3], f[4] = -sine * u - cosine * v, cosine, -sine
    f[WIDTH + 2], f[WIDTH + 3], f[WIDTH + 4] = cosine * u - sine * v, sine, cosine
    f[2 * WIDTH + 5] = 1.0
    force_slopes(u, v, r, unsure_v, unsure_r, k, s)
    for i in range(3):
        accelerate_column(3 + i, s[i], s[3 + i], s[6 + i], k, f)
    accelerate_column(2, b[1], -b[0], 0.0, k, f)
    accelerate_column(6, cosine, -sine, 0.0, k, f)
    accelerate_column(7, sine, cosine, 0.0, k, f)
    accelerate_column(8, 0.0, 0.0, 1.0, k, f)
