"""What autopilots of rovers share, which steer boats, too: PI control and a mixer.

Speed and yaw rate each have a controller whose output, throttle or steering, is a part of full
scale between -1 and 1. The mixer makes one of both that two equal thrusters, one at each side, can
give: |throttle| + |steering| <= 1. `ardupilot` and `px4` name the sources.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

import numpy as np

from podusv_cli.components import rules as by
from podusv_cli.components.controllers.base import Controller, Most, Slots, each
from podusv_cli.components.controllers.velocity_loop import Axis, Loop
from podusv_cli.core.component import Rule, Ruled, value
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.kinematics import direction
from podusv_cli.core.signal import Signal

THROTTLE_I, STEERING_I = 0, 1  # positions in the memory
INTEGRALS = (
    Signal("throttle_i", "1", "part of the throttle that the integral of the speed error makes"),
    Signal("steering_i", "1", "part of the steering that the integral of the yaw rate error makes"),
)
OUTPUTS = (
    Signal("u_d", "m/s", "wanted surge velocity"),
    Signal("r_d", "rad/s", "wanted yaw rate"),
    Signal("throttle", "1", "part of the full surge force"),
    Signal("steering", "1", "part of the full yaw moment"),
)
SHARED = 0.0  # the place of "shared" among the choices of `mixing`


@kernel
def clip(number: float, most: float) -> float:
    """`number` within +-`most`."""
    return min(max(number, -most), most)


@kernel
def beyond(number: float, least: float) -> float:
    """`number`, or 0 where it is not larger than its threshold."""
    return number if abs(number) > least else 0.0


@kernel
def kept_within(integral: float, rate: float, most: float) -> float:
    """The rate of an integral that ends at +-`most`."""
    return 0.0 if abs(integral) >= most and rate * integral > 0.0 else rate


# x (6) state, target (6).
@kernel
def path_course(x: Vector, target: Vector) -> float:
    """Direction of the target's path; of a target at rest, that of the line to it [rad]."""
    if target[2] == 0.0 and target[3] == 0.0:
        return direction(target[0] - x[0], target[1] - x[1])
    return direction(target[2], target[3])


# x (6) state, target (6); in m/s. A target at rest has no course: all of the distance counts as
# ahead.
@kernel
def approach_speed(x: Vector, target: Vector, gain: float, k: Any) -> float:
    """The target's speed, and `gain` [1/s] times how far it is ahead, within U."""
    e_x, e_y = target[0] - x[0], target[1] - x[1]
    speed = math.sqrt(target[2] * target[2] + target[3] * target[3])
    along = math.sqrt(e_x * e_x + e_y * e_y)
    if speed > 0.0:
        along = max((e_x * target[2] + e_y * target[3]) / speed, 0.0)
    return float(min(k.U, speed + gain * along))


class Rover(Controller):
    """Throttle and steering for a wanted surge velocity and yaw rate."""

    signals: ClassVar[tuple[Signal, ...]] = OUTPUTS
    no_gains: ClassVar[tuple[str, ...]] = ("surge", "yaw", "U", "r_m")
    against_windup: ClassVar[str] = "lower speed_I and rate_I"
    rules: ClassVar[dict[str, Rule]] = {
        "surge": by.FORCE,
        "yaw": by.MOMENT,
        "U": by.SPEED,
        "r_m": by.TURN,
        "rate_FF": by.STEERING,
        "rate_P": by.STEERING,
        "rate_I": by.STEERING,
    }

    file: str | None = value(
        None, "", "parameter file of the autopilot, beside the scenario; read into the other keys"
    )
    surge: Ruled = value(8.0, "N", "surge force at full throttle", gt=0)
    yaw: Ruled = value(2.5, "N m", "yaw moment at full steering", gt=0)
    mixing: Literal["shared", "separate"] = value(
        "shared",
        "",
        "whether throttle and steering share two thrusters, or each has an actuator of "
        "its own (podusv's, which neither firmware has)",
    )
    U: Ruled = value(1.0, "m/s", "largest wanted speed", gt=0)
    r_m: Ruled = value(0.955, "rad/s", "largest wanted yaw rate", gt=0)
    speed_FF: Ruled = value(0.358, "s/m", "throttle per wanted speed", ge=0)
    speed_P: Ruled = value(0.358, "s/m", "throttle per missing speed", ge=0)
    speed_I: Ruled = value(0.358, "1/m", "rate of the throttle per missing speed", ge=0)
    rate_FF: Ruled = value(0.0923, "s/rad", "steering per wanted yaw rate", ge=0)
    rate_P: Ruled = value(0.0462, "s/rad", "steering per missing yaw rate", ge=0)
    rate_I: Ruled = value(0.0462, "1/rad", "rate of the steering per missing yaw rate", ge=0)

    def slots(self) -> Slots:
        """The memory: the integrals."""
        return each(INTEGRALS)

    def most(self) -> Most:
        """The speed U [m/s] that the law keeps within."""
        return Most(self.U)

    def velocity_loops(self, axes: tuple[Axis, Axis], nu: Vector) -> list[Loop]:
        """Loops of the axes: speed and yaw rate with their integrals.

        Gains are in parts of full scale, so they are multiplied by the load at full scale, the same
        at any `nu`.
        """
        scales = (("speed", self.surge), ("rate", self.yaw))
        return [
            Loop(
                axis.name,
                f"{name}_P",
                axis.damping,
                np.array([-getattr(self, f"{name}_P"), 1.0]) * full / axis.inertia,
                np.array([[-getattr(self, f"{name}_I"), 0.0]]),
                name="PI loop",
            )
            for axis, (name, full) in zip(axes, scales, strict=True)
        ]
