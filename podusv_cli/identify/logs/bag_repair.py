"""ROS bags that a recorder did not close, or that were cut: copies of what is whole in them.

A copy is written by the library that reads bags; here are only the ways through a file without its
index. Formats: ROS bag 2.0 (wiki.ros.org/Bags/Format/2.0), MCAP (mcap.dev/spec), SQLite.
"""

from __future__ import annotations

import mmap
import shutil
import sqlite3
import struct
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

from podusv_cli.core.escaping import visible
from podusv_cli.identify.logs.contents import LogFault

MCAP, ROS1 = b"\x89MCAP0\r\n", b"#ROSBAG V2.0\n"  # what a file begins with
SCHEMA, CHANNEL, MESSAGE, CHUNK = range(3, 7)  # kinds of MCAP's records
ENDS = (0x0F, 0x02)  # those behind the data
DATA, BLOCK, CONNECTION = 2, 5, 7  # kinds of a ROS 1 bag's records
TABLES = ("schema", "metadata", "topics", "message_definitions", "messages")  # of a ROS 2 bag
JOURNAL = "-wal"  # ends the name of what SQLite has not yet written into the file itself
BAGS = (".mcap", ".db3", ".bag")


class Topic(NamedTuple):
    """What a bag says of a topic: its name, type, the type's definition, its form and digest."""

    name: str
    kind: str
    definition: str
    form: str
    digest: str


class BagMessage(NamedTuple):
    """A message with its topic and its arrival [ns]."""

    topic: Topic
    arrival: int
    raw: bytes


class Repaired(NamedTuple):
    """A copy of a bag, whether the bag itself was closed, and topics whose types cannot be read."""

    path: Path
    closed: bool = False
    unread: tuple[str, ...] = ()


def bag_files(path: Path) -> list[Path]:
    """The files of a bag: itself, or those in its folder."""
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    return [file for file in files if file.suffix in BAGS] if path.is_dir() else files


def has_journal(path: Path) -> bool:
    """Whether a recorder died before it wrote all into the file, and left the rest beside it."""
    journal = path.with_name(path.name + JOURNAL)
    return journal.exists() and journal.stat().st_size > 0


def repair_bag(path: Path, folder: Path) -> Repaired:
    """A copy of a bag in a folder. Raises LogFault where nothing of it is whole."""
    with path.open("rb") as file:
        begin = file.read(len(ROS1))
        if not begin:
            raise LogFault(f"{path}: is empty")
        if not begin.startswith((MCAP, ROS1)):
            return Repaired(_copy_rows(path, folder / f"{path.stem}.db3"))
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            if begin.startswith(MCAP):
                closed = content[-len(MCAP) :] == MCAP
                return _copy_mcap(WholeMcap(content), folder / path.stem)._replace(closed=closed)
            return Repaired(_copy_ros1(WholeRos1(content), folder / f"{path.stem}.bag"))


def _copy_mcap(messages: WholeMcap, folder: Path) -> Repaired:
    """A ROS 2 bag of these messages, but for those of types whose definition cannot be read."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import get_types_from_msg
    from rosbags.typesys.base import TypesysError

    unread = dict[Topic, None]()

    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        own: dict[Topic, Any] = {}
        for topic, arrival, raw in messages:
            if topic in unread:
                continue
            if topic not in own:
                try:
                    if topic.form == "ros2msg":
                        get_types_from_msg(topic.definition, topic.kind)
                except TypesysError:
                    unread[topic] = None
                    continue
                own[topic] = writer.add_connection(
                    topic.name, topic.kind, msgdef=topic.definition, rihs01=topic.digest
                )
            writer.write(own[topic], arrival, raw)
    names = tuple(f"{topic.name} ({topic.kind})" for topic in unread)
    return Repaired(folder / f"{folder.name}.mcap", unread=names)


def _copy_ros1(messages: WholeRos1, path: Path) -> Path:
    """A ROS 1 bag of these messages."""
    from rosbags.rosbag1 import Writer

    with Writer(path) as writer:
        own: dict[Topic, Any] = {}
        for topic, arrival, raw in messages:
            if topic not in own:
                own[topic] = writer.add_connection(
                    topic.name, topic.kind, msgdef=topic.definition, md5sum=topic.digest
                )
            writer.write(own[topic], arrival, raw)
    return path


class WholeMcap:
    """The whole messages of an MCAP file in their order."""

    def __init__(self, content: mmap.mmap) -> None:
        """Of a file's content."""
        self.content = content
        self.schemas: dict[int, tuple[str, str, str]] = {}
        self.channels: dict[int, Topic] = {}

    def __iter__(self) -> Iterator[BagMessage]:
        """Read from the beginning."""
        return self._messages(self.content, len(MCAP))

    def _messages(self, content: bytes | mmap.mmap, at: int) -> Iterator[BagMessage]:
        while at + 9 <= len(content) and content[at] not in ENDS:
            kind, size = struct.unpack_from("<BQ", content, at)
            body = content[at + 9 : at + 9 + size]
            if kind == CHUNK:
                yield from self._in_chunk(body, size)
            elif len(body) < size:
                break
            elif kind == MESSAGE:
                channel, _, arrival = struct.unpack_from("<HIQ", body)
                yield BagMessage(self.channels[channel], arrival, body[22:])
            elif kind in (SCHEMA, CHANNEL):
                self._note(kind, body)
            at += 9 + size

    def _in_chunk(self, body: bytes, size: int) -> Iterator[BagMessage]:
        """The messages of a chunk; of one that is cut where it is not compressed."""
        from rosbags.rosbag2.storage_mcap import DECOMPRESSORS

        _, _, unpacked, _, named = struct.unpack_from("<QQQII", body)
        way, packed = body[32 : 32 + named].decode(), body[40 + named :]
        if len(body) == size or not way:
            yield from self._messages(DECOMPRESSORS[way](packed, unpacked), 0)

    def _note(self, kind: int, body: bytes) -> None:
        """Keep what a record says of a type or of a topic."""
        number, second = struct.unpack_from("<HH", body)
        if kind == SCHEMA:
            name, form, definition = _texts(body, 2, 3)
            self.schemas[number] = name, definition, form
        else:
            (topic,) = _texts(body, 4, 1)
            self.channels[number] = Topic(topic, *self.schemas.get(second, ("", "", "")), "none")


def _texts(body: bytes, at: int, count: int) -> list[str]:
    """Texts behind each other, each behind its length."""
    texts = []
    for _ in range(count):
        (size,) = struct.unpack_from("<I", body, at)
        texts.append(body[at + 4 : at + 4 + size].decode("utf-8", "replace"))
        at += 4 + size
    return texts


class WholeRos1:
    """The whole messages of a ROS 1 bag in their order."""

    def __init__(self, content: mmap.mmap) -> None:
        """Of a file's content."""
        self.content = content
        self.topics: dict[bytes, Topic] = {}

    def __iter__(self) -> Iterator[BagMessage]:
        """Read from the beginning."""
        return self._messages(self.content, len(ROS1))

    def _messages(self, content: bytes | mmap.mmap, at: int) -> Iterator[BagMessage]:
        from rosbags.rosbag1.reader import Compression, decompressors

        for fields, data, whole in _records(content, at):
            kind = fields.get("op", b"\0")[0]
            way = fields.get("compression", b"").decode()
            if kind == BLOCK and (whole or way == Compression.NONE.value):
                yield from self._messages(decompressors[way](data), 0)
            elif kind == CONNECTION and whole:
                self.topics[fields["conn"]] = _topic(fields, data)
            elif kind == DATA and whole:
                second, nano = struct.unpack("<II", fields["time"])
                yield BagMessage(self.topics[fields["conn"]], second * 10**9 + nano, data)


def _topic(fields: dict[str, bytes], data: bytes) -> Topic:
    """What the record of a connection says of its topic; ROS 2 writes `msg` into types."""
    own = dict(_fields(data))
    room, _, name = own["type"].decode().partition("/")
    kind = f"{room}/msg/{name}" if "/" not in name else f"{room}/{name}"
    text, digest = (own[n].decode("utf-8", "replace") for n in ("message_definition", "md5sum"))
    return Topic(fields["topic"].decode(), kind, text, "ros1msg", digest)


def _records(content: bytes | mmap.mmap, at: int) -> Iterator[tuple[dict[str, bytes], bytes, bool]]:
    """Header and data of the records of a ROS 1 bag from a place on; whether the data is whole."""
    whole = True
    while whole and at + 4 <= len(content):
        parts = []
        for _ in range(2):
            size = int.from_bytes(content[at : at + 4], "little")
            parts.append(content[at + 4 : at + 4 + size])
            at += 4 + size
            whole = at <= len(content)
        if at - size <= len(content):
            yield dict(_fields(parts[0])), parts[1], whole


def _fields(header: bytes) -> Iterator[tuple[str, bytes]]:
    """Names and values in a record's header."""
    at = 0
    while at + 4 <= len(header):
        size = int.from_bytes(header[at : at + 4], "little")
        name, _, value = header[at + 4 : at + 4 + size].partition(b"=")
        yield name.decode("ascii", "replace"), value
        at += 4 + size


def _copy_rows(path: Path, copy: Path) -> Path:
    """A database with the rows that can be read, also those in the journal of a recorder that died.

    Raises LogFault where it has no tables.
    """
    broken = copy.with_suffix(".broken")
    for ending in ("", JOURNAL):
        if (part := path.with_name(path.name + ending)).exists():
            shutil.copyfile(part, broken.with_name(broken.name + ending))
    with closing(sqlite3.connect(broken)) as old, closing(sqlite3.connect(copy)) as new:
        old.execute(
            "PRAGMA writable_schema = ON"
        )  # else SQLite reads nothing of a file that is cut
        try:
            tables = old.execute("SELECT name, sql FROM sqlite_master WHERE type='table'")
            for name, making in tables.fetchall():
                if name in TABLES:
                    new.execute(making)
                    _copy_table(old, new, name)
        except sqlite3.DatabaseError as error:
            what = visible(" ".join(str(error).split()))
            raise LogFault(f"{path}: cannot be read: it is damaged ({what})") from error
        new.commit()
    return copy


def _copy_table(old: sqlite3.Connection, new: sqlite3.Connection, name: str) -> None:
    """Copy rows in their order until one cannot be read; `name` is one of `TABLES`."""
    rows = old.execute(f"SELECT * FROM {name}")
    marks = ", ".join("?" * len(rows.description))
    while True:
        try:
            row = rows.fetchone()
        except sqlite3.DatabaseError:
            return
        if row is None:
            return
        new.execute(f"INSERT OR IGNORE INTO {name} VALUES({marks})", row)
