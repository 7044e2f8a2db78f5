"""A standoff that lies along the heading which holds the path, not along the line of sight.

A hull in a cross load follows the path only with its bow off the course by the crab angle. A law
that points at the target can do this if it aims at a point ahead of it: at the distance L of the
standoff, in the direction of that heading. In the steady state the vessel's origin is then at the
target, and no longer behind it. docs/laws/adaptive_neural.md has the derivation.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from podusv_cli.components.controllers.observer import OBSERVED, V_HAT
from podusv_cli.components.vessels.plant import sway_force
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal

SWAY = (
    OBSERVED[V_HAT],
    OBSERVED[V_HAT + 3],
    Signal("v_s", "m/s", "sway velocity of the nominal vessel on the target's path"),
)
LOAD, SETTLED = 1, 2  # positions behind that of the observed velocity
SLOWEST = 0.1  # m/s; below this speed of the target the aim goes back to the target
STEEPEST = 0.9  # sine of the largest crab angle
BEAM = 0.2  # cosine; with the bow this near to crosswise, the side changes


class OnPath(NamedTuple):
    """The nominal vessel with its origin on the target: speed, crab angle and sway."""

    speed: float  # m/s, not below SLOWEST
    side: float  # 1 with the bow along the course, -1 where the vessel backs up, between crosswise
    sine: float  # of the crab angle, limited
    cosine: float
    sway_rate: float  # m/s2
    turn: float  # rate of the heading [rad/s]


# x (6) state, target (6), memory of the law, in which the sway that has settled lies at crab_at.
@kernel
def on_path(x: Vector, memory: Vector, target: Vector, k: Any) -> OnPath:
    """v = V sin beta, u = +-V cos beta and r = chi' -+ beta' in the sway equation.

    That leaves (m22 - m11) v' = Y(u, v, chi') + b_v - m11 V' sin beta, ahead and backing up.
    The inertia is not taken below a fifth of m22: with m22 <= m11 that motion is unstable.
    """
    at, speed2 = int(k.crab_at), target[2] * target[2] + target[3] * target[3]
    speed = max(math.sqrt(speed2), SLOWEST)
    sine = min(max(memory[at + SETTLED] / speed, -STEEPEST), STEEPEST)
    cosine = math.sqrt(1.0 - sine * sine)
    faster = (target[2] * target[4] + target[3] * target[5]) / speed
    turn = (target[2] * target[5] - target[3] * target[4]) / (speed * speed)
    cos_psi, sin_psi = cos_sin(x[2])
    off_beam = (target[2] * cos_psi + target[3] * sin_psi) / (BEAM * speed)
    side = min(max(off_beam, -1.0), 1.0)
    force = sway_force(side * speed * cosine, memory[at + SETTLED], turn, k) + memory[at + LOAD]
    inertia = max(k.m22 - k.m11, 0.2 * k.m22)
    sway_rate = (force - k.m11 * faster * sine) / inertia
    crab_rate = (sway_rate - faster * sine) / (speed * cosine)
    return OnPath(speed, side, sine, cosine, sway_rate, turn - side * crab_rate)


# x (6) state, target (6); reads memory and writes rate, three numbers at crab_at. The observer has
# a double pole at -omega_v.
@kernel
def observe_sway(x: Vector, memory: Vector, target: Vector, k: Any, rate: Vector) -> None:
    """Rates of the observer of the sway load, and of v_s; nothing without this option."""
    at = int(k.crab_at)
    if at > 0:
        off = x[4] - memory[at]
        force = sway_force(x[3], x[4], x[5], k) + memory[at + LOAD]
        rate[at] = force / k.m22 + 2.0 * k.omega_v * off
        rate[at + LOAD] = k.m22 * k.omega_v * k.omega_v * off
        rate[at + SETTLED] = on_path(x, memory, target, k).sway_rate


# x (6) state, target (6); `room` (6) is where another target is put. Returns which of both is aimed
# at. The point turns with psi_c, so its velocity and acceleration differ from the target's by those
# of a turn.
@kernel
def take_aim(x: Vector, memory: Vector, target: Vector, k: Any, room: Vector) -> Vector:
    """What the law points at: the target itself, or the standoff ahead along psi_c.

    psi_c is the course less the crab angle. The rate of its rate is taken to be zero. A target
    slower than SLOWEST is aimed at itself, the more the slower it is.
    """
    if k.crab_at > 0.0:
        for i in range(6):
            room[i] = target[i]
        p = on_path(x, memory, target, k)
        speed2 = target[2] * target[2] + target[3] * target[3]
        ahead = k.standoff * min(1.0, speed2 / (p.speed * p.speed)) / p.speed
        sine = p.side * p.sine
        north = ahead * (target[2] * p.cosine + target[3] * sine)
        east = ahead * (target[3] * p.cosine - target[2] * sine)
        room[0] += north
        room[1] += east
        room[2] -= p.turn * east
        room[3] += p.turn * north
        room[4] -= p.turn * p.turn * north
        room[5] -= p.turn * p.turn * east
        return room
    return target
