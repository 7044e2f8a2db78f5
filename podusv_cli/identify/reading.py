"""Logs of a boat as tables of named quantities in SI units."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import Vector
from podusv_cli.core.signal import STATE, Signal
from podusv_cli.storage.log_reader import read_log

Marks = npt.NDArray[np.bool_]
Whole = npt.NDArray[np.int64]
TIME = "time"
STATE_NAMES = {signal.name for signal in STATE}
MEASURED = "_m"  # ends the name of what a sensor of podusv measured
SELDOM = 0.05  # of a sensor's values, that may come at another time than the others
# Of units that logs have, what one of them is in podusv's own units.
UNITS: dict[str, dict[str, float]] = {
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
    "m": {"m": 1.0, "mm": 1e-3, "cm": 0.01, "km": 1e3, "ft": 0.3048, "nmi": 1852.0},
    "rad": {"rad": 1.0, "deg": math.pi / 180.0},
    "m/s": {"m/s": 1.0, "cm/s": 0.01, "km/h": 1.0 / 3.6, "kn": 1852.0 / 3600.0},
    "rad/s": {"rad/s": 1.0, "deg/s": math.pi / 180.0},
    "N": {"N": 1.0, "kN": 1e3, "kgf": 9.80665},
    "N m": {"N m": 1.0, "kN m": 1e3},
    "1/s": {"1/s": 1.0, "rpm": 1.0 / 60.0, "rad/s": 0.5 / math.pi},
    "1": {"1": 1.0, "%": 0.01},
}


class LogFault(UsageError):
    """A log cannot be used as it is; the message says where, why, and what may help."""


@dataclass(frozen=True)
class Table:
    """A log: times [s], and of every quantity a value at each time, NaN where there is none."""

    name: str
    times: Vector
    columns: Mapping[str, Vector]

    def part(self, begin: float, end: float) -> Table:
        """What lies between two times. Raises LogFault where that is nothing."""
        inside = (self.times >= begin) & (self.times <= end)
        if not inside.any():
            raise LogFault(
                f"{self.name}: nothing lies between {begin:g} and {end:g} s; the log goes from "
                f"{self.times[0]:g} to {self.times[-1]:g} s"
            )
        columns = {name: column[inside] for name, column in self.columns.items()}
        return Table(self.name, self.times[inside], columns)


def _csv(path: Path) -> dict[str, Vector]:
    """The columns of a CSV file, whose first line names them; NaN for what is no number."""
    import pandas as pd  # slow to import

    try:
        frame = pd.read_csv(path, sep=None, engine="python", comment="#", skipinitialspace=True)
    except (OSError, ValueError) as error:
        raise LogFault(f"{path}: cannot be read as CSV with a line of names: {error}") from error
    frame.columns = [" ".join(str(name).split()) for name in frame.columns]
    numbers = frame.apply(pd.to_numeric, errors="coerce").dropna(how="all")
    return {str(name): numbers[name].to_numpy(float) for name in numbers}


def _own(path: Path) -> dict[str, Vector]:
    """The signals of podusv's own log; where sensors are logged, of the state what these saw."""
    recording = read_log(path)
    columns: dict[str, Vector] = {}
    for name, values in recording.signals.items():
        if values.ndim == 1:
            columns[name] = np.array(values)
        elif values.ndim == 2:
            columns |= {f"{name}_{i}": column for i, column in enumerate(values.T, 1)}
    measured = {name for name in columns if f"{name}{MEASURED}" in columns}
    if not measured:
        return columns
    rest = {name: column for name, column in columns.items() if name not in STATE_NAMES}
    return rest | {name: columns[f"{name}{MEASURED}"] for name in measured}


READERS: dict[str, Callable[[Path], dict[str, Vector]]] = {".csv": _csv, ".h5": _own}


def columns_of(path: Path) -> dict[str, Vector]:
    """All columns of a log by the names that the log gives them. Raises LogFault, StorageError."""
    read = READERS.get(path.suffix.lower())
    if not read:
        raise LogFault(f"{path}: a log is a file with one of these endings: {', '.join(READERS)}")
    if not path.is_file():
        raise LogFault(f"{path}: there is no such file")
    return read(path)


def table(
    path: Path, wanted: Sequence[Signal], named: Mapping[str, str], *, name: str = ""
) -> Table:
    """The quantities `wanted` of a log that has them, and its times, in podusv's units.

    `named` says what the log calls them, with a unit in brackets where that is another. Raises
    LogFault where there is no time, or a column that is named is not there.
    """
    columns = columns_of(path)
    taken: dict[str, Vector] = {}
    for signal in (Signal(TIME, "s", "time"), *wanted):
        place = named.get(signal.name)
        found = _found(columns, place or signal.name, path, asked=place is not None)
        if found:
            column, unit = found
            taken[signal.name] = columns[column] * _factor(signal, unit, path)
    if TIME not in taken:
        raise LogFault(
            f"{path}: no column is called time; name the one that has it, as in columns: "
            f"{{time: {next(iter(columns), 't')}}} (columns: {_listed(columns)})"
        )
    return _sound(Table(name or path.name, taken.pop(TIME), taken), path)


def _found(
    columns: Mapping[str, Vector], wanted: str, path: Path, *, asked: bool
) -> tuple[str, str] | None:  # fmt: skip
    """The column that is called so, and its unit; None where there is none and none was asked."""
    name, unit = _parted(wanted)
    for column in columns:
        own, own_unit = _parted(column)
        if column == wanted or own == name:
            return column, unit or own_unit
    if not asked:
        return None
    near = difflib.get_close_matches(name, columns, 1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    raise LogFault(f"{path}: no column is called {name!r}{hint} (columns: {_listed(columns)})")


def _parted(name: str) -> tuple[str, str]:
    """Name and unit of "heading [deg]"; without brackets the unit is empty."""
    match = re.fullmatch(r"(.*?) *\[(.*)\]", name)
    return (match[1], match[2]) if match else (name, "")


def _factor(signal: Signal, unit: str, path: Path) -> float:
    known = UNITS.get(signal.unit, {signal.unit: 1.0})
    if unit and unit not in known:
        raise LogFault(f"{path}: {signal.name} is given in {unit!r}; allowed: {', '.join(known)}")
    return known[unit] if unit else 1.0


def _sound(log: Table, path: Path) -> Table:
    """The log, if its clock can be used. Raises LogFault."""
    if len(log.times) < 2:
        raise LogFault(f"{path}: has {len(log.times)} rows with numbers; a log needs many")
    if not np.all(np.isfinite(log.times)):
        row = int(np.flatnonzero(~np.isfinite(log.times))[0]) + 1
        raise LogFault(f"{path}: row {row} has no time; leave the row out")
    steps = np.diff(log.times)
    if np.any(steps <= 0.0):
        row = int(np.flatnonzero(steps <= 0.0)[0]) + 2
        what = "the same time as" if steps[row - 2] == 0.0 else "an earlier time than"
        raise LogFault(
            f"{path}: row {row} has {what} the row before ({log.times[row - 1]:g} s); leave out "
            "rows that are there twice, or split the log where its clock was set, as two logs "
            "with a span each"
        )
    return log


def _listed(columns: Mapping[str, Vector]) -> str:
    names = list(columns)
    more = f" and {len(names) - 30} more" if len(names) > 30 else ""
    return ", ".join(names[:30]) + more


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
