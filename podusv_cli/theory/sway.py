"""The bound of the sway speed, (50)-(51): as printed, and with the vessel's own damping."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording
from podusv_cli.engine.replay import Replayed
from podusv_cli.vessels.vessel import Vessel


@dataclass(frozen=True)
class SwayBound:
    """gamma_v [N] of (51) and the sway speed [m/s] above which V_v falls."""

    gamma_v: float
    value: float
    printed_gamma_v: float
    printed: float


def sway_push(vessel: Vessel, log: Recording, now: Replayed) -> tuple[Vector, Vector]:
    """The sway force at every row [N]: without damping, and m11 |u| |r| + |b_v| of (51).

    The first is |m22 v' - (Y_v + Y_vv |v|) v|, with cross terms and the actuator's sway force. For
    the paper's vessel it never exceeds the second.
    """
    v = log["v"]
    damping = (vessel.Y_v + vessel.Y_vv * np.abs(v)) * v
    printed = vessel.m11 * np.abs(log["u"] * log["r"]) + np.abs(now.signals["b_v"])
    return np.abs(vessel.m22 * now.rates["v"] - damping), printed


def sway_bound(vessel: Vessel, push: float, printed_push: float) -> SwayBound:
    """The sway speed at which damping equals the push; infinite without positive damping."""
    d22, d_vv = -vessel.Y_v, -vessel.Y_vv
    value = math.inf
    if d22 > 0.0 and d_vv >= 0.0:
        value = 2.0 * push / (d22 + math.sqrt(d22 * d22 + 4.0 * d_vv * push))
    elif d22 == 0.0 and d_vv > 0.0:
        value = math.sqrt(push / d_vv)
    printed = printed_push / d22 if d22 > 0.0 else math.inf
    return SwayBound(push, value, printed_push, printed)
