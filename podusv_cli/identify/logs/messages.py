"""Logs of messages that come by topic: ROS bags, PX4's ULog, ArduPilot's logs, NMEA.

A column has its own times: "topic.field" those in "topic.time" [s]. The libraries that read these
formats meet damage wherever they iterate; whatever they raise there becomes a sentence.
"""

from __future__ import annotations

import dataclasses
import importlib
import math
import os
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import replace
from functools import wraps
from numbers import Real
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile
from typing import IO, Any

import numpy as np

from podusv_cli.core.errors import UsageError
from podusv_cli.core.escaping import visible
from podusv_cli.core.kernel import Vector
from podusv_cli.identify.logs.bag_repair import bag_files, has_journal, repair_bag
from podusv_cli.identify.logs.contents import Contents, LogFault
from podusv_cli.identify.logs.nmea import contents_of_sentences
from podusv_cli.identify.logs.topics import TIME, TopicMessages

LONGEST = 16  # numbers of an array in a message; longer ones are pictures and clouds
OTHER_CLOCK = 3600.0  # s between a stamp and its arrival, from which on a simulation's clock set it
CLOCKS = {"TimeUS": 1e-6, "TimeMS": 1e-3}  # of DataFlash, new and old, to s
ULOG_HEAD = 16  # bytes
STAMP = 8  # bytes of the arrival before each message of a ground station's log
BOOTED = "T"  # beside TimeMS, where this is the time of the GPS week: ms since the start
Reader = Callable[[Path], Contents]


def _fence_reader(read: Reader) -> Reader:
    """The reader; what a library raises on a damaged file is a LogFault, what it prints a warning.

    A LogFault, too, where no message has numbers.
    """

    @wraps(read)
    def read_fenced(path: Path) -> Contents:
        """Read; what the library prints is said once, what it raises is a fault of the file."""
        with TemporaryFile("w+", errors="replace") as printed:
            try:
                with _printed_into(printed):
                    contents = read(path)
            except UsageError:
                raise
            except Exception as error:
                what = visible(f"{type(error).__name__}: {error}")
                raise LogFault(f"{path}: cannot be read: it is damaged ({what})") from error
            printed.seek(0)
            lines = [line for line in printed.read().splitlines() if line.strip()]
        if not contents.columns:
            raise LogFault(f"{path}: holds no messages with numbers and times")
        if lines:
            more = f", and {len(lines) - 1} more of this" if len(lines) > 1 else ""
            damage = f"it is damaged, and what is whole was read: {visible(lines[0])}{more}"
            return replace(contents, warnings=(*contents.warnings, damage))
        return contents

    return read_fenced


@contextmanager
def _printed_into(file: IO[str]) -> Iterator[None]:
    """What is printed in the block goes into a file, also by libraries in C."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [(end, os.dup(end)) for end in (1, 2)]
    try:
        for end, _ in kept:
            os.dup2(file.fileno(), end)
        with redirect_stdout(file), redirect_stderr(file):
            yield
    finally:
        file.flush()
        for end, own in kept:
            os.dup2(own, end)
            os.close(own)


@_fence_reader
def read_ros(path: Path) -> Contents:
    """Every topic of a ROS bag: "topic.field.field"; of a quaternion also its `yaw` [rad].

    Times are those of the header where a message has one, and otherwise those of its arrival. Of a
    bag that was not closed, or was cut, what is whole is read.
    """
    files = bag_files(path)
    if not files:
        raise LogFault(f"{path}: the folder has no .mcap, .db3 or .bag file, so it is no bag")
    whole = path.is_file() or (path / "metadata.yaml").exists()
    if any(map(has_journal, files)):
        return _read_repaired(files)
    try:
        return _read_bags([path] if whole else files)
    except UsageError:
        raise
    except Exception:
        return _read_repaired(files)


def _read_repaired(files: list[Path]) -> Contents:
    """What is whole in the files of a bag that cannot be read as they are, with a warning."""
    with TemporaryDirectory() as folder:
        copies = [repair_bag(file, Path(folder)) for file in files]
        contents = _read_bags([copy.path for copy in copies])
    if unread := visible(", ".join(name for copy in copies for name in copy.unread)):
        said = f"left out, of types whose definition cannot be read: {unread}"
        contents = replace(contents, warnings=(said, *contents.warnings))
    return contents if all(copy.closed for copy in copies) else _with_extent(contents)


def _with_extent(contents: Contents) -> Contents:
    """The contents of a file that is cut, with a warning that says how much was read."""
    times = [times for name, times in contents.columns.items() if name.endswith(f".{TIME}")]
    count, end = sum(map(len, times)), max((float(t[-1]) for t in times if len(t)), default=0.0)
    read = f"what is whole was read: {count} messages, up to {end:.1f} s"
    said = f"it was not closed or is cut; {read}"
    return replace(contents, warnings=(said, *contents.warnings))


def _read_bags(paths: list[Path]) -> Contents:
    """The messages in files or folders of one bag; those of types that it does not say are told."""
    reader, typesys = _library("rosbags.highlevel", paths[0]), _library("rosbags.typesys", paths[0])
    store = typesys.get_typestore(typesys.Stores.LATEST)
    topics, unknown, damaged = TopicMessages(), dict[str, str](), Counter[str]()
    with reader.AnyReader(paths, default_typestore=store) as bag:
        for connection, arrival, raw in bag.messages():
            if connection.topic in unknown:
                continue
            try:
                message = bag.deserialize(raw, connection.msgtype)
            except KeyError:
                unknown[connection.topic] = connection.msgtype
                continue
            except reader.AnyReaderError:
                damaged[f"{connection.topic} ({connection.msgtype})"] += 1
                continue
            since = (arrival - bag.start_time) * 1e-9
            if stamp := getattr(getattr(message, "header", None), "stamp", None):
                nanoseconds = int(stamp.sec) * 10**9 + int(stamp.nanosec)
                stamped = (nanoseconds - bag.start_time) * 1e-9
                since = stamped if abs(stamped - since) < OTHER_CLOCK else since
            topics.add(connection.topic.strip("/"), since, dict(_numbers(message, "")))
    named = visible(", ".join(f"{topic} ({kind})" for topic, kind in unknown.items()))
    said = {f"left out, of types that the bag does not define: {named}": bool(unknown)}
    counts = visible(", ".join(f"{count} of {topic}" for topic, count in damaged.items()))
    said |= {f"left out, damaged or of another version of their type: {counts}": bool(damaged)}
    return Contents(topics.columns(), warnings=tuple(text for text, is_so in said.items() if is_so))


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


@_fence_reader
def read_ulog(path: Path) -> Contents:
    """Every message of a PX4 log: "message.field"; of attitudes q also their `yaw` [rad]."""
    pyulog = _library("pyulog", path)
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
    damage = "some of its messages are damaged; their values may be wrong"
    contents = Contents(columns, warnings=(damage,) if log.file_corruption else ())
    return _with_extent(contents) if _ends_within_message(path.read_bytes()) else contents


def _ends_within_message(content: bytes) -> bool:
    """Whether a ULog, whose messages each begin with their length, ends before one does."""
    at = ULOG_HEAD
    while at + 2 <= len(content):
        at += 3 + int.from_bytes(content[at : at + 2], "little")
    return at != len(content)


@_fence_reader
def read_dataflash(path: Path) -> Contents:
    """Every message of an ArduPilot log: "MESSAGE.Field", a second sensor's "MESSAGE_1.Field"."""
    library = _library("pymavlink.DFReader", path)
    log = library.DFReader_binary(str(path), zero_time_base=True)
    messages, first = TopicMessages(), math.nan
    while (message := log.recv_msg()) is not None:
        content = message.to_dict()
        if "TimeMS" in content and BOOTED in content:
            content["TimeMS"] = content.pop(BOOTED)
        clocks = (content.pop(name) * unit for name, unit in CLOCKS.items() if name in content)
        clock = next(clocks, None)
        if clock is None:
            continue
        first = clock if math.isnan(first) else first
        which = content.get(message.fmt.instance_field, 0)
        name = message.get_type() + (f"_{which}" if which else "")
        numbers = {f".{n}": float(x) for n, x in content.items() if isinstance(x, Real)}
        messages.add(name, clock - first, numbers)
    contents = Contents(messages.columns())
    return _with_extent(contents) if log.offset < log.data_len else contents


@_fence_reader
def read_telemetry(path: Path) -> Contents:
    """Every MAVLink message of a ground station's log (.tlog): "MESSAGE.field", by its arrival."""
    library = _library("pymavlink.mavutil", path)
    # Not `mavlink_connection`: it runs a file in a folder `bin`, and takes names for sockets.
    log = library.mavmmaplog(str(path))
    messages, first, systems, lost = TopicMessages(), math.nan, list[int](), 0
    unread = path.stat().st_size
    while (message := log.recv_match()) is not None:
        unread -= STAMP + len(message.get_msgbuf())
        kind, arrival = message.get_type(), float(getattr(message, "_timestamp", math.nan))
        # Of what pymavlink does not know it checks nothing, not even whose it is.
        if kind == "BAD_DATA" or kind.startswith("UNKNOWN") or not math.isfinite(arrival):
            lost += 1
            continue
        first = arrival if math.isnan(first) else first
        content = message.to_dict().items()
        numbers = {f".{n}": float(x) for n, x in content if isinstance(x, Real)}
        system = int(message.get_srcSystem())
        if system not in systems:
            systems.append(system)
        which = systems.index(system)  # of several vehicles the first has no number
        messages.add(f"{kind}_{which + 1}" if which else kind, arrival - first, numbers)
    said = f"left out, damaged or of no known type: {lost} messages"
    contents = Contents(messages.columns(), warnings=(said,) if lost else ())
    return _with_extent(contents) if unread > 0 and not lost else contents


@_fence_reader
def read_nmea(path: Path) -> Contents:
    """NMEA 0183 sentences, a line each: see `nmea`."""
    parse = _library("pynmea2", path).parse
    return contents_of_sentences(path.read_text("ascii", "replace"), parse)


def _library(name: str, path: Path) -> Any:
    """A library that reads a format. Raises UsageError where it is not installed."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise UsageError(
            f"{path}: reading it needs {name.partition('.')[0]}: pip install 'podusv[logs]'"
        ) from error
