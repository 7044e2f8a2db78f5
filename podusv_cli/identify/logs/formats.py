"""Files that boats log into, by their endings."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.signal import STATE
from podusv_cli.identify.logs.contents import Columns, Contents, LogFault
from podusv_cli.identify.logs.csv_files import read_csv
from podusv_cli.identify.logs.mat_files import read_mat
from podusv_cli.identify.logs.messages import (
    read_dataflash,
    read_nmea,
    read_ros,
    read_telemetry,
    read_ulog,
)
from podusv_cli.identify.logs.nmea import is_nmea
from podusv_cli.storage.log_reader import read_log

STATE_NAMES = {signal.name for signal in STATE}
BEGINNING = 4096  # bytes, in which the first line shows
MEASURED = "_m"  # ends the name of what a sensor of podusv measured


def contents_of(path: Path) -> Contents:
    """All columns of a log by the names that the log gives them. Raises LogFault, StorageError."""
    if not path.exists():
        raise LogFault(f"{path}: there is no such file")
    if not (path.is_file() or path.is_dir()):
        raise LogFault(f"{path}: is a pipe or a device; a log is a file, or the folder of a bag")
    read = read_ros if path.is_dir() else READERS.get(path.suffix.lower())
    if not read:
        raise LogFault(
            f"{path}: a log is a file with one of these endings: {', '.join(filter(None, READERS))}"
            ", or the folder of a ROS 2 bag"
        )
    return read(path)


def columns_of(path: Path) -> Columns:
    """The columns alone. Raises LogFault, StorageError."""
    return contents_of(path).columns


def _own(path: Path) -> Contents:
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
        return Contents(columns)
    rest = {name: column for name, column in columns.items() if name not in STATE_NAMES}
    return Contents(rest | {name: columns[f"{name}{MEASURED}"] for name in measured})


def _text(path: Path) -> Contents:
    """A file of lines: NMEA sentences, or a table."""
    with path.open("rb") as file:
        begin = file.read(BEGINNING)
    return read_nmea(path) if is_nmea(begin.decode("ascii", "replace")) else read_csv(path)


READERS: dict[str, Callable[[Path], Contents]] = {
    ".csv": _text,
    ".txt": _text,
    ".nmea": _text,
    ".log": _text,
    ".h5": _own,
    ".db3": read_ros,
    ".mcap": read_ros,
    ".bag": read_ros,
    ".active": read_ros,
    "": read_ros,
    ".ulg": read_ulog,
    ".bin": read_dataflash,
    ".tlog": read_telemetry,
    ".mat": read_mat,
}
