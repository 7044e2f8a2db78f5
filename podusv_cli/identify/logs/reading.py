"""Logs of a boat as tables of named quantities in SI units, north, east, and to starboard."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from podusv_cli.core import units
from podusv_cli.core.kernel import Vector
from podusv_cli.core.signal import Signal
from podusv_cli.core.units import allowed, spelled
from podusv_cli.identify.logs.formats import TIME, Columns, LogFault, columns_of
from podusv_cli.identify.logs.frames import LAT, LON, local_plane, turned

Marks = npt.NDArray[np.bool_]
Whole = npt.NDArray[np.int64]
CLOCK = Signal(TIME, "s", "time")
SELDOM = 0.05  # of a sensor's values, that may come at another time than the others
SLACK = 1e-5  # of a step, to which times of a date are true
LISTED = 30  # columns that a message names
# What logs have beside the units that people write: propellers in rad/s, positions as integers.
OF_LOGS = {
    "1/s": {"rad/s": 0.5 / math.pi},
    "deg": {"deg": 1.0, "rad": 180.0 / math.pi, "1e-7 deg": 1e-7},
}
# Of each of podusv's units, what one of those that logs have is in it.
UNITS: dict[str, dict[str, float]] = {
    unit: {name: float(factor) for name, factor in allowed(unit).items()} | OF_LOGS.get(unit, {})
    for unit in (*units.UNITS, *OF_LOGS)
}


@dataclass(frozen=True)
class Table:
    """A log: times [s], and of every quantity a value at each time, NaN where there is none.

    `notes` says how the log was understood, `warnings` what is doubtful about it.
    """

    name: str
    times: Vector
    columns: Mapping[str, Vector]
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    def part(self, begin: float, end: float) -> Table:
        """What lies from one time on before another. Raises LogFault where that is nothing."""
        inside = (self.times >= begin) & (self.times < end)
        if not inside.any():
            raise LogFault(
                f"{self.name}: nothing lies between {begin:.10g} and {end:.10g} s; the log goes "
                f"from {self.times[0]:.10g} to {self.times[-1]:.10g} s"
            )
        return self.where(inside)

    def finer(self, longest: float) -> Table:
        """With rows between its own, without any value, that are at most so far apart [s]."""
        spans = np.diff(self.times)
        parts = np.maximum(np.ceil(spans / longest - SLACK), 1.0).astype(int)
        first = np.cumsum([0, *parts])
        times = np.empty(first[-1] + 1)
        times[first] = self.times
        between = np.arange(len(times) - 1) - np.repeat(first[:-1], parts)
        times[:-1] = np.repeat(self.times[:-1], parts) + between * np.repeat(spans / parts, parts)
        columns = {name: np.full(len(times), np.nan) for name in self.columns}
        for name, column in columns.items():
            column[first] = self.columns[name]
        return replace(self, times=times, columns=columns)

    def where(self, rows: Marks) -> Table:
        """These rows alone."""
        columns = {name: column[rows] for name, column in self.columns.items()}
        return replace(self, times=self.times[rows], columns=columns)


class Named(NamedTuple):
    """What a log calls quantities, and the frame that it has them in."""

    columns: Mapping[str, str] = {}
    frame: Literal["ned", "enu"] = "ned"


class _Series(NamedTuple):
    """Values of a quantity, and the column that has their times."""

    clock: str
    values: Vector


def table(path: Path, wanted: Sequence[Signal], named: Named, *, name: str = "") -> Table:
    """The quantities `wanted` of a log that has them, at the times of any, in podusv's units.

    Latitude and longitude stand for x and y where the log has no others. Raises LogFault where
    there is no time, or a column that is named is not there, or a clock goes backwards.
    """
    columns, name = columns_of(path), name or path.name
    clock = _found(columns, CLOCK, named, name)
    series: dict[str, _Series] = {}
    for signal in (*wanted, LAT, LON):
        if found := _found(columns, signal, named, name):
            own = clock_of(found.column, columns) or (clock.column if clock else "")
            if not own:
                raise LogFault(
                    f"{name}: no column is called time; name the one that has it, as in columns: "
                    f"{{time: {next(iter(columns), 't')}}} (columns: {listed(columns)})"
                )
            series[signal.name] = _Series(own, columns[found.column] * found.factor)
    if clock:
        columns = {**columns, clock.column: columns[clock.column] * clock.factor}
    whole = _together(name, series, columns)
    # Latitude and longitude are north and east whatever the frame.
    flat, notes = local_plane(turned(whole.columns, named.frame))
    return replace(whole, columns=flat, notes=tuple(f"{name}: {note}." for note in notes))


class _Found(NamedTuple):
    column: str
    factor: float


def _found(columns: Columns, signal: Signal, named: Named, name: str) -> _Found | None:
    """The column that has a quantity, and what its numbers are multiplied by.

    None where there is none and none was named. Raises LogFault.
    """
    place = named.columns.get(signal.name)
    wanted, sign = place or signal.name, 1.0
    if wanted.startswith("-") and wanted not in columns:
        wanted, sign = wanted[1:].strip(), -1.0
    asked, unit = parted(wanted)
    for matches in (lambda column: column == wanted, lambda column: parted(column)[0] == asked):
        for column in filter(matches, columns):
            return _Found(column, sign * _factor(signal, unit or parted(column)[1], name))
    if place is None:
        return None
    near = difflib.get_close_matches(asked, columns, 1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    raise LogFault(f"{name}: no column is called {asked!r}{hint} (columns: {listed(columns)})")


def parted(name: str) -> tuple[str, str]:
    """Name and unit of "heading [deg]" or "heading (deg)"; "q[0]" has no unit."""
    match = re.fullmatch(r"(.*?)(?: +[\[(](.*)[\])]|[\[(]([^\d].*)[\])])", name)
    return (match[1], match[2] or match[3]) if match else (name, "")


def _factor(signal: Signal, unit: str, name: str) -> float:
    known = UNITS.get(signal.unit, {signal.unit: 1.0})
    if unit and spelled(unit) not in known:
        raise LogFault(f"{name}: {signal.name} is given in {unit!r}; allowed: {', '.join(known)}")
    return known[spelled(unit)] if unit else 1.0


def clock_of(column: str, columns: Columns) -> str | None:
    """The column that has the times of a message's field: "topic.time" of "topic.field.x"."""
    parts = column.split(".")
    clocks = (".".join([*parts[:n], TIME]) for n in range(len(parts) - 1, 0, -1))
    return next((clock for clock in clocks if clock in columns), None)


def _together(name: str, series: Mapping[str, _Series], columns: Columns) -> Table:
    """One table of quantities that have clocks of their own."""
    sound: list[Table] = []
    for clock in dict.fromkeys(s.clock for s in series.values()):
        own = {q: s.values for q, s in series.items() if s.clock == clock}
        sound.append(_sound(Table(name, columns[clock], own), clock))
    if not sound:
        raise LogFault(
            f"{name}: it has none of x, y (or lat, lon) and psi, which are needed; write "
            "identify.columns in a scenario beside it, as {x: north, y: east, "
            f"psi: 'heading [deg]'}} (columns: {listed(columns)})"
        )
    times = np.unique(np.concatenate([part.times for part in sound]))
    together = {}
    for part in sound:
        at = np.searchsorted(times, part.times)
        for quantity, values in part.columns.items():
            together[quantity] = np.full(len(times), np.nan)
            together[quantity][at] = values
    return Table(name, times, together, warnings=tuple(w for part in sound for w in part.warnings))


def _sound(log: Table, clock: str) -> Table:
    """The log without rows that have no time or are there twice. Raises LogFault."""
    timed = np.isfinite(log.times)
    warnings = []
    if lost := int(np.sum(~timed)):
        warnings.append(f"{log.name}: {lost} rows without a number under {clock!r} are left out.")
    log = log.where(timed)
    if len(log.times) < 2:
        raise LogFault(f"{log.name}: has {len(log.times)} rows with numbers; a log needs many")
    steps = np.diff(log.times)
    again = np.append(False, steps == 0.0)
    for column in log.columns.values():
        again[1:] &= (np.diff(column) == 0.0) | np.isnan(column[1:])
    if twice := int(again.sum()):
        warnings.append(f"{log.name}: {twice} rows are there twice and are left out.")
    wrong = np.flatnonzero((steps <= 0.0) & ~again[1:])
    if len(wrong):
        row = int(wrong[0])
        what = "the same time as" if steps[row] == 0.0 else "an earlier time than"
        raise LogFault(
            f"{log.name}: row {row + 2} has {what} the row before ({log.times[row]:.10g} s); leave "
            "out what is there twice, or split the log where its clock was set, as two logs with "
            "a span each"
        )
    return replace(log.where(~again), warnings=tuple(warnings))


def listed(columns: Iterable[str]) -> str:
    """The first of the names, and how many more there are."""
    names = list(columns)
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return ", ".join(names[:LISTED]) + more


def delivered(values: Vector) -> Marks:
    """Which values of a column are new ones, true or false.

    A logger that is faster than a sensor repeats its last value: where values change at regular
    distances of several rows, only those that change count. A value that is no number never counts.
    """
    known = np.isfinite(values)
    at = np.flatnonzero(known)
    changes = np.flatnonzero(np.diff(values[at]) != 0.0) + 1
    gaps = np.diff(changes)
    if len(gaps) < 5:
        return known
    usual = float(np.median(gaps))
    off = np.abs(gaps - usual * np.round(gaps / usual))
    if np.mean(gaps == 1) > SELDOM or np.mean(off > 1.0) > SELDOM:
        return known
    new = np.zeros(len(values), bool)
    new[at[changes]] = True
    new[at[0]] = True
    return new
