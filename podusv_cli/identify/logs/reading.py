"""Logs of a boat as tables of named quantities in SI units, north, east, and to starboard."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from podusv_cli.core import units
from podusv_cli.core.earth import PLACE, Plane
from podusv_cli.core.kernel import Vector
from podusv_cli.core.signal import STATE, Signal
from podusv_cli.core.units import Scale, Scales, spell_unit, units_allowed_for
from podusv_cli.identify.logs.contents import Columns, Contents, LogFault, list_names
from podusv_cli.identify.logs.formats import contents_of
from podusv_cli.identify.logs.frames import from_frame, local_plane
from podusv_cli.identify.logs.ranges import (
    PLACES,
    TO_PULSES,
    may_be_minutes,
    on_earth,
    pulses_alone,
    without_none,
)
from podusv_cli.identify.logs.topics import TIME

Marks = npt.NDArray[np.bool_]
Whole = npt.NDArray[np.int64]
CLOCK = Signal(TIME, "s", "time")
SELDOM = 0.05  # of a sensor's values, that may come at another time than the others
SLACK = 1e-5  # of a step, to which times of a date are true
BOOT = 20  # rows at least, between two steps back of a clock and in each, which then began anew
SENSED = {signal.name for signal in (*STATE, *PLACE)}
OPTIONAL = {signal.name for signal in STATE[3:]}  # that may be in a log without any number
# What logs have beside the units that people write: propellers in rad/s, angles as integers.
OF_LOGS = {
    "1/s": {"rad/s": 0.5 / math.pi},
    "rad": {"1e-2 deg": math.pi / 18000.0},
    "deg": {"deg": 1.0, "rad": 180.0 / math.pi, "1e-7 deg": 1e-7, "1e-6 deg": 1e-6},
}
# Of each of podusv's units, what one of those that logs have is in it.
UNITS: dict[str, dict[str, float]] = {
    unit: {name: float(factor) for name, factor in units_allowed_for(unit).items()}
    | OF_LOGS.get(unit, {})
    for unit in (*units.UNITS, *OF_LOGS)
}


@dataclass(frozen=True)
class LogTable:
    """A log: times [s], and of every quantity a value at each time, NaN where there is none.

    `notes` says how the log was understood, `warnings` what is doubtful about it. `from_fix`: x and
    y count from the first fix, since the log has latitude and longitude; `maybe_minutes`: these may
    be degrees and minutes as one number.
    """

    name: str
    times: Vector
    columns: Mapping[str, Vector]
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    from_fix: bool = False
    maybe_minutes: bool = False

    def part(self, begin: float, end: float) -> LogTable:
        """What lies from one time on before another. Raises LogFault where that is nothing."""
        inside = (self.times >= begin) & (self.times < end)
        if not inside.any():
            raise LogFault(
                f"{self.name}: nothing lies between {begin:.10g} and {end:.10g} s; the log goes "
                f"from {self.times[0]:.10g} to {self.times[-1]:.10g} s"
            )
        return self.where(inside)

    def finer(self, longest: float) -> LogTable:
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

    def where(self, rows: Marks) -> LogTable:
        """These rows alone."""
        columns = {name: column[rows] for name, column in self.columns.items()}
        return replace(self, times=self.times[rows], columns=columns)


class NamedQuantities(NamedTuple):
    """What a log calls quantities, the frame that it has them in, and where x = y = 0 is on earth.

    Without a plane x and y of latitudes and longitudes count from the first fix. `scales` are units
    that the boat's actuator has beside those of all.
    """

    columns: Mapping[str, str] = {}
    frame: Literal["ned", "enu"] = "ned"
    plane: Plane | None = None
    scales: Scales = MappingProxyType({})


class _Series(NamedTuple):
    """Values of a quantity, their times [s], and the column that has these."""

    clock: str
    times: Vector
    values: Vector

    def part(self, rows: slice) -> _Series:
        """These rows alone."""
        return _Series(self.clock, self.times[rows], self.values[rows])


def table(
    path: Path, wanted: Sequence[Signal], named: NamedQuantities, *, name: str = ""
) -> LogTable:
    """As `tables`, of a log whose clock begins once. Raises LogFault."""
    first, *others = tables(path, wanted, named, name=name)
    if others:
        ends, begins = first.times[-1], others[0].times[0]
        raise LogFault(
            f"{name or path.name}: its clock steps back after row {len(first.times)} ({ends:.10g} "
            f"s, then {begins:.10g} s), as two boots in one file do; save each part as a file of "
            "its own"
        )
    return first


def tables(
    path: Path, wanted: Sequence[Signal], named: NamedQuantities, *, name: str = ""
) -> list[LogTable]:
    """The quantities `wanted` of a log that has them, at the times of any, in podusv's units.

    A table each time that its clock begins anew. Latitude and longitude stand for x and y where the
    log has no others. Raises LogFault where there is no time, a column that is named is not there,
    or one that is needed has no numbers, and for places that are not on earth.
    """
    contents, name = contents_of(path), name or path.name
    series, words = _series(contents, wanted, named, name)
    boots = _boots(series)
    found = [_together(name, part) for part in boots]
    if len(found) > 1:
        times = [part.times for part in found]
        words.append(
            f"its clock steps back from {times[0][-1]:.10g} to {times[1][0]:.10g} s; it is taken "
            f"as {len(found)} logs, one each time that the clock began"
        )
        found = [replace(part, name=f"{name}, boot {i}") for i, part in enumerate(found, 1)]
    lines = tuple(f"{name}: {word}." for word in (*contents.warnings, *words))
    found[0] = replace(found[0], warnings=(*lines, *found[0].warnings))
    return [_in_frame(part, named) for part in found]


def _in_frame(whole: LogTable, named: NamedQuantities) -> LogTable:
    """The table north, east, to starboard; of latitude and longitude, which are so in any frame."""
    flat, notes = local_plane(from_frame(whole.columns, named.frame), named.plane)
    on_earth_alone = "x" in flat and "x" not in whole.columns
    minutes = on_earth_alone and all(may_be_minutes(whole.columns[place]) for place in PLACES)
    return replace(
        whole,
        columns=flat,
        notes=tuple(f"{whole.name}: {note}." for note in notes),
        from_fix=on_earth_alone and named.plane is None,
        maybe_minutes=minutes,
    )


def _series(
    contents: Contents, wanted: Sequence[Signal], named: NamedQuantities, name: str
) -> tuple[dict[str, _Series], list[str]]:
    """The wanted quantities with their times, and what is doubtful about their cells."""
    columns, words = contents.columns, list[str]()
    clock = _find_column(columns, CLOCK, named, name)
    series: dict[str, _Series] = {}
    used: dict[str, str] = {}
    for signal in (*wanted, *PLACE):
        found = _find_column(columns, signal, named, name)
        if not found or (signal.name in PLACES and {"x", "y"} & series.keys()):
            continue
        own = clock_of(found.column, columns) or (clock.column if clock else "")
        if not own:
            raise LogFault(
                f"{name}: no column is called time; name the one that has it, as in columns: "
                f"{{time: {next(iter(columns), 't')}}} (columns: {list_names(columns)})"
            )
        used |= {signal.name: found.column}
        if clock and own == clock.column:
            used[CLOCK.name] = own
        values, doubt = _plausible(signal, columns[found.column], found.scale, name)
        words += [f"{signal.name} {doubt}"] if doubt else []
        factor = clock.scale.factor if clock and own == clock.column else 1.0
        series[signal.name] = _Series(own, columns[own] * factor, values)
    if not series:
        raise LogFault(
            f"{name}: it has none of x, y (or lat, lon) and psi, which are needed; write "
            "identify.columns in a scenario beside it, as {x: north, y: east, psi: 'heading "
            f"[deg]'}}, or have podusv identify --columns propose them (columns: "
            f"{list_names(columns)})"
        )
    return series, [*_doubts(contents, used, name), *words]


def _plausible(signal: Signal, values: Vector, scale: Scale, name: str) -> tuple[Vector, str]:
    """The values of a column in podusv's unit, and which of them are left out."""
    if scale.zero:
        values, doubt = pulses_alone(values, scale.zero)
        return (values - scale.zero) * scale.factor, doubt
    if signal.name not in SENSED:
        return values * scale.factor, ""
    values, doubt = without_none(values)
    if signal.name not in PLACES:
        return values * scale.factor, doubt
    try:
        places, beyond = on_earth(signal, values * scale.factor)
    except LogFault as fault:
        raise LogFault(f"{name}: {fault}") from fault
    return places, " and ".join(filter(None, (doubt, beyond)))


def _doubts(contents: Contents, used: Mapping[str, str], name: str) -> list[str]:
    """What is doubtful about the cells of the columns that are used.

    Raises LogFault for a column that is needed, where most of them are no numbers.
    """
    words = []
    for quantity, column in used.items():
        doubt, values = contents.doubts.get(column, ""), contents.columns[column]
        what = f"column {column!r}, taken for {quantity}," if column != quantity else column
        known = np.isfinite(values).mean() if len(values) else 1.0
        if quantity not in OPTIONAL and (known == 0.0 or (doubt and known < 0.5)):
            few = "no" if known == 0.0 else "hardly any"
            raise LogFault(f"{name}: {what} has {few} numbers{f'; it {doubt}' if doubt else ''}")
        words += [f"{what} {doubt}; they are left out"] if doubt else []
    return words


def _boots(series: Mapping[str, _Series]) -> list[Mapping[str, _Series]]:
    """The quantities in parts, before and after each time that their clocks begin anew.

    Clocks that do not all begin as often stay whole, and so does a log with a part of a few rows.
    """
    clocks = {own.clock: own.times for own in series.values()}
    parts = {clock: _parts_of_clock(times) for clock, times in clocks.items()}
    finest = parts[max(clocks, key=lambda clock: len(clocks[clock]))]
    if min(part.stop - part.start for part in finest) < BOOT:
        return [series]
    if {len(own) for own in parts.values()} != {len(finest)}:
        return [series]
    return [
        {name: own.part(parts[own.clock][i]) for name, own in series.items()}
        for i in range(len(finest))
    ]


def _parts_of_clock(times: Vector) -> list[slice]:
    """The rows before and after each time that a clock [s] steps back by many of its steps."""
    timed = np.flatnonzero(np.isfinite(times))
    steps = np.diff(times[timed])
    # Two rows that are exchanged, or a clock that is corrected a little, is no new beginning.
    back = timed[1:][steps < -BOOT * np.median(np.abs(steps))] if len(steps) else timed[:0]
    return [slice(a, b) for a, b in pairwise((0, *back.tolist(), len(times)))]


class _Found(NamedTuple):
    column: str
    scale: Scale


def _find_column(
    columns: Columns, signal: Signal, named: NamedQuantities, name: str
) -> _Found | None:
    """The column that has a quantity, and the scale of its numbers.

    None where there is none and none was named. Raises LogFault.
    """
    place = named.columns.get(signal.name)
    wanted, sign = place or signal.name, 1.0
    if wanted.startswith("-") and wanted not in columns:
        wanted, sign = wanted[1:].strip(), -1.0
    asked, unit = split_unit(wanted)
    alike = [column for column in columns if column == wanted]
    alike = alike or [column for column in columns if split_unit(column)[0] == asked]
    if len(alike) > 1:
        raise LogFault(
            f"{name}: {signal.name} may be any of {list_names(alike)}; say which under "
            f"identify.columns, as {signal.name}: {alike[0]!r}"
        )
    if alike:
        unit = unit or split_unit(alike[0])[1]
        zero, factor = _scale(signal, unit, named.scales.get(signal.name, {}), name)
        return _Found(alike[0], Scale(zero, sign * factor))
    if place is None:
        return None
    near = difflib.get_close_matches(asked, columns, 1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    raise LogFault(f"{name}: no column is called {asked!r}{hint} (columns: {list_names(columns)})")


def split_unit(name: str) -> tuple[str, str]:
    """Name and unit of "heading [deg]" or "heading (deg)"; "q[0]" has no unit."""
    match = re.fullmatch(r"(.*?)(?: +[\[(](.*)[\])]|[\[(]([^\d].*)[\])])", name)
    return (match[1], match[2] or match[3]) if match else (name, "")


def _scale(signal: Signal, unit: str, own: Mapping[str, Scale], name: str) -> Scale:
    """That of a unit, "" for podusv's; `own` are those of the boat's actuator. Raises LogFault."""
    factors = UNITS.get(signal.unit, {signal.unit: 1.0})
    known = {there: Scale(0.0, factor) for there, factor in factors.items()} | {**own}
    spelled = spell_unit(unit)
    if unit and spelled not in known:
        pulses = f"; pulses of PWM need {TO_PULSES} in each pod" if spelled == "us" else ""
        raise LogFault(
            f"{name}: {signal.name} is given in {unit!r}; allowed: {', '.join(known)}{pulses}"
        )
    return known[spelled] if unit else Scale(0.0, 1.0)


def clock_of(column: str, columns: Collection[str]) -> str | None:
    """The column that has the times of a message's field: "topic.time" of "topic.field.x"."""
    parts = column.split(".")
    clocks = (".".join([*parts[:n], TIME]) for n in range(len(parts) - 1, 0, -1))
    return next((clock for clock in clocks if clock in columns), None)


def _together(name: str, series: Mapping[str, _Series]) -> LogTable:
    """One table of quantities that have clocks of their own."""
    sound: list[LogTable] = []
    for clock in dict.fromkeys(s.clock for s in series.values()):
        own = {q: s for q, s in series.items() if s.clock == clock}
        times = next(iter(own.values())).times
        sound.append(_sound(LogTable(name, times, {q: s.values for q, s in own.items()}), clock))
    times = np.unique(np.concatenate([part.times for part in sound]))
    together = {}
    for part in sound:
        at = np.searchsorted(times, part.times)
        for quantity, values in part.columns.items():
            together[quantity] = np.full(len(times), np.nan)
            together[quantity][at] = values
    return LogTable(
        name, times, together, warnings=tuple(w for part in sound for w in part.warnings)
    )


def _sound(log: LogTable, clock: str) -> LogTable:
    """The log without rows that have no time, and with one row a time. Raises LogFault."""
    timed = np.isfinite(log.times)
    warnings = []
    if lost := int(np.sum(~timed)):
        warnings.append(f"{log.name}: {lost} rows without a number under {clock!r} are left out.")
    log = log.where(timed)
    if len(log.times) < 2:
        raise LogFault(f"{log.name}: has {len(log.times)} rows with numbers; a log needs many")
    begins = np.flatnonzero(np.diff(log.times, prepend=-np.inf) != 0.0)
    if again := len(log.times) - len(begins):
        warnings.append(
            f"{log.name}: {again} rows have the time of the row before and no other value than it; "
            "they are taken together."
        )
    least, most = (
        {name: pick.reduceat(values, begins) for name, values in log.columns.items()}
        for pick in (np.fmin, np.fmax)
    )
    wrong = np.flatnonzero(np.diff(log.times) < 0.0) + 1
    for name in log.columns:
        wrong = np.append(wrong, begins[least[name] < most[name]] + 1)
    if len(wrong):
        raise LogFault(f"{log.name}: {_of_clock(log.times, int(wrong.min()))}")
    return replace(log, times=log.times[begins], columns=least, warnings=tuple(warnings))


def _of_clock(times: Vector, row: int) -> str:
    """What is wrong with the clock at a row, which is counted from 0."""
    same = times[row] == times[row - 1]
    return (
        f"row {row + 1} has {'the same time as' if same else 'an earlier time than'} the row "
        f"before ({times[row - 1]:.10g} s){' and other values' if same else ''}; leave out what is "
        "there twice, or split the log where its clock was set, as two logs with a span each"
    )


def mark_new_values(*columns: Vector) -> Marks:
    """Which rows of a column have a new value, or of several that come together, as x and y do.

    A logger that is faster than a sensor repeats its last value: where values change at regular
    distances of several rows, only those that change count. What is no number never counts.
    """
    values = np.column_stack(columns)
    known = np.asarray(np.isfinite(values).all(axis=1), bool)
    at = np.flatnonzero(known)
    changes = np.flatnonzero((np.diff(values[at], axis=0) != 0.0).any(axis=1)) + 1
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


def delivered_each(columns: Mapping[str, Vector]) -> dict[str, Marks]:
    """Of every quantity, which rows have a new value. x and y come together: see `mark_new_values`.

    Where one of the two is missing, the other is looked at alone.
    """
    new = {name: mark_new_values(values) for name, values in columns.items()}
    if "x" in new and "y" in new:
        x, y = np.isfinite(columns["x"]), np.isfinite(columns["y"])
        together = mark_new_values(columns["x"], columns["y"])
        new |= {"x": together | (new["x"] & ~y), "y": together | (new["y"] & ~x)}
    return new
