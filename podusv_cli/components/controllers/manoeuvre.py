"""What the manoeuvring trials share: a steered thrust without feedback, after a straight approach.

The trials and their numbers are those of the IMO's standards for ship manoeuvrability, resolution
MSC.137(76) of 2002, with a thrust that is turned in place of a rudder.
"""

from __future__ import annotations

from typing import Any, ClassVar

from podusv_cli.components import rules as by
from podusv_cli.components.controllers.base import Controller
from podusv_cli.core.component import Rule, Ruled, value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal

NEAR = 1e-9  # s
SIDE = Signal(
    "side",
    "1",
    "side to which the trial steers: 1 starboard, -1 port, 0 before it; in a step in "
    "which it changes, the mean over the step",
)
STEERING = Signal(
    "delta_s", "rad", "angle at which the thrust steers, positive to starboard", r"\delta_s"
)


# Writes tau (2) [N, N m] and signals[0], the angle [rad].
@kernel
def steer_thrust(angle: float, side: float, k: Any, tau: Vector, signals: Vector) -> None:
    """The demand of a thrust that acts `lever` behind the origin and steers at `angle` [rad].

    A side of 1 is starboard, -1 port; between them it is the mean over a step in which the side
    changes.
    """
    cosine, sine = cos_sin(angle)
    tau[0] = k.thrust * cosine
    tau[1] = k.thrust * k.lever * sine * side
    signals[0] = angle * side


@kernel
def has_begun(t: float, k: Any) -> bool:
    """Whether the trial has begun at this instant; t is a whole number of steps, but rounded."""
    return bool(t > k.execute - NEAR)


class Manoeuvre(Controller):
    """Straight ahead until `execute`, then another way; the path and its target are left aside."""

    rules: ClassVar[dict[str, Rule]] = {"thrust": by.FORCE}
    thrust: Ruled = value(2.0, "N", "thrust of the approach", gt=0)
    execute: float = value(
        60.0,
        "s",
        "time at which the trial begins, a whole number of steps; steady speed by then",
        ge=0,
    )

    def takes_samples(self) -> bool:
        """Whether `sample` is called: always.

        How far the trial is, is a part of the memory, which changes at instants only.
        """
        return True


class Steering(Manoeuvre):
    """The thrust of the approach, steered; positive angles steer to starboard."""

    signals: ClassVar[tuple[Signal, ...]] = (STEERING,)
    rules: ClassVar[dict[str, Rule]] = Manoeuvre.rules | {"lever": by.LENGTH}
    lever: Ruled = value(0.5, "m", "distance of the thrust behind the body origin", gt=0)
