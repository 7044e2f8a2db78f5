"""A rudder in the stream of a propeller that does not turn itself, as kernels.

Its force is normal to it: F = lift n^2 a, with the angle a up to `stall`; it is 0 with a propeller
astern, whose stream goes the other way. Sources: n^2 delta is M. Caccia, G. Bruzzone, R. Bono, "A
practical approach to modeling and identification of small autonomous surface craft", IEEE J.
Oceanic Eng. 33 (2008); a normal force that is side force and drag is H. Yasukawa, Y. Yoshimura,
"Introduction of MMG standard method for ship maneuvering predictions", J. Mar. Sci. Technol. 20
(2015), whose t_R and a_H are left to lift and hull here. Both are recalled, not read.
"""

from __future__ import annotations

import math
from typing import Any

from podusv_cli.components.actuators.propeller import (
    ANGLE,
    LIFT,
    N_AHEAD,
    N_ASTERN,
    STALL,
    T_AHEAD,
    force,
    speed_for,
    turning,
)
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.kinematics import direction

LEAST = 1e-300  # N, so that a propeller at rest divides nothing by 0
ROUNDS = 6  # until angle and propeller speed agree; 80 deg from ahead they leave 2 % and more
AGREED = 1.001  # of the largest angle: more is out of reach


# pod (WIDTH) is its row of the table, T [N] its thrust. LIFT is 0 of a pod that turns itself.
# Beyond the stall the normal force no longer grows with the angle, but still turns with it.
@kernel
def loads(turns: float, T: float, delta: float, pod: Vector) -> tuple[float, float]:
    """Force [N] along and across its mounting of a pod at angle delta [rad], or of its rudder.

    `turns` is how fast its propeller is `turning`.
    """
    if pod[LIFT] <= 0.0:
        return force(T, delta)
    if turns <= 0.0:
        return T, 0.0
    normal = pod[LIFT] * turns * turns * min(max(delta, -pod[STALL]), pod[STALL])
    cosine, sine = cos_sin(delta)
    return T - normal * sine, normal * cosine


# Any thrust will do at rest, where both forces go with the square of the speed: `turns` is 1, whose
# thrust is T_AHEAD.
@kernel
def slant(delta: float, pod: Vector) -> float:
    """Angle [rad] of a pod's force at rest; of a rudder, that of thrust and rudder together.

    Beyond the stall there is none.
    """
    if pod[LIFT] <= 0.0:
        return delta
    along, across = loads(1.0, pod[T_AHEAD], min(max(delta, -pod[STALL]), pod[STALL]), pod)
    return float(direction(along, across))


# `pod` (WIDTH) is its row of the table. Beyond the stall the force no longer grows, so the angle
# ends there.
@kernel
def part_when_slanted(pod: Vector) -> float:
    """Force of thrust and rudder together at the largest angle, in parts of the thrust, at rest."""
    along, across = loads(1.0, pod[T_AHEAD], min(pod[ANGLE], pod[STALL]), pod)
    return float(math.sqrt(along * along + across * across) / pod[T_AHEAD])


# flow [m/s] is the advance speed, `pod` its row of the table. Writes out (2): speed [1/s], angle
# [rad]. The rudder's drag is across times tan(delta), and its lift needs the speed: fixed-point
# rounds settle both.
@kernel
def steer_rudder(T: float, angle: float, flow: float, pod: Vector, k: Any, out: Vector) -> bool:
    """Propeller speed and rudder angle for a force T [N] at an angle [rad]; whether they make it.

    Thrust makes up for the rudder's drag. Astern there is no force across.
    """
    along, across = force(T, angle)
    most = min(pod[ANGLE], pod[STALL])
    n, delta, wanted = speed_for(along, flow, pod, k), 0.0, 0.0
    if along < 0.0 or n <= 0.0:
        out[0], out[1] = max(n, -pod[N_ASTERN]), 0.0
        return bool(across == 0.0 and n >= -pod[N_ASTERN])
    for _ in range(ROUNDS):
        cosine, sine = cos_sin(delta)
        n = speed_for(along + across * sine / cosine, flow, pod, k)
        turns = turning(n, pod)
        wanted = across / (pod[LIFT] * turns * turns * cosine + LEAST)
        delta = min(max(wanted, -most), most)
    out[0], out[1] = min(n, pod[N_AHEAD]), delta
    return bool(n <= pod[N_AHEAD] and abs(wanted) <= AGREED * most)
