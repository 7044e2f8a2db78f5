"""Speed and direction of wind or water over time, as someone measured or forecast them."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np

from podusv_cli.core.interpolation import linear, segment
from podusv_cli.core.kernel import Vector, kernel, tail
from podusv_cli.core.timed_rows import timed_rows

LAYOUTS = {3: ("t [s]", "speed [m/s]", "direction [rad]")}
NOUN = "the record"
ROUND = 2.0 * math.pi * (1.0 + 1e-9)  # rad; what turns further was written in degrees
NO_FILE = "file is missing; name a CSV file with columns t, speed, direction"
OPPOSITE = math.radians(179.0)  # rad; a larger turn may be either way round


@lru_cache(maxsize=4)  # one record is read a dozen times in a run
def read_flow(text: str, most: float) -> Vector:
    """The rows t [s], speed [m/s], direction [rad] of a text (rows, 3), the direction continuous.

    From row to row the direction turns the shorter way. `most` is the largest speed [m/s] that can
    be meant. Raises ValueError, which does not repeat the text.
    """
    rows = timed_rows(text, NOUN, LAYOUTS)
    fastest, widest = np.abs(rows[:, 1:]).max(axis=0)
    if fastest > most:
        raise ValueError(
            f"{NOUN} has a speed of {fastest:g} m/s, more than {most:g} m/s; leave rows out that "
            "stand for none, or write the unit in the header: t, speed [kn], direction [deg]"
        )
    if widest > ROUND:
        raise ValueError(
            f"{NOUN} has a direction of {widest:g} rad, more than once round; for degrees write "
            "t, speed, direction [deg] as header"
        )
    rows[:, 2] = np.unwrap(rows[:, 2])
    _check_turns(rows)
    # The cache hands the same rows to every run
    rows.flags.writeable = False
    return rows


def _check_turns(rows: Vector) -> None:
    """Raises ValueError where a direction turns to the opposite, and so either way round.

    `rows` (rows, 3) are t [s], speed [m/s] and the continuous direction [rad].
    """
    turns = np.abs(np.diff(rows[:, 2]))
    turned = np.flatnonzero(turns > OPPOSITE)
    if turned.size:
        i = int(turned[0])
        raise ValueError(
            f"{NOUN} turns by {math.degrees(turns[i]):.4g} deg from t = {rows[i, 0]:g} s to "
            f"{rows[i + 1, 0]:g} s, which may be either way round; put a row between, or for a "
            "flow that reverses keep the direction and write a speed below 0"
        )


def flow_table(rows: Vector) -> Vector:
    """The table (3 rows,) of rows (rows, 3): the times [s], then speed and direction row by row."""
    return np.concatenate([rows[:, 0], rows[:, 1:].ravel()])


# t [s]; `count` rows in a table as `flow_table` has it. Returns m/s and rad. `s` is the share of
# the piece between row i and the next; cut at 0 and 1 it holds the first and the last row.
@kernel
def flow_between_rows(t: float, count: int, table: Vector) -> tuple[float, float]:
    """Speed and direction on straight lines between rows; beyond them the nearest row's."""
    i = min(segment(t, count, table), count - 2)
    s = min(max((t - table[i]) / (table[i + 1] - table[i]), 0.0), 1.0)
    here: Any = tail(table, count + 2 * i)
    return linear(s, here[0], here[2]), linear(s, here[1], here[3])
