"""Files that boats log into, as columns of numbers by name.

A column has its own times where it comes in messages: "topic.field" those in "topic.time" [s].
"""

from __future__ import annotations

import dataclasses
import importlib
import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import Vector
from podusv_cli.core.signal import STATE
from podusv_cli.storage.log_reader import read_log

Columns = Mapping[str, Vector]

TIME = "time"
STATE_NAMES = {signal.name for signal in STATE}
MEASURED = "_m"  # ends the name of what a sensor of podusv measured
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
SEPARATORS, SAMPLE = ",;\t", 20  # and lines of a file that tell which of them it has
LONGEST = 16  # numbers of an array in a message; longer ones are pictures and clouds
OTHER_CLOCK = 3600.0  # s between a stamp and its arrival, from which on a simulation's clock set it


class LogFault(UsageError):
    """Logs cannot be used as they are; a sentence each says where, why, and what may help."""

    def __str__(self) -> str:
        """The sentences below each other."""
        return "\n".join(self.lines())

    def lines(self) -> list[str]:
        """A line a sentence."""
        return [str(sentence) for sentence in self.args]


def columns_of(path: Path) -> Columns:
    """All columns of a log by the names that the log gives them. Raises LogFault, StorageError."""
    read = READERS.get(path.suffix.lower())
    if not path.exists():
        raise LogFault(f"{path}: there is no such file")
    if not read:
        raise LogFault(
            f"{path}: a log is a file with one of these endings: {', '.join(filter(None, READERS))}"
            ", or the folder of a ROS 2 bag"
        )
    return read(path)


def _csv(path: Path) -> Columns:
    """The columns of a CSV file, whose first line names them; NaN for what is no number.

    Separated by commas, semicolons, tabs or blanks; unless by commas, these may be decimal ones.
    Dates, as 2026-05-04T10:00:00Z, become seconds since 1970.
    """
    import pandas as pd  # slow to import

    try:
        with path.open(encoding="utf-8-sig") as file:
            lines = [line for _, line in zip(range(SAMPLE), file, strict=False)]
        head, *body = [line for line in lines if line.strip() and not line.startswith("#")]
        sep = max(SEPARATORS, key=head.count)
        decimal = "," if sep != "," and "," in "".join(body) else "."
        frame = pd.read_csv(
            path, sep=sep if sep in head else r"\s+", decimal=decimal, comment="#",
            skipinitialspace=True, encoding="utf-8-sig", low_memory=False,
        )  # fmt: skip
    except (OSError, ValueError) as error:
        raise LogFault(f"{path}: cannot be read as CSV with a line of names: {error}") from error
    frame.columns = [" ".join(str(name).split()) for name in frame.columns]
    numbers = frame.apply(pd.to_numeric, errors="coerce")
    for name in numbers.columns[numbers.isna().all()]:
        dates = pd.to_datetime(frame[name], errors="coerce", format="ISO8601", utc=True)
        numbers[name] = (dates - EPOCH) / pd.Timedelta(1, "s")
    numbers = numbers.dropna(how="all")
    return {str(name): numbers[name].to_numpy(float) for name in numbers}


def _own(path: Path) -> Columns:
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


def _ros(path: Path) -> Columns:
    """Every topic of a ROS 2 bag: "topic.field.field"; of a quaternion also its `yaw` [rad].

    Times are those of the header where a message has one, and otherwise those of its arrival.
    """
    reader, typesys = _library("rosbags.highlevel", path), _library("rosbags.typesys", path)
    store = typesys.get_typestore(typesys.Stores.LATEST)
    topics = _Messages()
    with _readable(path), reader.AnyReader([path], default_typestore=store) as bag:
        for connection, arrival, raw in bag.messages():
            message = bag.deserialize(raw, connection.msgtype)
            since = (arrival - bag.start_time) * 1e-9
            if stamp := getattr(getattr(message, "header", None), "stamp", None):
                nanoseconds = int(stamp.sec) * 10**9 + int(stamp.nanosec)
                stamped = (nanoseconds - bag.start_time) * 1e-9
                since = stamped if abs(stamped - since) < OTHER_CLOCK else since
            topics.add(connection.topic.strip("/"), since, dict(_numbers(message, "")))
    return topics.columns()


def _numbers(content: Any, name: str) -> Iterator[tuple[str, float]]:
    """The numbers in a message, by field; names begin with a dot."""
    if dataclasses.is_dataclass(content):
        parts = {f.name: getattr(content, f.name) for f in dataclasses.fields(content)}
        if {"x", "y", "z", "w"} == {n for n in parts if not n.startswith("_")}:
            yield f"{name}.yaw", float(_yaw(parts["w"], parts["x"], parts["y"], parts["z"]))
        for field, part in parts.items():
            if field != "header":
                yield from _numbers(part, f"{name}.{field}")
    elif isinstance(content, Real):
        yield name, float(content)
    elif isinstance(content, list | np.ndarray) and len(content) <= LONGEST:
        for i, part in enumerate(content):
            yield from _numbers(part, f"{name}[{i}]")


def _yaw(w: Any, x: Any, y: Any, z: Any) -> Any:
    """The angle about z of a quaternion, or of several: of turns about z, y, x in this order."""
    return np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _ulog(path: Path) -> Columns:
    """Every message of a PX4 log: "message.field"; of attitudes q also their `yaw` [rad]."""
    pyulog = _library("pyulog", path)
    with _readable(path):
        log = pyulog.ULog(str(path))
    columns: dict[str, Vector] = {}
    for data in log.data_list:
        own = data.name + (f"_{data.multi_id}" if data.multi_id else "")
        fields = {name: np.asarray(values, float) for name, values in data.data.items()}
        columns[f"{own}.{TIME}"] = (fields.pop("timestamp") - log.start_timestamp) * 1e-6
        if "q[3]" in fields:
            fields["q.yaw"] = np.array(
                [_yaw(*q) for q in zip(*[fields[f"q[{i}]"] for i in range(4)], strict=True)]
            )
        columns |= {f"{own}.{name}": values for name, values in fields.items()}
    return columns


def _dataflash(path: Path) -> Columns:
    """Every message of an ArduPilot log: "MESSAGE.Field", a second sensor's "MESSAGE_1.Field"."""
    library = _library("pymavlink.DFReader", path)
    with _readable(path):
        log = library.DFReader_binary(str(path), zero_time_base=True)
    messages, first = _Messages(), math.nan
    while (message := log.recv_msg()) is not None:
        content = message.to_dict()
        clock = content.pop("TimeUS", None)
        if clock is None:
            continue
        first = clock if math.isnan(first) else first
        which = content.get(message.fmt.instance_field, 0)
        name = message.get_type() + (f"_{which}" if which else "")
        numbers = {f".{n}": float(x) for n, x in content.items() if isinstance(x, Real)}
        messages.add(name, (clock - first) * 1e-6, numbers)
    return messages.columns()


class _Messages:
    """Messages by topic, as they come in."""

    def __init__(self) -> None:
        self.times: dict[str, list[float]] = defaultdict(list)
        self.contents: dict[str, list[Mapping[str, float]]] = defaultdict(list)

    def add(self, topic: str, time: float, numbers: Mapping[str, float]) -> None:
        self.times[topic].append(time)
        self.contents[topic].append(numbers)

    def columns(self) -> Columns:
        """A column for each field of each topic; NaN where a message lacks it."""
        columns: dict[str, Vector] = {}
        for topic, contents in self.contents.items():
            columns[f"{topic}.{TIME}"] = np.array(self.times[topic])
            for field in dict.fromkeys(name for numbers in contents for name in numbers):
                values = [numbers.get(field, math.nan) for numbers in contents]
                columns[topic + field] = np.array(values)
        return columns


def _library(name: str, path: Path) -> Any:
    """A library that reads a format. Raises UsageError where it is not installed."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise UsageError(
            f"{path}: reading it needs {name.partition('.')[0]}: pip install 'podusv[logs]'"
        ) from error


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """What a library raises on a damaged file becomes a sentence."""
    try:
        yield
    except Exception as error:
        raise LogFault(f"{path}: cannot be read: {error}") from error


READERS: dict[str, Callable[[Path], Columns]] = {
    ".csv": _csv, ".h5": _own, ".db3": _ros, ".mcap": _ros, ".bag": _ros, "": _ros, ".ulg": _ulog,
    ".bin": _dataflash,
}  # fmt: skip
