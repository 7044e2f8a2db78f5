"""A log as the filter takes it: rows of what was delivered and commanded, and where it begins."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.components.estimators.ekf import MOVING
from podusv_cli.core.kernel import Vector
from podusv_cli.core.signal import STATE
from podusv_cli.identify.fit.march import (
    APART,
    COMMANDS,
    DELIVERED,
    HOLDS,
    SHIFTS,
    VALUES,
    FilterRecord,
)
from podusv_cli.identify.logs.contents import LogFault
from podusv_cli.identify.logs.reading import SLACK, LogTable, Marks, Whole, delivered_each

BEGIN = 3.0  # s, from which the velocities at the start are guessed
FEWEST = 20  # values of the position, or a log says nothing
POSE = 3  # of the state's numbers, those without which nothing can be followed


@dataclass(frozen=True)
class FilterLog:
    """A log as the filter takes it.

    `times` [s] are those of the record's rows, `state` what is guessed of (x, y, psi, u, v, r) at
    the first, and `counts` how many values of each are delivered; `notes` say how the log was
    understood, `warnings` what is doubtful about it.
    """

    name: str
    times: Vector
    record: FilterRecord
    state: Vector
    counts: Vector
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    def of(self, rows: Vector) -> FilterLog:
        """The same with other rows, from the first on."""
        counts = rows[:, DELIVERED : DELIVERED + MOVING].sum(axis=0)
        record = FilterRecord(np.ascontiguousarray(rows), int(counts.sum()))
        return replace(self, times=self.times[: len(rows)], record=record, counts=counts)

    def until(self, row: int) -> FilterLog:
        """The log before a row."""
        return self.of(self.record.rows[:row])

    @property
    def duration(self) -> float:
        """From the first row to the last [s]."""
        return float(self.times[-1] - self.times[0])


def log_of(table: LogTable, actuator: Actuator, step: float, delay: float = 0.0) -> FilterLog:
    """The log of a table, with its commands acting so much later [s].

    A row stands where something is delivered, and otherwise every `step`; the commands of a row are
    the mean until the next. Raises LogFault where pose or commands are missing.
    """
    complete(table, actuator)
    table = table.finer(step)
    marks, none = delivered_each(table.columns), np.zeros(len(table.times), bool)
    new = np.column_stack([marks.get(signal.name, none) for signal in STATE])
    kept = _rows(table.times, np.any(new, axis=1), step)
    rows = _record(table, actuator, new, kept, delay)
    counts = rows[:, DELIVERED : DELIVERED + MOVING].sum(axis=0)
    record, words = FilterRecord(rows, int(counts.sum())), (table.notes, table.warnings)
    return FilterLog(table.name, table.times[kept], record, _state(table, new), counts, *words)


def complete(table: LogTable, actuator: Actuator) -> None:
    """Raises LogFault where pose or commands are missing."""
    needed = {s.name for s in (*STATE[:POSE], *actuator.replayed)} - {*actuator.zero_where_missing}
    if lacking := sorted(needed - table.columns.keys()):
        raise LogFault(
            f"{table.name}: the log has no column for {', '.join(lacking)}; name the columns that "
            "have them under identify.columns, or choose the actuator whose commands the log has"
        )
    marks = delivered_each(table.columns)
    fewest = min(int(marks[signal.name].sum()) for signal in STATE[:POSE])
    if fewest < FEWEST:
        raise LogFault(
            f"{table.name}: has {fewest} values of the pose, at least "
            f"{FEWEST} are needed; take a longer part of the log"
        )


def _record(table: LogTable, actuator: Actuator, new: Marks, kept: Whole, delay: float) -> Vector:
    """The rows that are kept."""
    commands, times = actuator.replayed, table.times[kept]
    rows = np.zeros((len(kept), COMMANDS + len(SHIFTS) * len(commands)))
    rows[:-1, HOLDS] = np.diff(times)
    for i, signal in enumerate(STATE):
        if signal.name in table.columns:
            marks = np.logical_or.reduceat(new[:, i], kept)
            rows[:, DELIVERED + i] = marks
            rows[:, VALUES + i] = np.where(marks, table.columns[signal.name][kept], 0.0)
    for i, signal in enumerate(commands):
        if signal.name in table.columns:
            for j, shift in enumerate(SHIFTS, COMMANDS + len(SHIFTS) * i):
                at = times - delay - shift * APART
                rows[:, j] = _means(at, table, signal.name, lagging=bool(actuator.lagged))
    return rows


def _rows(times: Vector, new: Marks, step: float) -> Whole:
    """The rows that are kept: those that deliver something, and one every `step` otherwise."""
    kept, last = [0], times[0]
    for i in range(1, len(times)):
        if i == len(times) - 1 or new[i] or times[i + 1] - last > step * (1.0 + SLACK):
            kept.append(i)
            last = times[i]
    return np.array(kept)


def _means(at: Vector, table: LogTable, name: str, *, lagging: bool) -> Vector:
    """The mean of a quantity from each of these times to the next.

    What lags its command goes straight from value to value; all else stays until the next.
    """
    known = np.isfinite(table.columns[name])
    if not known.any():
        return np.zeros(len(at))
    times, values = table.times[known], table.columns[name][known]
    times, values = np.append(min(at[0], times[0]) - 1.0, times), np.append(values[0], values)
    slopes, spans = np.zeros(len(times)), np.diff(times)
    if lagging:
        slopes[:-1] = np.diff(values) / spans
    areas = np.cumsum(spans * (values[:-1] + 0.5 * slopes[:-1] * spans))
    k = np.searchsorted(times, at, "right") - 1
    since = at - times[k]
    whole = np.append(0.0, areas)[k] + since * (values[k] + 0.5 * slopes[k] * since)
    return np.append(np.diff(whole) / np.diff(at), values[k[-1]])


def _state(table: LogTable, new: Marks) -> Vector:
    """Pose and velocities at the start, by straight lines through the first seconds.

    Sway is not guessed: a few seconds of GNSS say less of it than that hulls hardly slip.
    """
    state = np.zeros(MOVING)
    slopes = np.zeros(MOVING)
    for i, signal in enumerate(STATE):
        at = np.flatnonzero(new[:, i])
        if not len(at):
            continue
        early = at[table.times[at] <= table.times[at[0]] + BEGIN]
        values = table.columns[signal.name][early]
        values = np.unwrap(values) if i == 2 else values
        state[i] = values[0]
        if i < POSE and len(early) > 2:
            slopes[i], state[i] = np.polyfit(table.times[early] - table.times[0], values, 1)
    c, s = np.cos(state[2]), np.sin(state[2])
    guessed = (c * slopes[0] + s * slopes[1], 0.0, slopes[2])
    for i, velocity in enumerate(guessed, POSE):
        if not new[:, i].any():
            state[i] = velocity
    return state
