"""The steady motion that follows the target: velocities and loads along the path.

A hull that follows moves at the target's speed over ground U. Its sway v balances the sway forces:
Y(u, v, r) + b_v + tau_v = 0 with u^2 + v^2 = U^2. r is the turn rate of the target's course, b_v
the mean load, and tau_v the sway force that the actuator produces with the yaw moment
-(N(u, v, r) + b_r).

A hull that is asked for a heading and can push sideways has no choice: velocities are the path's.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from podusv_cli.components.vessels.plant import lacking, surge_force, sway_force, yaw_moment
from podusv_cli.core.kernel import Vector, bundle
from podusv_cli.core.signal import PSI_D
from podusv_cli.scenario.model import Scenario

SAMPLES = 60  # times of a run, evenly spread
FASTEST = 100.0  # m/s; larger sway is not searched for
STANDING = 1e-6  # m/s; a slower target has no course


@dataclass(frozen=True)
class Reference:
    """The steady motion that follows the target, at sampled times of a run.

    `nu` (n, 3) is the hull's velocity, with NaN for surge and sway where no heading can follow;
    `load` (n, 3) the disturbance; `demand` (n, 2) the surge force [N] and yaw moment [N m] that
    keep this velocity, (n, 3) with a sway force [N] where the law asks for one.
    """

    time: Vector
    speed: Vector
    nu: Vector
    load: Vector
    demand: Vector

    @property
    def working(self) -> Vector:
        """Median of `nu`; (target's speed, 0, 0) where no heading can follow."""
        known = self.nu[np.isfinite(self.nu).all(axis=1)]
        if not len(known):
            return np.array([median(self.speed), 0.0, 0.0])
        return np.array([median(velocity) for velocity in known.T])

    @property
    def steady_sway(self) -> float:
        """Median sway velocity of `nu` [m/s]; 0 where no heading can follow."""
        known = self.nu[:, 1][np.isfinite(self.nu[:, 1])]
        return median(known) if len(known) else 0.0


def median(values: Vector) -> float:
    """The median of values (n,); numpy's own imports numpy.ma, 9 ms of every run."""
    return float(statistics.median(values.tolist()))


def reference(scenario: Scenario) -> Reference:
    """Sample a scenario's target and loads, and balance the hull's loads at each sample."""
    time = np.linspace(0.0, scenario.simulation.duration, SAMPLES)
    if scenario.controller.asks_sway() and scenario.path.heads:
        return _reference_of_poses(scenario, time)
    target = scenario.path.targets(time.tolist())
    speed, turn, along = _motion(target)
    load = _loads(scenario, time, target, turn)
    balance = _balance(scenario, float(load[:, 1].mean()), float(load[:, 2].mean()))
    nu = np.array([(*balance(U, r), r) for U, r in zip(speed.tolist(), turn.tolist(), strict=True)])
    # Where no heading can follow, the demand is that of moving along the course without sway.
    held = np.where(np.isnan(nu), np.column_stack([speed, 0.0 * speed, turn]), nu)
    k = bundle(scenario.vessel.constants())
    # Of C nu, which the hull may have a share of only; (surge, sway, yaw).
    less = np.array([lacking(u, v, r, k) for u, v, r in held.tolist()])
    demand = -np.array(
        [(surge_force(u, v, r, k), yaw_moment(u, v, r, k)) for u, v, r in held.tolist()]
    )
    demand -= less[:, [0, 2]]
    demand[:, 0] += scenario.vessel.m11 * along
    return Reference(time, speed, nu, load, demand - load[:, [0, 2]])


def _reference_of_poses(scenario: Scenario, time: Vector) -> Reference:
    """The reference (n,) where the path has a heading and the law pushes sideways.

    tau = M nu' - f(nu) - b with nu = R^T p_d' and the rate of the heading; nu' = R^T p_d'' - r S
    nu. `time` is (n,) [s].
    """
    rows, vessel = scenario.path.whole_targets(time.tolist()), scenario.vessel
    psi, r, r_dot = rows[:, PSI_D:].T
    c, s = np.cos(psi), np.sin(psi)
    u, a = (c * rows[:, at] + s * rows[:, at + 1] for at in (2, 4))
    v, b = (c * rows[:, at + 1] - s * rows[:, at] for at in (2, 4))
    nu = np.column_stack([u, v, r])
    load = scenario.sea.loads(vessel, time.tolist(), np.column_stack([rows[:, :2], psi, nu]))
    k = bundle(vessel.constants())
    forces = np.array(
        [
            (surge_force(u, v, r, k), sway_force(u, v, r, k), yaw_moment(u, v, r, k))
            for u, v, r in nu.tolist()
        ]
    )
    less = np.array([lacking(u, v, r, k) for u, v, r in nu.tolist()])
    inertia = np.array(
        [[vessel.m11, 0.0, 0.0], [0.0, vessel.m22, vessel.m23], [0.0, vessel.m32, vessel.m33]]
    )
    growth = np.column_stack([a + r * v, b - r * u, r_dot])
    tau = growth @ inertia.T - forces - less - load
    # Surge, yaw, sway: the order of `demand`.
    return Reference(time, np.hypot(u, v), nu, load, tau[:, [0, 2, 1]])


def _motion(target: Vector) -> tuple[Vector, Vector, Vector]:
    """Speed [m/s], rate of the course [rad/s] and tangential acceleration [m/s2], each (n,).

    `target` (n, 6) has position, velocity and acceleration, north and east.
    """
    _, _, x_dot, y_dot, x_ddot, y_ddot = target.T
    speed = np.hypot(x_dot, y_dot)
    # Divided by infinity, a target that stands has a turn rate of 0.
    moving = np.where(speed > STANDING, speed, np.inf)
    # Rounded, so that a circle has one turn rate and `_balance` solves for it once.
    turn = np.round((x_dot * y_ddot - y_dot * x_ddot) / moving**2, 9)
    return np.round(speed, 9), turn, (x_dot * x_ddot + y_dot * y_ddot) / moving


def _loads(scenario: Scenario, time: Vector, target: Vector, turn: Vector) -> Vector:
    """The disturbance (n, 3) [N, N, N m] on a hull at the target's position and velocity.

    `target` is (n, 6) as in `_motion`, `turn` (n,) the rate of its course [rad/s].
    """
    sea, vessel = scenario.sea, scenario.vessel
    course = np.arctan2(target[:, 3] + 0.0, target[:, 2] + 0.0)  # -0.0 is no half turn
    speed = np.hypot(target[:, 2], target[:, 3])
    states = np.column_stack([target[:, :2], course, speed, 0.0 * speed, turn])
    return sea.loads(vessel, time.tolist(), states)


def _balance(
    scenario: Scenario, b_v: float, b_r: float
) -> Callable[[float, float], tuple[float, float]]:
    """A function from speed U and turn rate r to steady surge and sway; NaN where none exist.

    `b_v` [N] and `b_r` [N m] are the mean loads.
    """
    k, share = bundle(scenario.vessel.constants()), sway_share(scenario)

    @cache  # a line and a circle have one speed and one turn rate each
    def steady(U: float, r: float) -> tuple[float, float]:
        """Surge and sway [m/s] at speed over ground U [m/s] and turn rate r [rad/s]."""

        def excess(v: float) -> float:
            """Sway force [N] left over at sway v [m/s]; 0 in steady motion."""
            u = math.sqrt(max(U * U - v * v, 0.0))
            _, across, turning = lacking(u, v, r, k)
            moment = yaw_moment(u, v, r, k) + turning + b_r
            return sway_force(u, v, r, k) + across + b_v - share * moment

        v = root(excess, -U, U)
        return math.sqrt(max(U * U - v * v, 0.0)), v

    return steady


def sway_share(scenario: Scenario) -> float:
    """Sway force that comes with a yaw moment of 1 N m from the actuator, at small demands."""
    matrix: Any = scenario.actuator.input_matrix()
    return float(matrix[1, 1] / matrix[2, 1]) if matrix[2, 1] else 0.0


def root(function: Callable[[float], float], low: float, high: float) -> float:
    """The zero of a function that falls from `low` to `high`; NaN where it has none."""
    if not function(low) >= 0.0 >= function(high):
        return math.nan
    # More than enough for the 53 bits of a float's mantissa, in m/s.
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if function(middle) >= 0.0 else (low, middle)
    return 0.5 * (low + high)


def drift(scenario: Scenario, b_v: float) -> float:
    """Sway velocity [m/s] at which damping balances the load b_v [N]; infinite without damping."""
    k = bundle(scenario.vessel.constants())
    v = root(lambda v: sway_force(0.0, v, 0.0, k) + b_v, -FASTEST, FASTEST)
    return math.copysign(math.inf, b_v) if math.isnan(v) else v
