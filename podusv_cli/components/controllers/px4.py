"""PX4's differential rover in a mission: pure pursuit, then control of heading, yaw rate and speed.

Source: github.com/PX4/PX4-Autopilot, PurePursuit.cpp (commit 0c5c181), DifferentialVelControl.cpp
(12d2f69), DifferentialAttControl.cpp (1a907ef), DifferentialRateControl.cpp (15c4f08),
RoverControl.cpp (2f13ebc), PID.cpp (2cc8af2), and its parameters' files and tuning pages. Equations
and numbers are taken from there, no code. docs/laws/ardupilot.md has them, and what is left out.

Proved: how far beside a line a steady state is. Not proved: that the vessel comes to the path.
Anti-windup: integrals end at full scale, and begin anew wherever nothing is wanted.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

from podusv_cli.components import rules as by
from podusv_cli.components.controllers.base import Slots, each
from podusv_cli.components.controllers.parameter_files import of_px4
from podusv_cli.components.controllers.rover import (
    SHARED,
    STEERING_I,
    THROTTLE_I,
    Rover,
    approach_speed,
    beyond,
    clip,
    kept_within,
    path_course,
)
from podusv_cli.core.component import Rule, Ruled, ValuesOf, value
from podusv_cli.core.elementary import arctangent, cos_sin
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.kinematics import wrap
from podusv_cli.core.signal import Signal

TURNS = 2  # position in the memory
TURNING = Signal("turns", "1", "1 while it turns on the spot, else 0")


# x, target (6). Beyond reach a path is met at a right angle; `across` is to starboard of it [m].
@kernel
def heading_error(x: Vector, target: Vector, u_d: float, k: Any) -> float:
    """Bearing of where a circle about the vessel meets the path, or of the path, less psi [rad]."""
    course = path_course(x, target)
    c, s = cos_sin(course)
    across = (x[1] - target[1]) * c - (x[0] - target[0]) * s
    reach = min(max(k.lookahead * u_d, k.lookahead_min), k.lookahead_max)
    ahead = math.sqrt(max(reach * reach - across * across, 0.0))
    return wrap(course + arctangent(-across, ahead) - x[2])


@kernel
def wanted_turn(off: float, k: Any) -> float:
    """Wanted yaw rate for a heading error [rad/s]; 0 below the threshold."""
    return beyond(clip(k.yaw_P * off, k.r_m), k.r_least)


class Px4(Rover):
    """Pure pursuit, P control of heading, PI control of yaw rate and speed with feed forwards."""

    kind: Literal["px4"] = "px4"
    values_of: ClassVar[dict[str, ValuesOf]] = {"file": of_px4}
    no_gains: ClassVar[tuple[str, ...]] = (
        *Rover.no_gains,
        "lookahead_min",
        "lookahead_max",
        "stops_at",
        "drives_at",
    )
    rules: ClassVar[dict[str, Rule]] = Rover.rules | {
        "speed_FF": by.SLOWNESS,
        "speed_P": by.SLOWNESS,
        "speed_I": by.SLOWNESS,
    }
    speed_FF: Ruled = value(0.996, "s/m", "throttle per wanted speed (1/RO_MAX_THR_SPEED)", gt=0)
    speed_P: Ruled = value(0.189, "s/m", "throttle per missing speed (RO_SPEED_P)", ge=0)
    speed_I: Ruled = value(0.0189, "1/m", "rate of throttle per missing speed (RO_SPEED_I)", ge=0)
    rate_FF: Ruled = value(
        0.103,
        "s/rad",
        "steering per wanted yaw rate (RD_WHEEL_TRACK RO_YAW_RATE_CORR/(2 RO_MAX_THR_SPEED))",
        ge=0,
    )
    rate_P: Ruled = value(0.0481, "s/rad", "steering per missing yaw rate (RO_YAW_RATE_P)", ge=0)
    rate_I: Ruled = value(
        0.0481, "1/rad", "rate of steering per missing yaw rate (RO_YAW_RATE_I)", ge=0
    )
    yaw_P: float = value(1.0, "1/s", "wanted yaw rate per heading error (RO_YAW_P)", gt=0)
    lookahead: float = value(1.0, "s", "lookahead per wanted speed (PP_LOOKAHD_GAIN)", gt=0)
    lookahead_min: float = value(1.0, "m", "shortest lookahead (PP_LOOKAHD_MIN)", gt=0)
    lookahead_max: float = value(10.0, "m", "longest lookahead (PP_LOOKAHD_MAX)", gt=0)
    stops_at: float = value(
        0.175, "rad", "heading error beyond which it turns on the spot (RD_TRANS_DRV_TRN)", gt=0
    )
    drives_at: float = value(
        0.0873, "rad", "heading error within which it drives on (RD_TRANS_TRN_DRV)", gt=0
    )
    r_least: float = value(
        0.0524, "rad/s", "yaw rate, wanted or measured, that counts as 0 (RO_YAW_RATE_TH)", ge=0
    )
    u_least: float = value(0.1, "m/s", "measured speed that counts as 0 (RO_SPEED_TH)", ge=0)
    catch_up: float = value(
        0.2, "1/s", "wanted speed per distance to a target ahead; podusv's, for timed targets", ge=0
    )

    def slots(self) -> Slots:
        """The memory: that of all rovers, and whether it turns on the spot."""
        return (*super().slots(), *each((TURNING,)))

    def takes_samples(self) -> bool:
        """Whether `sample` is called: always, at every instant at which the law acts."""
        return True

    def steering(self) -> tuple[str, float]:
        """Key and gain [1/s] with which it turns the hull."""
        return "yaw_P", self.yaw_P

    @staticmethod
    @kernel
    def sample(x: Vector, memory: Vector, target: Vector, k: Any) -> None:
        """Begin and end turning on the spot; integrals of what is not wanted begin anew."""
        off = heading_error(x, target, approach_speed(x, target, k.catch_up, k), k)
        bound = k.drives_at if memory[TURNS] > 0.0 else k.stops_at
        memory[TURNS] = 1.0 if abs(off) > bound else 0.0
        memory[THROTTLE_I] *= 1.0 - memory[TURNS]
        memory[STEERING_I] *= 0.0 if wanted_turn(off, k) == 0.0 else 1.0

    # Writes tau (2) [N, N m]; speeds below their thresholds count as 0, as in the firmware.
    @staticmethod
    @kernel
    def law(
        x: Vector,
        memory: Vector,
        target: Vector,
        k: Any,
        tau: Vector,
        rate: Vector,
        signals: Vector,
    ) -> None:
        """Steering first; the wanted speed is what it leaves room for."""
        u_d = approach_speed(x, target, k.catch_up, k)
        r_d = wanted_turn(heading_error(x, target, u_d, k), k)
        u_d *= 1.0 - memory[TURNS]
        r_e = r_d - beyond(x[5], k.r_least)
        fed_back = clip(k.rate_P * r_e + memory[STEERING_I], 1.0)
        steering = clip(k.rate_FF * r_d + fed_back, 1.0) if r_d != 0.0 else 0.0
        room = 1.0 - abs(steering) if k.mixing == SHARED else 1.0
        u_d = min(u_d, room / k.speed_FF)
        speed = beyond(math.sqrt(x[3] * x[3] + x[4] * x[4]), k.u_least)
        u_e = u_d - (speed if x[3] >= 0.0 else -speed)
        fed_back = clip(k.speed_P * u_e + memory[THROTTLE_I], 1.0)
        throttle = clip(k.speed_FF * u_d + fed_back, room) if u_d > 0.0 else 0.0
        tau[0], tau[1] = k.surge * throttle, k.yaw * steering
        learns_r = k.rate_I * r_e if r_d != 0.0 else 0.0
        learns_u = k.speed_I * u_e if u_d > 0.0 else 0.0
        rate[STEERING_I] = kept_within(memory[STEERING_I], learns_r, 1.0)
        rate[THROTTLE_I] = kept_within(memory[THROTTLE_I], learns_u, 1.0)
        rate[TURNS] = 0.0
        signals[0], signals[1], signals[2], signals[3] = u_d, r_d, throttle, steering
