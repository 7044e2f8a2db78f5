"""The paper's disturbance (52): a mean, a sine and a cosine on every axis."""

from __future__ import annotations

import math
from typing import Any, Literal

from podusv_cli.disturbances.base import Disturbance
from podusv_cli.kernels import Vector, kernel
from podusv_cli.registry import Component, value


class Harmonic(Component):
    """mean + sin sin(sin_rate t) + cos cos(cos_rate t) on one axis; in N, in yaw N m."""

    mean: float = value(0.0, "N or N m", "constant part")
    sin: float = value(0.0, "N or N m", "amplitude of the sine")
    sin_rate: float = value(0.2, "rad/s", "angular frequency of the sine", ge=0)
    cos: float = value(0.0, "N or N m", "amplitude of the cosine")
    cos_rate: float = value(0.2, "rad/s", "angular frequency of the cosine", ge=0)


class HarmonicDisturbance(Disturbance):
    """Loads of (52); the defaults are its numbers."""

    kind: Literal["harmonic"] = "harmonic"
    scale: float = value(1.0, "", "factor on all three axes", ge=0)
    b_u: Harmonic = value(
        Harmonic(mean=0.5, sin=0.1, sin_rate=0.2, cos=0.3, cos_rate=0.5), "N", "surge force"
    )
    b_v: Harmonic = value(
        Harmonic(mean=0.5, sin=0.2, sin_rate=0.2, cos=0.1, cos_rate=0.4), "N", "sway force"
    )
    b_r: Harmonic = value(
        Harmonic(mean=0.5, sin=0.1, sin_rate=0.1, cos=0.1, cos_rate=0.2), "N m", "yaw moment"
    )

    @staticmethod
    @kernel
    def evaluate(t: float, x: Vector, k: Any, table: Vector, b: Vector) -> None:
        """Equation (52), scaled."""
        surge = k.b_u_sin * math.sin(k.b_u_sin_rate * t) + k.b_u_cos * math.cos(k.b_u_cos_rate * t)
        sway = k.b_v_sin * math.sin(k.b_v_sin_rate * t) + k.b_v_cos * math.cos(k.b_v_cos_rate * t)
        yaw = k.b_r_sin * math.sin(k.b_r_sin_rate * t) + k.b_r_cos * math.cos(k.b_r_cos_rate * t)
        b[0] = k.scale * (k.b_u_mean + surge)
        b[1] = k.scale * (k.b_v_mean + sway)
        b[2] = k.scale * (k.b_r_mean + yaw)
