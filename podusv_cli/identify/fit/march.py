"""The extended Kalman filter along a log: every innovation, its variance, and the estimates.

The filter is `components.estimators.ekf`; a log's commands stand in place of a law's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from ctypes import CFUNCTYPE
from typing import Any, NamedTuple

import numpy as np

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.components.estimators.ekf import (
    MOVING,
    ExtendedKalmanFilter,
    N,
    derivative,
    take_in,
)
from podusv_cli.components.vessels.vessel import COEFFICIENTS
from podusv_cli.core.elementary import cos_sin, power
from podusv_cli.core.kernel import LANES, Vector, kernel, scratch, tail, unpacker
from podusv_cli.core.kinematics import wrap
from podusv_cli.engine.machine import signatures
from podusv_cli.engine.machine.signatures import LANE_PROTOTYPES, LANE_VECTOR, PROTOTYPES, WHOLE
from podusv_cli.engine.machine.signatures import VECTOR as ALONE
from podusv_cli.engine.running.lanes import room
from podusv_cli.engine.step.layout import Function, shift_state
from podusv_cli.identify.fit import beside
from podusv_cli.identify.fit.beside import (
    ALL,
    ASKED,
    AXES,
    DEVIATION,
    LASTING,
    PLAIN,
    RATE,
    SIZE,
    SWINGS,
    take_in_beside,
)

STAGES = 4 * SIZE
MOST_COMMANDS = 32  # of a row
# A row of a record: how long it holds [s], what is delivered, its values, then of each command its
# mean over the row as it acts so many times APART [s] later.
HOLDS, DELIVERED, VALUES, COMMANDS = 0, 1, 1 + MOVING, 1 + 2 * MOVING
SHIFTS, APART = (-1.0, 0.0, 1.0), 0.1
TINY = 1e-12  # of full n: no thrust
SIGMAS = ("sigma_p", "sigma_p", "sigma_psi", "sigma_u", "sigma_v", "sigma_r")
CURRENT = ("current_x", "current_y")  # m/s: how fast the water flows north and east
MEAN = ("mean_x", "mean_y", "mean_psi")  # N, N, N m: the load about which gusts swing
SEA = (*CURRENT, *MEAN)  # of a log alone
GUSTS = (RATE, SWINGS)
DELAY = "delay"  # s: how much later than the log says its commands act
THRUST = "thrust"  # what part of the loads that the actuator's numbers give acts on the hull
COMPASS = "compass"  # rad: by how much more than the heading it shows
SENSED = (DEVIATION, LASTING, *ASKED, COMPASS)
# Thrust T of a propeller at n of its full N, over that at N: ((n/N - dead_band)/(1 - dead_band)) to
# the power thrust_exponent, and 0 within the dead band.
DEAD_BAND, EXPONENT = "dead_band", "thrust_exponent"
CURVE = (DEAD_BAND, EXPONENT)
SQUARE = 2.0  # the exponent under which a propeller's thrust is as the actuator's numbers give it
NAMES = (
    *(*COEFFICIENTS, *ExtendedKalmanFilter().constants()),
    *(THRUST, *CURVE, DELAY, *SEA, *GUSTS, *SENSED),
)
named = unpacker(NAMES)


class FilterRecord(NamedTuple):
    """A log as the march takes it: rows as above, and how many values they deliver."""

    rows: Vector
    delivered: int


class Followed(NamedTuple):
    """What the filter says along a record; the last axis is that of the runs.

    `innovations` and `variances` have a row a delivered value, `track` one a row of the record, or
    one alone where no track was asked for: the nine numbers that are estimated, before what the row
    delivers is taken in. Its velocities are those through the water, its place is where a receiver
    sees the boat.
    """

    innovations: Vector
    variances: Vector
    track: Vector


@kernel
def bend_speed(n: float, ahead: float, astern: float, k: Any) -> float:
    """n at which the actuator's own curve has the thrust of n under dead band and exponent.

    Full n, `ahead` or `astern`, stays, and so does rest.
    """
    full = ahead if n >= 0.0 else astern
    moves = full > 0.0 and n != 0.0
    part = (abs(n) / full - k.dead_band) / (1.0 - k.dead_band) if moves else 0.0
    size = full * power(part, 0.5 * k.thrust_exponent) if part > TINY else 0.0
    return size if n >= 0.0 else -size


@kernel
def seen_from_water(i: int, value: float, since: float, psi: float, k: Any, h: Vector) -> float:
    """A measured value as water sees it that flows since so long; its part of h is added.

    A current that is constant leaves the equations of motion as they are (Fossen 2011, 8.3) where
    place and velocity are those in the water's frame, which moves on.
    """
    c, s = cos_sin(psi)
    if i == 0:
        return float(value - since * k.current_x)
    if i == 1:
        return float(value - since * k.current_y)
    along, across = c * k.current_x + s * k.current_y, c * k.current_y - s * k.current_x
    if i == 3:
        h[2] += across
        return float(value - along)
    if i == 4:
        h[2] -= along
        return float(value - across)
    return value


@kernel
def correct_filter(
    begin: int, end: int, line: Vector, since: float, state: Vector, k: Any, out: Vector
) -> int:
    """Take in what a row delivers; write innovation and variance of each value, and count them."""
    sigma, h = scratch(MOVING), scratch(MOVING)
    sigma[0], sigma[1], sigma[2] = k.sigma_p, k.sigma_p, k.sigma_psi
    sigma[3], sigma[4], sigma[5] = k.sigma_u, k.sigma_v, k.sigma_r
    at = 0
    for i in range(MOVING):
        if line[DELIVERED + i] != 0.0:
            late = derivative(i, k.delay_p, state, h)
            value = seen_from_water(i, line[VALUES + i], since, state[2], k, h)
            innovation = value - (state[i] - late)
            if i == 2:
                innovation = wrap(innovation - k.compass)
            if begin == end:
                out[at] = innovation
                out[at + 1] = take_in(i, h, out[at], sigma[i], state)
            else:
                out[at] = innovation - (state[PLAIN + i] if i < AXES else 0.0)
                out[at + 1] = take_in_beside(begin, end, i, h, out[at], sigma[i], state)
            at += 2
    return at


@kernel
def clear(count: int, numbers: Vector) -> None:
    """Numbers that are 0."""
    for i in range(count):
        numbers[i] = 0.0


@kernel
def filter_rows(
    loads: Function,
    follow: Function,
    count: int,
    width: int,
    apart: int,
    begin: int,
    end: int,
    record: Vector,
    full: Vector,
    actuator: Vector,
    table: Vector,
    p: Vector,
    state: Vector,
    out: Vector,
    track: Vector,
) -> None:
    """The filter along the rows of a record: classical RK4 between them, with commands held.

    Rows of the track are so far `apart`; with 0 the last one alone is left. From `begin` to before
    `end` is what is followed beside the filter's own numbers. `full` has the full n of each command
    ahead and astern; 0 ahead for what is not bent.
    """
    k = named(p)
    tau, y, stages, commands = scratch(3), scratch(SIZE), scratch(STAGES), scratch(MOST_COMMANDS)
    at, since, inputs = 0, 0.0, (width - COMMANDS) // 3
    late, size = k.delay / APART, SIZE if begin < end else PLAIN
    clear(STAGES, stages)  # what is not followed has no rate
    for row in range(count):
        line = tail(record, row * width)
        for i in range(N):
            track[apart * row + i] = state[i]
        if begin == 0:  # where a receiver sees the boat
            track[apart * row] += state[PLAIN]
            track[apart * row + 1] += state[PLAIN + 1]
        at += correct_filter(begin, end, line, since, state, k, tail(out, at))
        for i in range(inputs):  # the parabola through the three
            shifts = tail(line, COMMANDS + 3 * i)
            commands[i] = shifts[1] + 0.5 * late * (shifts[2] - shifts[0])
            commands[i] += 0.5 * late * late * (shifts[2] - 2.0 * shifts[1] + shifts[0])
            if full[2 * i] > 0.0:
                commands[i] = bend_speed(commands[i], full[2 * i], full[2 * i + 1], k)
        h = line[HOLDS]
        since += h
        shift_state(size, state, 0.0, state, y)
        for stage in range(4):
            rate = tail(stages, stage * SIZE)
            loads(0.0, y, y, commands, actuator, table, tau, rate, rate)
            for i in range(3):
                tau[i] *= k.thrust
            follow(0.0, y, tau, y, p, table, rate)
            shift_state(size, state, h if stage == 2 else 0.5 * h, rate, y)
        for i in range(size):
            between = stages[SIZE + i] + stages[2 * SIZE + i]
            state[i] += h / 6.0 * (stages[i] + 2.0 * between + stages[3 * SIZE + i])


FILTERED = (PROTOTYPES["actuator"], PROTOTYPES["follow"], *[WHOLE] * 5, *[ALONE] * 8)
FILTERED_LANES = (
    LANE_PROTOTYPES["actuator"],
    LANE_PROTOTYPES["follow"],
    *[WHOLE] * 5,
    *[ALONE] * 2,
    *[LANE_VECTOR] * 6,
)


Follow = Callable[[FilterRecord, Sequence[Vector], Sequence[Vector], bool], Followed]


def pieces(actuator: Actuator) -> list[Any]:
    """The three pieces to compile for the filter along a log of this actuator's commands.

    They are the actuator's loads, the hull's `follow` and the march, `filter_rows`. All lanes have
    one actuator, so its constants are equal in all; of the hull's constants only ASKED are.
    """
    from podusv_cli.engine.machine import compile

    names = tuple(actuator.constants())
    return [
        compile.lane_adapter("actuator", actuator.replay, names, frozenset(names)),
        compile.lane_adapter("follow", beside.follow, NAMES, frozenset(ASKED)),
        compile.Piece(filter_rows, CFUNCTYPE(None, *FILTERED_LANES), "", compile.LANES_BY),
    ]


def side_by_side(actuator: Actuator, *, bent: bool = False) -> Follow:
    """A function that follows a record with several constants and starts, in compiled code.

    `bent`: propellers go by dead band and exponent of the constants.

    Of each run it takes the constants, in the order of `NAMES`, and the filter's state at the
    start; then whether their tracks are wanted. Raises LawError, and TypeError where the actuator's
    kernel cannot go side by side.
    """
    from podusv_cli.engine.machine import compile

    compiled = pieces(actuator)
    compile.prepare(compiled)
    loads, follow, march = map(compile.routine, compiled)
    a = _in_lanes([np.array([*actuator.constants().values(), 0.0])])
    table = _in_lanes([actuator.table()])
    full = np.array(actuator.full_speeds) * float(bent)

    def follow_wide(
        record: FilterRecord, constants: Sequence[Vector], starts: Sequence[Vector], tracked: bool
    ) -> Followed:
        """Follow a record, each run in a lane."""
        count, width = record.rows.shape
        wandering, gusts = (constants[0][NAMES.index(name)] for name in ASKED)
        rows, apart = (count, N) if tracked else (1, 0)
        out, track = room(2 * record.delivered * LANES), room(N * rows * LANES)
        p, state = _in_lanes(constants), _in_lanes(starts)
        march(
            loads,
            follow,
            count,
            width,
            apart,
            0 if wandering else AXES,
            ALL if gusts else AXES,
            signatures.pointer(record.rows),
            signatures.pointer(full),
            *[signatures.pointer(v, LANE_VECTOR) for v in (a, table, p, state, out, track)],
        )
        runs = len(constants)
        pairs = out.reshape(record.delivered, 2, LANES)[..., :runs]
        return Followed(pairs[:, 0], pairs[:, 1], track.reshape(rows, N, LANES)[..., :runs])

    return follow_wide


def _in_lanes(vectors: Sequence[Vector]) -> Vector:
    """One vector of several, a lane each; the lanes that are left repeat the first."""
    together = room(LANES * len(vectors[0]))
    for lane in range(LANES):
        together[lane::LANES] = vectors[lane if lane < len(vectors) else 0]
    return together
