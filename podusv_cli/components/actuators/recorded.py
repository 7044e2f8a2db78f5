"""Commands over time that an actuator obeys in place of a law's demand, as a log has them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np

from podusv_cli.components.actuators.command import DRIVE, Drive
from podusv_cli.core.interpolation import linear, segment
from podusv_cli.core.kernel import Vector, scratch, specialise, tail, taking
from podusv_cli.core.signal import Signal
from podusv_cli.core.timed_rows import lines_of, timed_rows
from podusv_cli.core.units import Scale

Signals = tuple[Signal, ...]
KnownScales = tuple[tuple[str, str, Scale], ...]  # signal, unit, and its scale
MOST = 32  # commands at one time
NOUN = "the schedule"
TIME = "t [s]"


class Recorded(NamedTuple):
    """Commands as text with commas: times, and what an actuator calls `lagged` or `replayed`."""

    rows: str
    held: bool  # between rows the last one's commands, else straight lines


@lru_cache(maxsize=4)  # asked for table and constants of every run
def rows_of(
    text: str, replayed: Signals, lagged: Signals, zero: Sequence[str], scales: KnownScales = ()
) -> Vector:
    """The rows of a `text` with commas, (rows, 1 + commands): t [s], and each signal `replayed`.

    Columns are called as these, or as the commands `lagged` that they follow. Those that belong to
    signals called in `zero` may all be left out; `scales` are further units of some. Raises
    ValueError.
    """
    header, _ = lines_of(text)
    names = {cell.partition(" [")[0] for cell in header.cells} if header else set()
    signals = lagged if names & {signal.name for signal in lagged} else replayed  # same order
    needed = [s for s, there in zip(signals, replayed, strict=True) if there.name not in zero]
    layouts = {1 + len(some): (TIME, *map(_column, some)) for some in (signals, needed)}
    rows = timed_rows(text, NOUN, layouts, {(name, unit): scale for name, unit, scale in scales})
    given = signals if rows.shape[1] == 1 + len(signals) else needed
    whole = np.zeros((len(rows), 1 + len(signals)))
    whole[:, [0, *(1 + signals.index(signal) for signal in given)]] = rows
    # The cache hands the same rows to every run
    whole.flags.writeable = False
    return whole


def _column(signal: Signal) -> str:
    """What the column of a signal is called in a file, as `n_1 [1/s]`."""
    return f"{signal.name} [{signal.unit}]"


def table_of(rows: Vector) -> Vector:
    """What `obeying` reads behind the actuator's own table: the times [s], then command rows.

    `rows` are (rows, 1 + commands), as `rows_of` gives them.
    """
    return np.concatenate([rows[:, 0], rows[:, 1:].ravel()])


def constants_of(rows: Vector, first: int, *, held: bool) -> dict[str, float]:
    """What `obeying` reads beside the actuator's own constants; `first` is where its table ends.

    `rows` are (rows, 1 + commands); `held` says whether commands are held between rows.
    """
    count, width = len(rows), rows.shape[1] - 1
    return {
        "recorded_first": float(first),
        "recorded_rows": float(count),
        "recorded_width": float(width),
        "recorded_held": float(held),
    }


def _obey(
    t: float,
    x: Vector,
    state: Vector,
    demand: Vector,
    k: Any,
    table: Vector,
    tau: Vector,
    rate: Vector,
    signals: Vector,
) -> None:
    """Stands for an actuator's `obey`."""


# Arguments as those of `Actuator.drive`; the rows begin in `table` where the actuator's own numbers
# end.
def _obeying(
    t: float,
    x: Vector,
    state: Vector,
    demand: Vector,
    k: Any,
    table: Vector,
    tau: Vector,
    rate: Vector,
    signals: Vector,
) -> None:
    """`obey` with the commands of the rows at t; before the first and after the last theirs."""
    count, width = int(k.recorded_rows), int(k.recorded_width)
    times = tail(table, int(k.recorded_first))
    i = min(segment(t, count, times), count - 2)
    s = min(max((t - times[i]) / (times[i + 1] - times[i]), 0.0), 1.0)
    if k.recorded_held > 0.0:
        s = math.floor(s)
    before, after = tail(times, count + width * i), tail(times, count + width * (i + 1))
    given = scratch(MOST)
    for j in range(width):
        given[j] = linear(s, before[j], after[j])
    _obey(t, x, state, given, k, table, tau, rate, signals)


@cache
def obeying(obey: Callable[..., None]) -> Drive:
    """A kernel that has `obey` do what the rows say; the same one for the same kernel."""
    inner = taking(obey, DRIVE)
    made: Drive = specialise(_obeying, f"{obey.__qualname__}_recorded", _obey=inner)
    return made
