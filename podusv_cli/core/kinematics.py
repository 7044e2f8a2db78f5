"""Frames and angles. Angles in rad, x north, y east, psi from x towards y."""

from __future__ import annotations

import math

import numpy as np

from podusv_cli.core.elementary import arctangent, cos_sin
from podusv_cli.core.kernel import Vector, kernel


@kernel
def wrap(angle: float) -> float:
    """`angle` [rad] brought into (-pi, pi]."""
    # np.ceil, since the other one makes a whole number of its argument and 1e20 is too large.
    turns = np.ceil((angle - math.pi) / (2.0 * math.pi))
    return float(angle - 2.0 * math.pi * turns)


@kernel
def direction(x: float, y: float) -> float:
    """Angle [rad] of the vector (x, y) from the x axis, in [-pi, pi]; 0 where both are 0.

    Adding 0.0 takes the sign of a zero away.
    """
    return arctangent(y + 0.0, x + 0.0)


# Writes rate (3) [m/s, m/s, rad/s].
@kernel
def earth_velocity(x: Vector, rate: Vector) -> None:
    """Rates of (x, y, psi) from the state (x, y, psi, u, v, r); paper (3)."""
    cos_psi, sin_psi = cos_sin(x[2])
    rate[0] = x[3] * cos_psi - x[4] * sin_psi
    rate[1] = x[3] * sin_psi + x[4] * cos_psi
    rate[2] = x[5]
