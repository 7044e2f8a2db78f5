"""The sums over the components of `waves`, whose docstring has the equations."""

from __future__ import annotations

import math
from typing import Any

from podusv_cli.components.disturbances.spectra import GROUP, clear_sums
from podusv_cli.core.elementary import cos_sin, cos_sin_of_turns
from podusv_cli.core.kernel import LANES, Vector, kernel, scratch, widest

TURN = 2.0 * math.pi  # rad; phases are in turns, which are cheap to bring into one
# Room for partial sums: of two envelopes, of them and the motion, of four envelopes, of these as
# well.
PAIRS, LONG_ROOM, FACES, SHORT_ROOM = 4 * LANES, 9 * LANES, 8 * LANES, 15 * LANES


# sums (n, LANES): partial sums side by side, so that they fit the registers. They are added in
# pairs, an order that is the same on every machine.
@kernel
def _add_parts(sums: Vector, which: int) -> float:
    """One sum from its eight parts."""
    at = which * LANES
    low = (sums[at] + sums[at + 1]) + (sums[at + 2] + sums[at + 3])
    high = (sums[at + 4] + sums[at + 5]) + (sums[at + 6] + sums[at + 7])
    return float(low + high)


# The envelope's cosine part is sum number `which`, its sine part the one behind it.
@kernel
def _square(sums: Vector, which: int) -> float:
    """Squared magnitude of an envelope."""
    c, s = _add_parts(sums, which), _add_parts(sums, which + 1)
    return c * c + s * s


# Reads x (6) and b[5]; writes b[6] and b[7] [m/s]. The rate (north, east) is in m/s.
@kernel
def _hull_axes(north: float, east: float, x: Vector, b: Vector) -> None:
    """b[6], b[7] = u_w, v_w of the rate (north, east) of the motion, with psi_w in b[5]."""
    c, s = cos_sin(b[5])
    c_psi, s_psi = cos_sin(x[2] + b[5])
    b[6] = (c - 1.0) * x[3] + s * x[4] + c_psi * north + s_psi * east
    b[7] = (c - 1.0) * x[4] - s * x[3] + c_psi * east - s_psi * north


# t [s]; `way` [m] is the place along the waves' direction over 2 pi; table holds `count` numbers
# each of frequency [1/s], phase [turns], wave number [rad/m] and amplitude [m].
@kernel
def _wave(t: float, way: float, i: int, count: int, table: Vector) -> tuple[float, float]:
    """Cosine and sine of a component's phase, times its amplitude; `way` is in turns."""
    number, a = table[2 * count + i], table[3 * count + i]
    c, s = cos_sin_of_turns(table[i] * t + table[count + i] - number * way)
    return a * c, a * s


# Reads x (6). Writes b: drift load (3) [N, N, N m], then the motion's signals and the elevation
# [m]. In a stage only the load is asked for, which saves most of the arithmetic.
@kernel
def long_crested(
    t: float, x: Vector, k: Any, table: Vector, b: Vector, again: float = 0.0, stage: float = 0.0
) -> None:
    """Drift load of waves that all go in one direction; but in a stage, motion and elevation."""
    c_psi, s_psi = cos_sin(x[2])
    c_gamma = c_psi * k.c_beta + s_psi * k.s_beta
    s_gamma = c_psi * k.s_beta - s_psi * k.c_beta
    way = (k.c_beta * x[0] + k.s_beta * x[1]) / TURN
    if stage > 0.0:
        along, across = _long_envelopes(t, way, k, table)
    else:
        along, across = _long_motion(t, x, way, c_gamma, s_gamma, k, table, b)
    b[0] = k.drift_u * c_gamma * abs(c_gamma) * along
    b[1] = k.drift_v * s_gamma * abs(s_gamma) * across
    b[2] = k.drift_arm * b[1]


# c and s are component i's cosine and sine. Changes sums (4, LANES) in lane j: ends, then sides.
@kernel
def _add_reflected(
    j: int, i: int, c: float, s: float, count: int, table: Vector, sums: Vector
) -> None:
    """Add to the envelopes of what bow or stern and what the sides reflect of a component."""
    ends, sides = table[6 * count + i], table[7 * count + i]
    sums[j] += ends * c
    sums[LANES + j] += ends * s
    sums[2 * LANES + j] += sides * c
    sums[3 * LANES + j] += sides * s


# `way` as in `_wave`; table has eight rows as `Waves.table_for` gives them. Returns the squared
# envelope [m2] of what bow and stern reflect, and that of the sides. Components come in groups of
# two registers, so that the compiler makes vector code of the inner loops.
@kernel
def _long_envelopes(t: float, way: float, k: Any, table: Vector) -> tuple[float, float]:
    """Their squared magnitudes. Sums lie in the kernel of their loop, or it gets no vector code."""
    count, sums = int(k.lanes), scratch(PAIRS)
    widest()
    clear_sums(PAIRS, sums)
    for block in range(count // GROUP):
        for j in range(LANES):
            for half in range(2):
                i = block * GROUP + half * LANES + j
                c, s = _wave(t, way, i, count, table)
                _add_reflected(j, i, c, s, count, table, sums)
    return _square(sums, 0), _square(sums, 2)


# (c_gamma, s_gamma) is the waves' direction against the bow. Writes b from 3 on; returns the two
# squared magnitudes [m2]. `part` is 1/(1 + q/2) of the module `waves`, `met` the encounter
# frequency [1/s], `fading` the factor's rate [1/s]. Sums 4 to 8: surge-wise motion, slope, rates of
# both, elevation.
@kernel
def _long_motion(
    t: float,
    x: Vector,
    way: float,
    c_gamma: float,
    s_gamma: float,
    k: Any,
    table: Vector,
    b: Vector,
) -> tuple[float, float]:
    """Put first-order motion, its velocity and the elevation into b; as `_long_envelopes`."""
    count, sums = int(k.lanes), scratch(LONG_ROOM)
    slow = k.long2 * c_gamma * c_gamma + k.wide2 * s_gamma * s_gamma
    both, speed = c_gamma * s_gamma, (c_gamma * x[3] + s_gamma * x[4]) / TURN
    turning = 4.0 * (k.long2 - k.wide2) * both * x[5] / TURN
    widest()
    clear_sums(LONG_ROOM, sums)
    for block in range(count // GROUP):
        for j in range(LANES):
            for half in range(2):
                i = block * GROUP + half * LANES + j
                c, s = _wave(t, way, i, count, table)
                number = table[2 * count + i]
                square = number * number
                part = 1.0 / (1.0 + slow * square)
                c_felt, s_felt = c * part * part, s * part * part
                met, fading = table[i] - number * speed, turning * square * part
                _add_reflected(j, i, c, s, count, table, sums)
                sums[4 * LANES + j] += s_felt
                sums[5 * LANES + j] += c_felt * number
                sums[6 * LANES + j] += c_felt * met - s_felt * fading
                sums[7 * LANES + j] -= (s_felt * met + c_felt * fading) * number
                sums[8 * LANES + j] += c
    moved, rate = k.motion * _add_parts(sums, 4), k.motion * TURN * _add_parts(sums, 6)
    b[3], b[4] = moved * k.c_beta, moved * k.s_beta
    b[5] = -k.motion * c_gamma * s_gamma * _add_parts(sums, 5)
    turned = s_gamma * s_gamma - c_gamma * c_gamma
    _hull_axes(rate * k.c_beta, rate * k.s_beta, x, b)
    b[8] = -k.motion * (both * TURN * _add_parts(sums, 7) + turned * x[5] * _add_parts(sums, 5))
    b[9] = _add_parts(sums, 8)
    return _square(sums, 0), _square(sums, 2)


# Arguments and outputs as those of `long_crested`. In a stage the drift load is enough.
@kernel
def short_crested(
    t: float, x: Vector, k: Any, table: Vector, b: Vector, again: float = 0.0, stage: float = 0.0
) -> None:
    """The same of waves with a direction each.

    Waves from ahead and astern, from port and starboard have envelopes of their own.
    """
    c_psi, s_psi = cos_sin(x[2])
    if stage > 0.0:
        _short_envelopes(t, x, c_psi, s_psi, k, table, b)
    else:
        _short_motion(t, x, c_psi, s_psi, k, table, b)


# c and s are component i's cosine and sine, (c_gamma, s_gamma) the direction in which it goes, seen
# from the bow: `ahead` is a following sea. Changes sums (8, LANES) in lane j. Each side reflects
# what comes against it, in parts of the direction's cosine or sine.
@kernel
def _facing(
    j: int,
    i: int,
    c: float,
    s: float,
    c_gamma: float,
    s_gamma: float,
    count: int,
    table: Vector,
    sums: Vector,
) -> None:
    """Add to the envelopes of what is reflected ahead, astern, to port and to starboard."""
    ends, sides = table[6 * count + i], table[7 * count + i]
    ahead, astern = ends * max(c_gamma, 0.0), ends * max(-c_gamma, 0.0)
    right, left = sides * max(s_gamma, 0.0), sides * max(-s_gamma, 0.0)
    sums[j] += ahead * c
    sums[LANES + j] += ahead * s
    sums[2 * LANES + j] += astern * c
    sums[3 * LANES + j] += astern * s
    sums[4 * LANES + j] += right * c
    sums[5 * LANES + j] += right * s
    sums[6 * LANES + j] += left * c
    sums[7 * LANES + j] += left * s


# The mean drift load b (3) [N, N, N m] from the envelopes: of what goes ahead, which comes from
# astern and pushes ahead, less of what goes astern; likewise to starboard and to port.
@kernel
def _drift(sums: Vector, k: Any, b: Vector) -> None:
    b[0] = k.drift_u * (_square(sums, 0) - _square(sums, 2))
    b[1] = k.drift_v * (_square(sums, 4) - _square(sums, 6))
    b[2] = k.drift_arm * b[1]


# Reads x (6); (c_psi, s_psi) is the heading. Writes b (3) [N, N, N m].
@kernel
def _short_envelopes(
    t: float, x: Vector, c_psi: float, s_psi: float, k: Any, table: Vector, b: Vector
) -> None:
    """The drift load alone."""
    count, sums, north, east = int(k.lanes), scratch(FACES), x[0] / TURN, x[1] / TURN
    widest()
    clear_sums(FACES, sums)
    for block in range(count // GROUP):
        for j in range(LANES):
            for half in range(2):
                i = block * GROUP + half * LANES + j
                c_beta, s_beta = table[4 * count + i], table[5 * count + i]
                c, s = _wave(t, c_beta * north + s_beta * east, i, count, table)
                c_gamma, s_gamma = c_psi * c_beta + s_psi * s_beta, c_psi * s_beta - s_psi * c_beta
                _facing(j, i, c, s, c_gamma, s_gamma, count, table, sums)
    _drift(sums, k, b)


# Reads x (6); (c_psi, s_psi) is the heading. Writes all of b, as `long_crested` does. Every
# component has a direction of its own, so each sum has its factors of direction inside. `met` and
# `fading` are in rad/s; sums 8 to 14: elevation, motion north and east, yaw, and their rates.
@kernel
def _short_motion(
    t: float, x: Vector, c_psi: float, s_psi: float, k: Any, table: Vector, b: Vector
) -> None:
    """The drift load, first-order motion, its velocity and the elevation."""
    count, sums, north, east = int(k.lanes), scratch(SHORT_ROOM), x[0] / TURN, x[1] / TURN
    turning = 4.0 * (k.long2 - k.wide2) * x[5]
    widest()
    clear_sums(SHORT_ROOM, sums)
    for block in range(count // GROUP):
        for j in range(LANES):
            for half in range(2):
                i = block * GROUP + half * LANES + j
                number = table[2 * count + i]
                c_beta, s_beta = table[4 * count + i], table[5 * count + i]
                c, s = _wave(t, c_beta * north + s_beta * east, i, count, table)
                c_gamma, s_gamma = c_psi * c_beta + s_psi * s_beta, c_psi * s_beta - s_psi * c_beta
                _facing(j, i, c, s, c_gamma, s_gamma, count, table, sums)
                slow = k.long2 * c_gamma * c_gamma + k.wide2 * s_gamma * s_gamma
                square, both = number * number, c_gamma * s_gamma
                part = 1.0 / (1.0 + slow * square)
                felt = part * part
                met = TURN * table[i] - number * (c_gamma * x[3] + s_gamma * x[4])
                fading = turning * both * square * part
                rate, fall = (c * met - s * fading) * felt, (s * met + c * fading) * felt
                turned = (s_gamma - c_gamma) * (s_gamma + c_gamma) * x[5] * c * felt
                sums[8 * LANES + j] += c
                sums[9 * LANES + j] += s * felt * c_beta
                sums[10 * LANES + j] += s * felt * s_beta
                sums[11 * LANES + j] += c * felt * number * c_gamma * s_gamma
                sums[12 * LANES + j] += rate * c_beta
                sums[13 * LANES + j] += rate * s_beta
                sums[14 * LANES + j] += (turned - fall * both) * number
    _drift(sums, k, b)
    b[3], b[4] = k.motion * _add_parts(sums, 9), k.motion * _add_parts(sums, 10)
    b[5] = -k.motion * _add_parts(sums, 11)
    _hull_axes(k.motion * _add_parts(sums, 12), k.motion * _add_parts(sums, 13), x, b)
    b[8] = -k.motion * _add_parts(sums, 14)
    b[9] = _add_parts(sums, 8)
