"""Follows a virtual ship: yaw by itself, and position by a linear feedback that needs a turn.

Source: E. Lefeber, K. Y. Pettersen and H. Nijmeijer, "Tracking control of an underactuated ship",
IEEE Transactions on Control Systems Technology 11 (2003), 52-61; the text was not at hand. Law and
gains are those of public programs that cite it. The virtual ship moves with the target, at the
drift angle of the told hull; the source has a recorded motion in its place.

Proved in the source: with a persistent turn, the told hull, no load and no limit, the errors vanish
from any start, globally and uniformly, and exponentially from then on. Not proved: anything about
a target whose turn changes, a load, or limits; on a straight line the pole of the position across
it is 0. Anti-windup: none, the law has no integral. docs/laws/cascade.md has the equations.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

import numpy as np

from podusv_cli.components.controllers.base import Controller, Slots, each
from podusv_cli.components.controllers.constant_bearing import Moving, turn_rate
from podusv_cli.components.controllers.velocity_loop import ALONE, Axis, Loop
from podusv_cli.components.vessels.plant import surge_force, sway_force, yaw_moment
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, bundle, kernel, tail
from podusv_cli.core.kinematics import direction, wrap
from podusv_cli.core.signal import Signal

SLOWEST = 1e-3  # m/s; a slower target has no course
CONSTANT = 1.0  # the place of "constant" among the choices of `cross`
HALVINGS = 60  # of the speed, until the drift of the virtual ship is a float's last digit
V_R = Signal("v_ref", "m/s", "sway velocity of the virtual ship", "v_r")


# x, y [m], psi [rad]; writes z (2) [m], ahead and to starboard.
@kernel
def along_bow(x: float, y: float, psi: float, z: Vector) -> None:
    """z = the position in axes turned by psi about the origin of the coordinates."""
    c, s = cos_sin(psi)
    z[0], z[1] = x * c + y * s, y * c - x * s


class Cascade(Controller):
    """Follows a virtual ship that drifts as the told hull does; needs a target that turns."""

    kind: Literal["cascade"] = "cascade"
    signals: ClassVar[tuple[Signal, ...]] = (
        Signal("z1_e", "m", "distance ahead of the virtual ship, each in its own axes", "z_{1,e}"),
        Signal("z2_e", "m", "distance to starboard of it, each in its own axes", "z_{2,e}"),
        Signal("psi_ref", "rad", "heading of the virtual ship", r"\psi_r", wrapped=True),
        Signal("r_ref", "rad/s", "yaw rate of the virtual ship", "r_r"),
    )
    no_gains: ClassVar[tuple[str, ...]] = ("turn",)
    k_u: float = value(10.28, "kg/s", "gain of the surge velocity", ge=0)
    k_v: float = value(9.2, "kg/s", "gain of the sway velocity in surge, at `turn`")
    k_1: float = value(4.44, "kg/s2", "gain of the position ahead", ge=0)
    k_2: float = value(2.74, "kg/s2", "gain of the position to starboard, at `turn`")
    k_r: float = value(9.02, "kg m2/s", "gain of the yaw rate", ge=0)
    k_psi: float = value(6.74, "kg m2/s2", "gain of the heading", ge=0)
    turn: float = value(
        0.05, "rad/s", "yaw rate of the virtual ship that k_v and k_2 are for", gt=0
    )
    cross: Literal["turning", "constant"] = value(
        "turning",
        "",
        "k_v and k_2 grow with the virtual ship's yaw rate and change sign with it, "
        "or are the same whatever the turn",
    )
    origin: Literal["earth", "target"] = value(
        "earth",
        "",
        "about which point positions are turned into the two ships' axes: the origin "
        "of the coordinates, as in the source, or the target",
    )

    def slots(self) -> Slots:
        """The memory: the virtual ship's sway velocity."""
        return each((V_R,))

    def workspace(self) -> int:
        """How many numbers of scratch the law needs: two positions."""
        return 4

    def start(self, x: Vector, target: Vector, nominal: Vessel) -> Vector:
        """The memory: the virtual ship's sway velocity (1,) [m/s] in a steady turn.

        The ship goes at the target's speed with the turn of its course. By bisection of its sway
        force; where there is no such turn, an end of the range. `nominal` has its coefficients.
        """
        k, speed = bundle(nominal.constants()), math.hypot(target[2], target[3])
        turn = turn_rate(Moving(*target[2:6]), SLOWEST)
        low, high = -speed, speed
        for _ in range(HALVINGS):  # the sway force falls with the sway velocity
            v = 0.5 * (low + high)
            falls = sway_force(math.sqrt(max(speed * speed - v * v, 0.0)), v, turn, k) < 0.0
            low, high = (low, v) if falls else (v, high)
        return np.array([0.5 * (low + high)])

    def velocity_loops(self, axes: tuple[Axis, Axis], nu: Vector) -> list[Loop]:
        """Loops of the axes surge and yaw without their positions, which are slower; at any nu."""
        surge, yaw = axes
        return [
            Loop(surge.name, "k_u", surge.damping, np.array([-self.k_u / surge.inertia]), ALONE),
            Loop(yaw.name, "k_r", yaw.damping, np.array([-self.k_r / yaw.inertia]), ALONE),
        ]

    # x (6), memory and rate (1), target (6), work (4); writes tau (2) [N, N m], rate and signals
    # (4). The virtual ship has the target's speed and drifts by v_r, so its heading is the course
    # less the drift angle, and its surge acceleration follows from that of the speed. `away` is 1
    # with the origin of the coordinates, else positions are those from the target.
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
        work: Vector,
    ) -> None:
        """Two loops that meet in the turn: yaw does not see the position."""
        V_d = Moving(target[2], target[3], target[4], target[5])
        speed = math.sqrt(V_d.x * V_d.x + V_d.y * V_d.y)
        turn, v_r = turn_rate(V_d, SLOWEST), memory[0]
        u_r = math.sqrt(max(speed * speed - v_r * v_r, 0.0))
        psi_r = direction(V_d.x, V_d.y) - direction(u_r, v_r)
        rate[0] = sway_force(u_r, v_r, turn, k) / k.m22
        power = V_d.x * V_d.rate_x + V_d.y * V_d.rate_y
        faster = (power - v_r * rate[0]) / max(u_r, SLOWEST)

        away = 1.0 - k.origin
        mine, its = work, tail(work, 2)
        along_bow(x[0] - k.origin * target[0], x[1] - k.origin * target[1], x[2], mine)
        along_bow(away * target[0], away * target[1], psi_r, its)
        z1_e, z2_e = mine[0] - its[0], mine[1] - its[1]
        cross = 1.0 if k.cross == CONSTANT else turn / k.turn
        tau[0] = k.m11 * faster - surge_force(u_r, v_r, turn, k) - k.k_u * (x[3] - u_r)
        tau[0] += cross * (k.k_v * (x[4] - v_r) + k.k_2 * z2_e) - k.k_1 * z1_e
        tau[1] = -yaw_moment(u_r, v_r, turn, k)
        tau[1] -= k.k_r * (x[5] - turn) + k.k_psi * wrap(x[2] - psi_r)
        signals[0], signals[1], signals[2], signals[3] = z1_e, z2_e, wrap(psi_r), turn
