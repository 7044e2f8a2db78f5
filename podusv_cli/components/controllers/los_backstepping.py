"""Line of sight with a circle about the ship, and backstepping that needs no force in sway.

Source: T. I. Fossen, M. Breivik and R. Skjetne, "Line-of-sight path following of underactuated
marine craft", IFAC Proceedings 36 (2003), 211-216; the text was not at hand. Law and gains are
those of public programs that cite it. The filter of the heading is podusv's choice.

Proved in the source: with the told hull, no Coriolis term, no load and no limit, the errors of
heading and velocities vanish exponentially from any start, and the sway velocity that stands in
for the missing force stays bounded. Not proved: that the vessel comes to the path, and anything
about a load or a limit. Anti-windup: none, the law has no integral. Equations:
docs/laws/los_backstepping.md.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

import numpy as np

from podusv_cli.components.controllers.base import Controller, Slots, each
from podusv_cli.components.controllers.velocity_loop import ALONE, Axis, Loop
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import value
from podusv_cli.core.elementary import arctangent, cos_sin
from podusv_cli.core.kernel import Vector, bundle, kernel
from podusv_cli.core.kinematics import direction, wrap
from podusv_cli.core.signal import Signal

LEFT_OUT = 1.0  # the place of "left_out" among the choices of `sway`
MEMORY = (
    Signal("alpha_2", "m/s", "sway velocity that the law wants, by its own dynamics", r"\alpha_2"),
    Signal("psi_f", "rad", "filtered angle of the line of sight", r"\psi_f"),
    Signal("r_f", "rad/s", "rate of the filtered angle", "r_f"),
    Signal("r_f_rate", "rad/s2", "rate of that rate", r"\dot r_f"),
)


# x (6) state, target (6). `across` [m] is the vessel to starboard of the path; the circle of this
# radius meets the path at the angle asin(-across/circle) from it.
@kernel
def sight(x: Vector, target: Vector, k: Any) -> float:
    """Angle [rad] to where a circle about the ship meets the path; across it, where it does not."""
    course = direction(target[2], target[3])
    c, s = cos_sin(course)
    across = (x[1] - target[1]) * c - (x[0] - target[0]) * s
    sine = min(max(-across / k.circle, -1.0), 1.0)
    return float(course + arctangent(sine, math.sqrt(1.0 - sine * sine)))


# memory and rate: the angle stands at 1, its derivatives at 2 and 3. `sighted` [rad], w [rad/s].
@kernel
def filter_angle(memory: Vector, sighted: float, w: float, rate: Vector) -> None:
    """Rates of the filtered angle and of its two derivatives: a triple pole at -w."""
    rate[1], rate[2] = memory[2], memory[3]
    rate[3] = w * (w * (w * wrap(sighted - memory[1]) - 3.0 * memory[2]) - 3.0 * memory[3])


# v, alpha_2 [m/s], r [rad/s], turn [rad/s2]. `braked` [N] is Y_v v + k2 (v - alpha_2): damping, and
# k2 pulls the wanted sway velocity to the vessel's own.
@kernel
def sway_rate(v: float, r: float, alpha_2: float, turn: float, k: Any) -> float:
    """alpha_2' [m/s2]: row 2 of M z_2' = -K z_2, for a yaw rate that is to change by `turn`."""
    braked = k.Y_v * alpha_2 + (k.k2 + k.Y_v) * (v - alpha_2)
    return float((braked - k.m23 * turn + k.Y_r * r) / k.m22)


class LosBackstepping(Controller):
    """Heading to the line of sight and speed along it; the place along the path is free."""

    kind: Literal["los_backstepping"] = "los_backstepping"
    signals: ClassVar[tuple[Signal, ...]] = (
        Signal("z1", "rad", "heading less the filtered line of sight", "z_1", wrapped=True),
        Signal("z_u", "m/s", "surge velocity less the wanted speed", "z_u"),
        Signal("z_v", "m/s", "sway velocity less alpha_2", "z_v"),
        Signal("z_r", "rad/s", "yaw rate less the virtual control alpha_3", "z_r"),
        Signal("psi_los", "rad", "angle of the line of sight", r"\psi_{los}", wrapped=True),
    )
    no_gains: ClassVar[tuple[str, ...]] = ("circle",)
    c: float = value(0.75, "1/s", "gain of the heading in the wanted yaw rate", gt=0)
    k1: float = value(25.0, "kg/s", "gain of the surge velocity", ge=0)
    k2: float = value(10.0, "kg/s", "gain of the sway velocity in alpha_2", ge=0)
    k3: float = value(2.5, "kg m2/s", "gain of the yaw rate", ge=0)
    circle: float = value(
        2.51,
        "m",
        "radius of the circle about the ship, n of its lengths (here two of 1.255 m)",
        gt=0,
    )
    w: float = value(0.9, "1/s", "triple pole of the filter of the line of sight", gt=0)
    sway: Literal["accounted", "left_out"] = value(
        "accounted", "", "whether alpha_2' enters the moment, as in the source, or is left out"
    )
    filter_start: Literal["heading", "sight"] = value(
        "heading",
        "",
        "where the filtered angle starts: at the ship's heading, so that z1 is 0, "
        "or at the line of sight",
    )

    def slots(self) -> Slots:
        """The memory: alpha_2, then the filter's angle and its derivatives."""
        return each(MEMORY)

    def start(self, x: Vector, target: Vector, nominal: Vessel) -> Vector:
        """The memory (4,): alpha_2 of 0, and the filter at rest at the heading or the sight."""
        k = bundle(self.constants())
        angle = x[2] if self.filter_start == "heading" else sight(x, target, k)
        return np.array([0.0, angle, 0.0, 0.0])

    def velocity_loops(self, axes: tuple[Axis, Axis], nu: Vector) -> list[Loop]:
        """Loops of the axes surge, and yaw without the heading, which is slower; at any nu."""
        surge, yaw = axes
        braking = self.k3 + self.c * yaw.told
        return [
            Loop(surge.name, "k1", surge.damping, np.array([-self.k1 / surge.inertia]), ALONE),
            Loop(yaw.name, "k3", yaw.damping, np.array([-braking / yaw.inertia]), ALONE),
        ]

    # x (6), memory and rate (4), target (6); writes tau (2) [N, N m], rate and signals (5).
    # `faster` [m/s2] is the target's acceleration along its course, `turn` the rate of alpha_3 =
    # r_f - c z1. memory: alpha_2, the filtered angle and its two derivatives.
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
        """Backstepping: heading, then the three velocities, of which sway has alpha_2."""
        u, v, r, alpha_2, r_f = x[3], x[4], x[5], memory[0], memory[2]
        u_d = math.sqrt(target[2] * target[2] + target[3] * target[3])
        faster = target[2] * target[4] + target[3] * target[5]
        faster = faster / u_d if u_d > 0.0 else 0.0
        sighted = sight(x, target, k)
        z1 = wrap(x[2] - memory[1])
        z_u, z_r = u - u_d, r - (r_f - k.c * z1)
        turn = memory[3] - k.c * (r - r_f)
        rate[0] = sway_rate(v, r, alpha_2, turn, k)
        tau[0] = k.m11 * faster - k.X_u * u - k.k1 * z_u
        tau[1] = k.m33 * turn - k.N_v * v - k.N_r * r - k.k3 * z_r - z1
        tau[1] += 0.0 if k.sway == LEFT_OUT else k.m32 * rate[0]
        filter_angle(memory, sighted, k.w, rate)
        signals[0], signals[1], signals[2], signals[3] = z1, z_u, v - alpha_2, z_r
        signals[4] = wrap(sighted)
