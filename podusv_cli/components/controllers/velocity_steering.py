"""What laws share that turn the vector of velocity over ground: yaw first, surge as far as it fits.

The bow turns until the wanted velocity and the predicted sway agree, by the angle chi_e. Surge
waits for yaw: the vessel turns first. docs/laws/velocity_vector.md has the equations.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal, NamedTuple

from podusv_cli.components import rules as by
from podusv_cli.components.controllers.base import Most
from podusv_cli.components.controllers.constant_bearing import NEARS
from podusv_cli.components.controllers.observer import B_U, ObservingController
from podusv_cli.components.vessels.plant import surge_force
from podusv_cli.core.component import Positive, Rule, Ruled, value
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.kinematics import direction
from podusv_cli.core.signal import Signal

SHORTER = 1.0  # the place of "shorter" among the choices of `astern`


class Wanted(NamedTuple):
    """The wanted velocity V_c in the body frame, its surge acceleration and its turn."""

    a: float  # surge part of V_c [m/s]
    b: float  # sway part of V_c [m/s]
    A_a: float  # surge part of its rate A [m/s2]
    turn: float  # rate of a direction that the law turns with [rad/s]
    backward: bool  # whether V_c points against the target's course, and the bow does not


class Aim(NamedTuple):
    """How the bow stands to the wanted velocity."""

    side: float  # -1 where the vessel backs up, else 1
    speed: float  # of the wanted velocity less the predicted sway [m/s]
    chi_e: float  # angle that the velocity vector has to turn by [rad]


# With `astern: shorter` the vessel backs up (side -1) where V_c points against the target's course,
# and abaft the beam.
@kernel
def aim(wanted: Wanted, v_s: float, k: Any) -> Aim:
    """The angle to V_c less the sway velocity v_s [m/s] that the hull settles to."""
    a, w = wanted.a, wanted.b - v_s
    side = -1.0 if wanted.backward and a < 0.0 and k.astern == SHORTER else 1.0
    return Aim(side, math.sqrt(a * a + w * w), direction(side * a, side * w))


# x (6) state, memory has the observed load. Reads tau[1] [N m], writes tau[0] [N]; returns m/s.
# `forward` is the cosine of the angle that is left to turn, 1 where the vessel goes the wrong way
# anyhow; a yaw moment above N_m slows surge down as much. The wanted velocity turns in the body
# frame: r b.
@kernel
def surge_demand(x: Vector, memory: Vector, wanted: Wanted, at: Aim, k: Any, tau: Vector) -> float:
    """Write the surge demand, as far as the velocity points the right way; the wanted velocity.

    `tau[1]`, the yaw moment, is written already.
    """
    u, v, r, a = x[3], x[4], x[5], wanted.a
    forward = at.side * a / at.speed if at.side * a > 0.0 and at.speed > 0.0 else 1.0
    F = forward * k.N_m / max(abs(tau[1]), k.N_m)
    u_d = a * F
    ahead = min(max((wanted.A_a + r * wanted.b) * F, -k.a_m), k.a_m)
    tau[0] = k.m11 * (ahead + k.k_u * (u_d - u)) - surge_force(u, v, r, k) - memory[B_U]
    return float(u_d)


class VelocitySteering(ObservingController):
    """Keys of laws that turn the velocity vector."""

    signals: ClassVar[tuple[Signal, ...]] = (
        Signal("u_d", "m/s", "wanted surge velocity"),
        Signal("r_d", "rad/s", "wanted yaw rate"),
        Signal("v_s", "m/s", "sway velocity that the hull settles to, predicted"),
        Signal(
            "chi_e", "rad", "angle that the velocity vector has to turn by", r"\chi_e", wrapped=True
        ),
    )
    no_gains: ClassVar[tuple[str, ...]] = ("thrust_lever",)  # where the pods are
    rules: ClassVar[dict[str, Rule]] = {
        **by.OBSERVER,
        "k_p": by.PACE,
        "U": by.SPEED,
        "r_m": by.YAW_RATE,
        "k_u": by.SURGE,
        "V_m": by.SPEED,
        "a_m": by.ACCELERATION,
        "N_m": by.MOMENT,
    }
    k_p: Ruled = value(0.5, "1/s", "gain of the distance, near the target", gt=0)
    U: Ruled = value(1.25, "m/s", "largest wanted speed, about 1.2 times that at full thrust", gt=0)
    r_m: Ruled = value(1.4, "rad/s", "yaw rate that a large angle approaches", gt=0)
    k_u: Ruled = value(0.75, "1/s", "gain of the surge velocity", gt=0)
    V_m: Ruled = value(0.1, "m/s", "speed below which a direction counts for less", gt=0)
    a_m: Ruled = value(1.0, "m/s2", "largest wanted acceleration used ahead", gt=0)
    astern: Literal["never", "shorter"] = value(
        "shorter",
        "",
        "what a vessel ahead of the target does: turns round, and again when it is "
        "there (never), or backs up if its bow points to the target's course (shorter)",
    )
    thrust_lever: Positive | None = value(
        None,
        "m",
        "distance behind the origin at which the pods turn, whose sway force makes the "
        "moment; none where the moment comes without a sway force",
    )
    N_m: Ruled = value(2.5, "N m", "moment beyond which surge yields to yaw", gt=0)

    def most(self) -> Most:
        """U [m/s] and N_m [N m] that it keeps within, and how fast it nears a target as fast."""
        return Most(self.U, NEARS, self.N_m)
