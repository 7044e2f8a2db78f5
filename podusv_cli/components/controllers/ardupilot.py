"""ArduPilot Rover in Auto: guidance to a lateral acceleration, then control of yaw rate and speed.

Source: github.com/ArduPilot/ardupilot, AR_PosControl.cpp (commit 00357a4), AR_AttitudeControl.cpp
(00f02a6), AP_L1_Control.cpp (069b133), AR_WPNav.cpp where it still calls L1, AP_MotorsUGV.cpp
(0264b67), and its tuning in rover-quicktune.lua (13139c3). L1 guidance: S. Park, J. Deyst and J. P.
How, "A new nonlinear guidance logic for trajectory tracking", AIAA 2004-4900. Equations and numbers
are taken from there, no code. docs/laws/ardupilot.md has them, and what is left out.

Proved: period and damping of L1, linearised on a line; no offset in a steady state on a line. Not
proved: that the vessel comes there. Anti-windup: an integral whose output is limited only shrinks.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

from podusv_cli.components import rules as by
from podusv_cli.components.controllers.base import Slots, each
from podusv_cli.components.controllers.parameter_files import of_ardupilot
from podusv_cli.components.controllers.rover import (
    SHARED,
    STEERING_I,
    THROTTLE_I,
    Rover,
    approach_speed,
    clip,
    kept_within,
    path_course,
)
from podusv_cli.core.component import Rule, ValuesOf, value
from podusv_cli.core.elementary import arctangent, cos_sin
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.kinematics import direction, wrap
from podusv_cli.core.signal import Signal

CROSS_I = 2  # position in the memory
LEARNT = Signal("cross_i", "rad", "angle that the integral of the cross-track error adds")
L1 = 1.0  # the place of "l1" among the choices of `guidance`
SLOWEST = 1.0  # m/s, AR_ATTCONTROL_STEER_SPEED_MIN: speed that a lateral acceleration is over
STANDING = 0.1  # m/s; slower over ground, the course counts as the heading
CAPTURE = math.sqrt(0.5)  # sine of the largest angle at which L1 comes to the line
LEARNS = math.radians(5.0)  # within it the cross-track integral learns
LEARNT_MOST = 0.1  # rad


# x (6) state, target (6); returns m/s and rad/s. The wanted velocity is cut to the approach speed,
# and turned into the body frame; what is wanted sideways becomes a lateral acceleration, and that
# over the speed a yaw rate.
@kernel
def by_position(x: Vector, target: Vector, k: Any) -> tuple[float, float]:
    """Wanted speed and yaw rate of the position controller."""
    c, s = cos_sin(x[2])
    v_x, v_y = target[2] + k.pos_P * (target[0] - x[0]), target[3] + k.pos_P * (target[1] - x[1])
    length = math.sqrt(v_x * v_x + v_y * v_y)
    scale = min(approach_speed(x, target, k.pos_P, k) / length, 1.0) if length > 0.0 else 0.0
    ahead, aside = scale * (v_x * c + v_y * s), scale * (v_y * c - v_x * s)
    u_d = max(ahead, 0.0)
    sideways = k.vel_P * (aside - x[4]) + k.vel_FF * aside + target[5] * c - target[4] * s
    return u_d, sideways / max(u_d, SLOWEST)


# x (6) state, target (6), angle_i [rad] the integral; returns m/s, rad/s, rad/s. The lateral
# acceleration is 4 zeta^2 V^2/L_1 sin(off), of which the yaw rate is the share over the speed, with
# its sign, so that a boat going astern is turned the other way. `sight` is the angle from the path
# to the point on it that is L_1 away.
@kernel
def by_l1(x: Vector, target: Vector, angle_i: float, k: Any) -> tuple[float, float, float]:
    """Wanted speed and yaw rate of L1 guidance, and the rate of the integral's angle."""
    course = path_course(x, target)
    c, s = cos_sin(course)
    across = (x[1] - target[1]) * c - (x[0] - target[0]) * s
    speed, track = math.sqrt(x[3] * x[3] + x[4] * x[4]), x[2] + direction(x[3], x[4])
    if speed < STANDING or x[3] <= 0.0:
        speed, track = STANDING, x[2]
    L_1 = max(k.l1_damping * k.l1_period * speed / math.pi, k.l1_least)
    sine = clip(-across / L_1, CAPTURE)
    sight = arctangent(sine, math.sqrt(1.0 - sine * sine))
    learns = k.l1_I * sight if abs(sight) < LEARNS else 0.0
    # The angle of the velocity is wrapped, the sum is not: facing away, it turns the way back.
    off = clip(sight + angle_i + wrap(course - track), 0.5 * math.pi)
    _, turning = cos_sin(off)
    sideways = 4.0 * k.l1_damping * k.l1_damping * speed * speed / L_1 * turning
    over = max(x[3], SLOWEST) if x[3] >= 0.0 else min(x[3], -SLOWEST)
    learns = kept_within(angle_i, learns, LEARNT_MOST)
    return approach_speed(x, target, k.pos_P, k), sideways / over, learns


# error and integral in parts of full scale over the gain. An error of the integral's own sign would
# make it grow, so it is left out where the output is limited.
@kernel
def shrinks(integral: float, error: float, gain: float, limited: bool) -> float:
    """The rate of an integral within +-1 that may only shrink where its output is `limited`."""
    rate = kept_within(integral, gain * error, 1.0)
    return 0.0 if limited and error * integral >= 0.0 else rate


class ArduPilot(Rover):
    """Position controller or L1 guidance, PI control of yaw rate and speed with feed forwards."""

    kind: Literal["ardupilot"] = "ardupilot"
    values_of: ClassVar[dict[str, ValuesOf]] = {"file": of_ardupilot}
    rules: ClassVar[dict[str, Rule]] = Rover.rules | {
        "speed_FF": by.THROTTLE,
        "speed_P": by.THROTTLE,
        "speed_I": by.THROTTLE,
    }
    guidance: Literal["position", "l1"] = value(
        "position", "", "the position controller of Rover 4.3 and later, or L1 of 4.2 and before"
    )
    pos_P: float = value(0.2, "1/s", "velocity per distance (PSC_POS_P)", gt=0)
    vel_P: float = value(1.0, "1/s", "acceleration per missing velocity (PSC_VEL_P)", gt=0)
    vel_FF: float = value(0.0, "1/s", "acceleration per wanted velocity (PSC_VEL_FF)", ge=0)
    l1_period: float = value(8.0, "s", "period of the L1 loop (NAVL1_PERIOD)", gt=0)
    l1_damping: float = value(0.75, "", "damping of the L1 loop (NAVL1_DAMPING)", gt=0)
    l1_least: float = value(2.0, "m", "shortest distance ahead of L1 (WP_RADIUS)", ge=0.1)
    l1_I: float = value(0.02, "1/s", "gain of the cross-track integral (NAVL1_XTRACK_I)", ge=0)

    def slots(self) -> Slots:
        """The memory: that of all rovers, and the cross-track integral."""
        return (*super().slots(), *each((LEARNT,)))

    # x (6), memory and rate (3), target (6); writes tau (2) [N, N m], rate and signals (4).
    # Throttle and steering are parts of full scale, each cut to 1.
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
        """Guidance, then throttle and steering; where both exceed the thrusters, both give way."""
        rate[CROSS_I] = 0.0
        if k.guidance == L1:
            u_d, turn, rate[CROSS_I] = by_l1(x, target, memory[CROSS_I], k)
        else:
            u_d, turn = by_position(x, target, k)
        r_d = clip(turn, k.r_m)
        u_e, r_e = u_d - x[3], r_d - x[5]
        throttle = k.speed_FF * u_d + k.speed_P * u_e + memory[THROTTLE_I]
        steering = k.rate_FF * r_d + k.rate_P * r_e + memory[STEERING_I]
        t, s = clip(throttle, 1.0), clip(steering, 1.0)
        over = max(abs(t) + abs(s), 1.0) if k.mixing == SHARED else 1.0
        tau[0], tau[1] = k.surge * t / over, k.yaw * s / over
        both = over > 1.0
        rate[THROTTLE_I] = shrinks(memory[THROTTLE_I], u_e, k.speed_I, both or abs(throttle) > 1.0)
        rate[STEERING_I] = shrinks(memory[STEERING_I], r_e, k.rate_I, both or abs(steering) > 1.0)
        signals[0], signals[1], signals[2], signals[3] = u_d, r_d, t / over, s / over
