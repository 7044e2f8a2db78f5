"""Tracking errors and virtual controls: the paper's (18)-(21) and (30), with every reading of them.

Shared by all laws that steer towards the target by distance and bearing.
"""

from __future__ import annotations

import math
from typing import Any, Literal, NamedTuple

import numpy as np

from podusv_cli.controllers.base import Controller
from podusv_cli.kernels import Vector, kernel
from podusv_cli.kinematics import wrap
from podusv_cli.registry import value

ANALYTIC, DIFFERENCE = 0.0, 1.0
PRINTED, JOINT, NONE = 0.0, 1.0, 2.0
FROM_ZERO = 0.0

# The first two numbers of the memory of every law that steers so.
HELD = (("psi_d_held", 1), ("psi_d_rate_held", 1))
PSI_D_HELD, PSI_D_RATE_HELD = 0, 1


class Tracking(NamedTuple):
    """Errors and virtual controls at one instant; SI units and rad."""

    z_e: float  # distance to the target less the standoff; negative while folded
    distance: float  # (18)
    psi_d: float  # direction of the target (19), before folding
    psi_e: float  # heading error, after folding
    half_turn: float  # what folding added to psi_e: -pi, 0 or pi
    w: float  # rate of psi_d as the law uses it
    P: float  # target's velocity along psi_d, after folding
    Q: float  # target's velocity across psi_d, after folding
    alpha_u: float  # (21)
    alpha_r: float  # (30)


@kernel
def bearing(x: Vector, memory: Vector, target: Vector, k: Any) -> tuple[float, float, bool]:
    """Distance [m] and direction [rad] of the target, and whether the direction is held.

    (18), (19); the direction is held where the distance is not above `hold_below`, which with 0 is
    the paper's rule for z_e = 0.
    """
    x_e = target[0] - x[0]
    y_e = target[1] - x[1]
    distance = math.sqrt(x_e * x_e + y_e * y_e)
    if distance <= k.hold_below:
        return distance, memory[PSI_D_HELD], True
    return distance, math.atan2(y_e, x_e), False


@kernel
def exact_rate(distance: float, psi_d: float, x: Vector, target: Vector) -> float:
    """Rate of the target's direction [rad/s] from the velocities across the line of sight."""
    psi_e = psi_d - x[2]
    Q = -target[2] * math.sin(psi_d) + target[3] * math.cos(psi_d)
    return float((Q + x[3] * math.sin(psi_e) - x[4] * math.cos(psi_e)) / distance)


@kernel
def bearing_rate(
    distance: float, psi_d: float, held: bool, x: Vector, memory: Vector, target: Vector, k: Any
) -> float:
    """Rate of psi_d [rad/s]: zero while held, else the difference of Remark 5 or the exact rate."""
    if held:
        return 0.0
    if k.rate == DIFFERENCE:
        return float(memory[PSI_D_RATE_HELD])
    return exact_rate(distance, psi_d, x, target)


@kernel
def fold(psi_e: float, k: Any) -> float:
    """Half a turn that brings psi_e [rad] into (-pi/2, pi/2): -pi, 0 or pi."""
    if k.fold == NONE or abs(psi_e) < 0.5 * math.pi:
        return 0.0
    return -math.pi if psi_e > 0.0 else math.pi


@kernel
def track(x: Vector, memory: Vector, target: Vector, k: Any) -> Tracking:
    """Errors (18), (19) and virtual controls (21), (30) in the reading that `k` asks for."""
    distance, psi_d, held = bearing(x, memory, target, k)
    w = bearing_rate(distance, psi_d, held, x, memory, target, k)
    psi_e = wrap(psi_d - x[2])
    half_turn = fold(psi_e, k)
    psi_e += half_turn
    # Folding jointly turns the line of sight round with the error: P, Q and the distance change
    # sign and the vessel backs towards the target. As printed only psi_e is folded.
    side = -1.0 if k.fold == JOINT and half_turn != 0.0 else 1.0
    z_e = side * (distance - k.standoff)
    P = side * (target[2] * math.cos(psi_d) + target[3] * math.sin(psi_d))
    Q = side * (-target[2] * math.sin(psi_d) + target[3] * math.cos(psi_d))
    alpha_u = (k.k_ze * z_e + P - x[4] * math.sin(psi_e)) / math.cos(psi_e)
    alpha_r = w + k.k_psie * psi_e
    return Tracking(z_e, distance, psi_d, psi_e, half_turn, w, P, Q, alpha_u, alpha_r)


@kernel
def hold(t: float, x: Vector, memory: Vector, target: Vector, k: Any) -> None:
    """Remember psi_d and form its wrapped backward difference (Remark 5), once a sample."""
    _, psi_d, held = bearing(x, memory, target, k)
    before = memory[PSI_D_HELD]
    if t == 0.0:
        before = 0.0 if k.first_difference == FROM_ZERO else psi_d
    memory[PSI_D_RATE_HELD] = 0.0 if held else wrap(psi_d - before) / k.difference_step
    memory[PSI_D_HELD] = psi_d


class TrackingController(Controller):
    """Options of the errors and virtual controls, the same for every law that uses them."""

    k_ze: float = value(0.1, "1/s", "gain of the distance in (21)", ge=0)
    k_psie: float = value(0.1, "1/s", "gain of the heading error in (30)", ge=0)
    standoff: float = value(
        0.5,
        "m",
        "distance that is kept to the target; 0 as printed, where z_e = 0 is singular",
        ge=0,
    )
    hold_below: float = value(
        0.0, "m", "distance below which the direction of the target is held; 0 as printed", ge=0
    )
    fold: Literal["printed", "joint", "none"] = value(
        "joint",
        "",
        "heading error beyond a right angle: folded alone (printed), folded together with the line "
        "of sight so that the vessel backs up (joint), or left (none)",
    )
    rate: Literal["analytic", "difference"] = value(
        "analytic", "", "rate of the target's direction: exact, or Remark 5's backward difference"
    )
    difference_step: float = value(
        0.01, "s", "time between the two samples of the difference, a whole number of steps", gt=0
    )
    first_difference: Literal["from_zero", "from_start"] = value(
        "from_start", "", "direction before the first sample: 0, or the same as at the start"
    )

    def sample_period(self) -> float:
        """The difference's step where a difference or a held direction is used."""
        needed = self.rate == "difference" or self.hold_below > 0
        return self.difference_step if needed else 0.0

    @staticmethod
    @kernel
    def sample(t: float, x: Vector, memory: Vector, target: Vector, k: Any, table: Vector) -> None:
        """Take the target's direction for the difference and for holding."""
        hold(t, x, memory, target, k)

    def start(self, x: Vector, target: Vector, nominal: Any) -> Vector:
        """All zero but the held direction: to the target, or its course where it is right here."""
        memory = np.zeros(sum(size for _, size in self.slots()))
        x_e, y_e = target[:2] - x[:2]
        memory[PSI_D_HELD] = (
            math.atan2(y_e, x_e) if x_e or y_e else math.atan2(target[3], target[2])
        )
        return memory
