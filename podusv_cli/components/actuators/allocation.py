"""From a demand (tau_u, tau_r), and maybe tau_v, to a thrust and an angle for every pod."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from podusv_cli.components.actuators.allocation_qp import (
    AXES,
    COLUMNS,
    FIXED,
    FORCES,
    HIGH_COS,
    HIGH_SIN,
    LOW_COS,
    LOW_SIN,
    MOST_AHEAD,
    MOST_ASTERN,
    MOST_PODS,
    SECTOR,
    SECTORS,
    STRAIGHT,
    several_pods,
)
from podusv_cli.components.actuators.allocation_single import YAW, one_pod, within
from podusv_cli.components.actuators.propeller import (
    ANGLE,
    DELTA_RATE,
    LIFT,
    MOUNT,
    N_AHEAD,
    N_ASTERN,
    N_RATE,
    WIDTH,
    X,
    Y,
    force,
    on_hull,
    speed_for,
    thrust,
)
from podusv_cli.components.actuators.rudder import part_when_slanted, slant, steer_rudder
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel, scratch, tail
from podusv_cli.core.kinematics import direction

PREFERENCE = 1e4  # how much more the preferred axis counts in the squares
EFFORT = 1e-6  # what the squared parts of full thrust count
MET, MET_OF_ALL = 1e-3, 1e-4  # a demand is met within these parts of itself and of the most


class Reach(NamedTuple):
    """What a pod can do: angles [rad] and thrusts [N] from -most_astern to most_ahead."""

    low: float
    high: float
    most_astern: float
    most_ahead: float


# n [1/s] is the pod's speed, delta [rad] its angle, flow [m/s] its `propeller.inflow`, pod (WIDTH)
# its row of the table, k.horizon [s] the time it has; 0: all that its limits allow.
# Thrust is asked at n_low and n_high, which it takes for most astern and most ahead. So 0 has to
# lie between them: a propeller that cannot stop in time counts as able to.
@kernel
def reach(n: float, delta: float, flow: float, pod: Vector, k: Any) -> Reach:
    """The pod's reach within its limits and, with a horizon, within that time from n and delta."""
    low, high, n_low, n_high = -pod[ANGLE], pod[ANGLE], -pod[N_ASTERN], pod[N_AHEAD]
    if k.horizon > 0.0:
        turn, change = pod[DELTA_RATE] * k.horizon, pod[N_RATE] * k.horizon
        low, high = within(delta - turn, low, high), within(delta + turn, low, high)
        n_low, n_high = within(n - change, n_low, 0.0), within(n + change, 0.0, n_high)
    low, high = slant(low, pod), slant(high, pod)
    ahead, astern = thrust(n_high, flow, pod, k), -thrust(n_low, flow, pod, k)
    return Reach(low, high, max(0.0, astern), max(0.0, ahead))


# Reads state (2 count: speeds [1/s], then angles [rad]), demand (2, or 3 where `k.takes_sway`)
# [N, N m, N], a row of `table` for each pod. Writes thrusts T (count) and angles delta (count);
# True where they make the demand.
@kernel
def allocate(
    state: Vector, demand: Vector, flows: Vector, k: Any, table: Vector, T: Vector, delta: Vector
) -> bool:
    """Thrusts [N] and angles [rad] for the demand; whether they make it.

    `flows` are the pods' `propeller.inflow`.
    """
    if k.closed_form > 0.0:
        at, answer = reach(state[0], state[1], flows[0], table, k), scratch(2)
        Y_wanted = demand[1] / table[X]
        one_pod(
            demand[0], Y_wanted, at.low, at.high, at.most_astern, at.most_ahead, k.priority, answer
        )
        T[0], delta[0] = answer[0], answer[1]
        return meets_demand(
            demand, at.most_ahead, at.most_ahead * abs(table[X]), k, table, T, delta
        )
    return by_least_squares(state, demand, flows, k, table, T, delta)


# Arguments and outputs as those of `allocate`.
# `most` is never 0, as forces are taken in parts of it; k.sway_weight counts in the squares, so its
# root is taken.
@kernel
def by_least_squares(
    state: Vector, demand: Vector, flows: Vector, k: Any, table: Vector, T: Vector, delta: Vector
) -> bool:
    """`allocate` for several pods, see `several_pods`.

    Each axis is in parts of what all pods together could give it, and the demand is cut to that,
    or one axis far out of reach would outweigh the preferred other.
    """
    count = int(k.count)
    sectors, most = scratch(SECTORS), scratch(MOST_PODS)
    low, high = scratch(MOST_PODS), scratch(MOST_PODS)
    all_u, all_r = 0.0, 0.0
    for i in range(count):
        pod = tail(table, i * WIDTH)
        at = reach(state[i], state[count + i], flows[i], pod, k)
        most[i] = max(at.most_ahead, at.most_astern, 1e-12)
        low[i], high[i] = at.low, at.high
        shape(at, pod, most[i], k.takes_sway, tail(sectors, i * SECTOR))
        all_u += most[i]
        all_r += most[i] * math.sqrt(pod[X] * pod[X] + pod[Y] * pod[Y])
    C, tau, g = scratch(COLUMNS), scratch(AXES), scratch(FORCES)
    weight_u = 1.0 if k.priority == YAW else math.sqrt(PREFERENCE)
    weight_r = math.sqrt(PREFERENCE) if k.priority == YAW else 1.0
    weight_v = math.sqrt(k.sway_weight)
    for i in range(count):
        c, pod = tail(C, 2 * AXES * i), tail(table, i * WIDTH)
        c[0], c[1] = weight_u * most[i] / all_u, 0.0
        c[2], c[3] = 0.0, weight_v * most[i] / all_u
        c[4] = -weight_r * pod[Y] * most[i] / all_r
        c[5] = weight_r * pod[X] * most[i] / all_r
        if pod[MOUNT] != 0.0:
            turn_columns(pod[MOUNT], c)
    tau[0] = weight_u * within(demand[0] / all_u, -1.0, 1.0)
    tau[1] = 0.0
    if k.takes_sway > 0.0:
        tau[1] = weight_v * within(demand[2] / all_u, -1.0, 1.0)
    tau[2] = weight_r * within(demand[1] / all_r, -1.0, 1.0)
    several_pods(count, C, tau, sectors, EFFORT, g)
    for i in range(count):
        along, across = most[i] * g[2 * i], most[i] * g[2 * i + 1]
        side = 1.0 if along >= 0.0 else -1.0
        T[i] = side * math.sqrt(along * along + across * across)
        delta[i] = direction(side * along, side * across)
        if T[i] == 0.0:  # any angle does, so the one in reach that is nearest to 0 is taken
            delta[i] = within(0.0, low[i], high[i])
    return meets_demand(demand, all_u, all_r, k, table, T, delta)


# Changes c (6): two numbers an axis, for forces along and across the hull.
@kernel
def turn_columns(mount: float, c: Vector) -> None:
    """Make them those for forces along and across a pod that is mounted at this angle [rad]."""
    cosine, sine = cos_sin(mount)
    for a in range(AXES):
        along, across = c[2 * a], c[2 * a + 1]
        c[2 * a], c[2 * a + 1] = along * cosine + across * sine, across * cosine - along * sine


# `at` is what the pod can reach within a step, `pod` its row of the table. Writes `sector` in the
# order of LOW_COS, ...
@kernel
def shape(at: Reach, pod: Vector, most: float, takes_sway: float, sector: Vector) -> None:
    """The pod's sector, in parts of its `most` thrust.

    A rudder's is what it makes at every angle: its drag is taken off, and astern it is straight.
    Asked for two demands, a rudder has the sector of a pod that turns.
    """
    sector[LOW_COS], sector[LOW_SIN] = cos_sin(at.low)
    sector[HIGH_COS], sector[HIGH_SIN] = cos_sin(at.high)
    sector[MOST_ASTERN], sector[MOST_AHEAD] = at.most_astern / most, at.most_ahead / most
    sector[FIXED] = 1.0 if at.high <= at.low else 0.0
    sector[STRAIGHT] = 0.0
    if takes_sway > 0.0 and pod[LIFT] > 0.0:
        sector[STRAIGHT] = 1.0
        sector[MOST_AHEAD] *= part_when_slanted(pod)


# demand (2, or 3 where `k.takes_sway`) [N, N m, N]; T (count) [N], delta (count) [rad]. `all_u` [N]
# and `all_r` [N m] are what all pods together could give, and set what counts as equal.
@kernel
def meets_demand(
    demand: Vector, all_u: float, all_r: float, k: Any, table: Vector, T: Vector, delta: Vector
) -> bool:
    """Whether these thrusts and angles make the demand."""
    tau_u, tau_v, tau_r = 0.0, 0.0, 0.0
    for i in range(int(k.count)):
        pod = tail(table, i * WIDTH)
        along, across = force(T[i], delta[i])
        along, across = on_hull(along, across, pod)
        tau_u += along
        tau_v += across
        tau_r += pod[X] * across - pod[Y] * along
    met_u = abs(tau_u - demand[0]) <= MET * abs(demand[0]) + MET_OF_ALL * all_u
    met_r = abs(tau_r - demand[1]) <= MET * abs(demand[1]) + MET_OF_ALL * all_r
    met_v = True
    if k.takes_sway > 0.0:
        met_v = abs(tau_v - demand[2]) <= MET * abs(demand[2]) + MET_OF_ALL * all_u
    return bool(met_u and met_v and met_r)


# Reads T (count) [N], flows (count) [m/s] and the angles that `command` has behind its first
# `count` numbers. Writes command (2 count): speeds [1/s], then angles [rad].
@kernel
def settings(count: int, T: Vector, flows: Vector, k: Any, table: Vector, command: Vector) -> bool:
    """Propeller speeds for these thrusts, at the angles in `command`, and angles of rudders.

    False where a rudder does not make what was allotted to it.
    """
    made_all, answer = True, scratch(2)
    for i in range(count):
        pod = tail(table, i * WIDTH)
        if pod[LIFT] > 0.0:
            if not steer_rudder(T[i], command[count + i], flows[i], pod, k, answer):
                made_all = False
            command[i], command[count + i] = answer[0], answer[1]
        else:
            command[i] = within(speed_for(T[i], flows[i], pod, k), -pod[N_ASTERN], pod[N_AHEAD])
    return made_all
