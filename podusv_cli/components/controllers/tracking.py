"""Tracking errors and virtual controls: the paper's (18)-(21) and (30), with every reading of them.

Shared by all laws that steer towards the target by distance and bearing.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from pydantic import model_validator

from podusv_cli.components.controllers.base import Approach, Controller, Slots, each
from podusv_cli.components.controllers.crab import SWAY, take_aim
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import value
from podusv_cli.core.derived import difference
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, bundle, call, kernel, scratch
from podusv_cli.core.kinematics import direction, wrap
from podusv_cli.core.signal import Signal

ANALYTIC, DIFFERENCE = 0.0, 1.0
PRINTED, JOINT, NONE = 0.0, 1.0, 2.0
FROM_ZERO = 0.0

# What a law that steers so logs: direction and heading error, virtual controls, their errors.
PSI_D = Signal(
    "psi_d", "rad", "direction of the target (19), in (-pi, pi]", r"\psi_d", wrapped=True
)
PSI_E = Signal(
    "psi_e", "rad", "heading error that the law acts on, after folding", r"\psi_e", wrapped=True
)
ALPHA_U = Signal("alpha_u", "m/s", "virtual surge velocity (21)", r"\alpha_u")
ALPHA_R = Signal("alpha_r", "rad/s", "virtual yaw rate (30)", r"\alpha_r")
U_E = Signal("u_e", "m/s", "surge velocity error (23)")
R_E = Signal("r_e", "rad/s", "yaw rate error (32)")
TRACKED = (PSI_D, PSI_E, ALPHA_U, ALPHA_R, U_E, R_E)
X_E = Signal("x_e", "m", "target ahead of the vessel, north (18); derived, not logged")
Y_E = Signal("y_e", "m", "target ahead of the vessel, east (18); derived, not logged")
ahead_north = difference(X_E, "x_d", "x", "z_e")  # without z_e there is no target to be behind
ahead_east = difference(Y_E, "y_d", "y", "z_e")

# The first two numbers of the memory of every law that steers so.
PSI_D_SAMPLE = Signal(
    "psi_d_held", "rad", "target direction at the law's last sample", r"\psi_d^-", wrapped=True
)
PSI_D_RATE_SAMPLE = Signal(
    "psi_d_rate_held", "rad/s", "difference quotient held by the law", r"\dot\psi_d^-"
)
HELD = ((PSI_D_SAMPLE, 1), (PSI_D_RATE_SAMPLE, 1))
PSI_D_HELD, PSI_D_RATE_HELD = 0, 1


class Tracking(NamedTuple):
    """Errors and virtual controls at one instant; SI units and rad."""

    z_e: float  # distance to the target less the standoff; negative while folded
    distance: float  # (18)
    psi_d: float  # direction of the target (19), before folding
    cos_d: float
    sin_d: float
    psi_e: float  # heading error, after folding
    cos_e: float
    sin_e: float
    half_turn: float  # what folding added to psi_e: -pi, 0 or pi
    side: float  # -1 where folding turned the line of sight as well, else 1
    w: float  # rate of psi_d as the law uses it
    exact_w: float  # rate of psi_d from the velocities; 0 while psi_d is held
    P: float  # target's velocity along psi_d, after folding
    Q: float  # target's velocity across psi_d, after folding
    alpha_u: float  # (21)
    alpha_r: float  # (30)


class Bearing(NamedTuple):
    """Where the target lies: distance [m], direction [rad], and whether the direction is held."""

    distance: float
    psi_d: float
    cos_d: float
    sin_d: float
    held: bool


# x (6) state, target (6); memory has the direction that is held.
@kernel
def bearing(x: Vector, memory: Vector, target: Vector, k: Any) -> Bearing:
    """(18), (19); the direction is held where the distance is not above `hold_below`.

    With `hold_below` 0 this is the paper's rule for z_e = 0.
    """
    x_e = target[0] - x[0]
    y_e = target[1] - x[1]
    distance = math.sqrt(x_e * x_e + y_e * y_e)
    if distance <= k.hold_below:
        psi_d = memory[PSI_D_HELD]
        cos_d, sin_d = cos_sin(psi_d)
        return Bearing(distance, psi_d, cos_d, sin_d, True)
    return Bearing(distance, direction(x_e, y_e), x_e / distance, y_e / distance, False)


@kernel
def fold(psi_e: float, k: Any) -> float:
    """Half a turn that brings psi_e [rad] into (-pi/2, pi/2): -pi, 0 or pi."""
    if k.fold == NONE or abs(psi_e) < 0.5 * math.pi:
        return 0.0
    return -math.pi if psi_e > 0.0 else math.pi


# x (6) state, target (6); memory has what is held between samples. P and Q [m/s] are the target's
# velocity along and across psi_d. As printed (21) divides by cos psi_e, which folding keeps from
# changing its sign.
@kernel
def track(x: Vector, memory: Vector, target: Vector, k: Any) -> Tracking:
    """Errors (18), (19) and virtual controls (21), (30) in the reading that `k` asks for."""
    u, v = x[3], x[4]
    distance, psi_d, cos_d, sin_d, held = bearing(x, memory, target, k)
    cos_psi, sin_psi = cos_sin(x[2])
    psi_e = wrap(psi_d - x[2])
    cos_e, sin_e = cos_d * cos_psi + sin_d * sin_psi, sin_d * cos_psi - cos_d * sin_psi
    P, Q = target[2] * cos_d + target[3] * sin_d, target[3] * cos_d - target[2] * sin_d
    # The rate of psi_d is zero while held, else Remark 5's difference or the exact rate.
    exact_w = 0.0 if held else (Q + u * sin_e - v * cos_e) / distance
    w = memory[PSI_D_RATE_HELD] if k.rate == DIFFERENCE and not held else exact_w

    # Folding jointly turns the line of sight round with the error: P, Q and the distance change
    # sign and the vessel backs towards the target. As printed only psi_e is folded.
    half_turn = fold(psi_e, k)
    turn = 1.0 if half_turn == 0.0 else -1.0
    side = turn if k.fold == JOINT else 1.0
    psi_e, cos_e, sin_e = psi_e + half_turn, turn * cos_e, turn * sin_e
    z_e, P, Q = side * (distance - k.standoff), side * P, side * Q
    alpha_u = (k.k_ze * z_e + P - v * sin_e) / cos_e
    alpha_r = w + k.k_psie * psi_e
    return Tracking(
        z_e,
        distance,
        psi_d,
        cos_d,
        sin_d,
        psi_e,
        cos_e,
        sin_e,
        half_turn,
        side,
        w,
        exact_w,
        P,
        Q,
        alpha_u,
        alpha_r,
    )


# t [s], x (6) state, target (6); writes memory at PSI_D_HELD and PSI_D_RATE_HELD. At t = 0 there is
# no sample before, so `first_difference` says what stands for it.
@kernel
def hold(t: float, x: Vector, memory: Vector, target: Vector, k: Any) -> None:
    """Remember psi_d and form its wrapped backward difference (Remark 5), once a sample."""
    _, psi_d, _, _, held = bearing(x, memory, target, k)
    before = memory[PSI_D_HELD]
    if t == 0.0:
        before = 0.0 if k.first_difference == FROM_ZERO else psi_d
    memory[PSI_D_RATE_HELD] = 0.0 if held else wrap(psi_d - before) / k.difference_step
    memory[PSI_D_HELD] = psi_d


class TrackingController(Controller):
    """Options of the errors and virtual controls, the same for every law that uses them."""

    against_windup: ClassVar[str] = "consider anti_windup: auxiliary"
    period_key: ClassVar[str] = "difference_step"
    no_gains: ClassVar[tuple[str, ...]] = (period_key,)  # a whole number of steps

    k_ze: float = value(0.1, "1/s", "gain of the distance in (21)", ge=0)
    k_psie: float = value(0.1, "1/s", "gain of the heading error in (30)", ge=0)
    standoff: float = value(
        0.5,
        "m",
        "distance that is kept to the target; 0 as printed, where z_e = 0 is singular",
        ge=0,
    )
    standoff_reference: Literal["line_of_sight", "crab"] = value(
        "line_of_sight",
        "",
        "where the standoff lies: behind the target on the line of sight, or "
        "along the heading that holds the path, so that the vessel comes to the target itself",
    )
    omega_v: float = value(
        2.0, "rad/s", "bandwidth of the sway load's observer, for standoff_reference: crab", gt=0
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

    anti_windup: Literal["none", "auxiliary"] = value(
        "none",
        "",
        "what the law's memory does while the actuator falls short of the demand: "
        "nothing as printed, or the shortfall is taken out of what it learns from",
    )

    @model_validator(mode="after")
    def _aims(self) -> Self:
        """Raises ValueError for a reference that needs a standoff and has none."""
        if self.standoff_reference == "crab" and self.standoff <= 0:
            raise ValueError("standoff_reference: crab needs a standoff above 0")
        return self

    def approach(self) -> Approach:
        """k_ze, from the standoff on, see (21); a crab standoff keeps no distance."""
        return Approach(self.k_ze, 0.0 if self.swaying() else self.standoff)

    def swaying(self) -> Slots:
        """The part of the memory that knows the sway load, where the standoff needs it."""
        return each(SWAY) if self.standoff_reference == "crab" else ()

    def constants(self) -> dict[str, float]:
        """The fields' numbers, and where that part is in the memory (0 for nowhere)."""
        at, slots = 0, self.slots() if self.swaying() else ()
        if slots:
            at = sum(size for _, size in slots[: slots.index((SWAY[0], 1))])
        return super().constants() | {"crab_at": float(at)}

    def wants_loads(self) -> bool:
        """Whether it has to know the loads that act: with anti-windup only."""
        return self.anti_windup == "auxiliary"

    def sample_period(self) -> float:
        """The step [s] of the difference, where one or a held direction is used; else 0."""
        needed = self.rate == "difference" or self.hold_below > 0
        return self.difference_step if needed else 0.0

    # t [s], x (6) state, target (6); changes memory at PSI_D_HELD and PSI_D_RATE_HELD.
    @staticmethod
    @kernel
    def sample(t: float, x: Vector, memory: Vector, target: Vector, k: Any) -> None:
        """Take the target's direction for the difference and for holding."""
        aim = take_aim(x, memory, target, k, scratch(6))
        hold(t, x, memory, aim, k)

    def start(self, x: Vector, target: Vector, nominal: Vessel) -> Vector:
        """The memory that `begin` gives for the law's constants."""
        return self.begin(x, target, bundle(self.constants_with(nominal)))

    def begin(self, x: Vector, target: Vector, k: Any) -> Vector:
        """The memory (slots,) at t = 0 for the constants `k`, which are asked for once a start.

        All zero but the held direction: to the target, or its course where it is right here.
        """
        memory = np.zeros(sum(size for _, size in self.slots()))
        if self.swaying():
            memory[int(k.crab_at)] = x[4]
        x_e, y_e = take_aim(x, memory, target, k, np.zeros(6))[:2] - x[:2]
        memory[PSI_D_HELD] = direction(x_e, y_e) if x_e or y_e else direction(*target[2:4])
        return memory

    def first_errors(self, x: Vector, memory: Vector, target: Vector, k: Any) -> Tracking:
        """The errors at the start, with this memory once it has taken a sample."""
        seen = np.array(memory)
        call(self.sample, t=0.0, x=x, memory=seen, target=target, k=k, table=self.table())
        return track(x, seen, take_aim(x, memory, target, k, np.zeros(6)), k)
