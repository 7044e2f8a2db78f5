"""What the manoeuvring trials share: a steered thrust without feedback, after a straight approach.

The trials and their numbers are those of the IMO's standards for ship manoeuvrability, resolution
MSC.137(76) of 2002, with a thrust that is turned in place of a rudder.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

from podusv_cli.components.controllers.base import Controller, Trial
from podusv_cli.core.component import value
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal

STEERING = Signal(
    "delta_s", "rad", "angle at which the thrust steers, positive to starboard", r"\delta_s"
)


@kernel
def steered(angle: float, k: Any, tau: Vector, signals: Vector) -> None:
    """The demand of a thrust that acts `lever` behind the origin and steers at `angle` [rad]."""
    tau[0] = k.thrust * math.cos(angle)
    tau[1] = k.thrust * k.lever * math.sin(angle)
    signals[0] = angle


class Manoeuvre(Controller):
    """Straight ahead until `execute`, then steered; the path and its target are left aside."""

    signals: ClassVar[tuple[Signal, ...]] = (STEERING,)
    thrust: float = value(2.0, "N", "thrust, the same all the time", gt=0)
    lever: float = value(0.5, "m", "distance of the thrust behind the body origin", gt=0)
    execute: float = value(60.0, "s", "time at which steering begins; steady speed by then", ge=0)

    def trial(self) -> Trial:
        """When steering begins; positive angles steer to starboard."""
        return Trial(self.execute)
