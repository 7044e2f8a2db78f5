"""Writing log.h5, format 2: every array contiguous, with its description in attributes.

HDF5 never writes to the disk, because a full disk would make it end the process. It lays the file
out in memory, where the arrays take no room, and podusv writes that layout and the arrays.
"""

from __future__ import annotations

import io
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import h5py
import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording, blocks
from podusv_cli.core.signal import Signal
from podusv_cli.storage.files import new_file
from podusv_cli.storage.manifest import FORMAT

CONVENTIONS = "CF-1.11"
PROVENANCE, RESOLVED = "provenance", "resolved_yaml"
# podusv's axes besides time and what they count; each is a dataset of the integers 0, 1, ...
AXES = {
    "node": "network node",
    "input": "network input: u, v, r",
    "window": "part of the run: the whole, its settled end",
    "measured": "measured quantity: x, y, psi, u, v, r",
    "pod": "pod, in the scenario's order",
}
ROWS = 4096  # written of all arrays in turn, since the engine stores a row's numbers side by side
# The newest format that HDF5 1.8 reads, and so does any MATLAB. Every array begins at a multiple of
# 8 bytes, so that it can be used where it lies when the file is mapped into memory.
FILE: dict[str, Any] = {
    "libver": ("v108", "v108"),
    "alignment_threshold": 1,
    "alignment_interval": 8,
}
UNDATED = {"track_order": True, "track_times": False}
_COMPRESSED = {"compression": "gzip", "compression_opts": 4, "shuffle": True}


class Texts(NamedTuple):
    """The texts of a log; `source` is where the vessel's data come from."""

    resolved_yaml: str
    title: str
    source: str
    version: str


def write(path: Path, recording: Recording, texts: Texts, *, compress: bool = False) -> None:
    """Write a recording with its `texts` to a new log file; the same gives the same bytes.

    A compressed log is made in memory. Raises StorageError; a part of the file may then exist.
    """
    layout = LogLayout()
    with h5py.File(layout, "w", **FILE, **UNDATED) as file:
        places = _fill(file, recording, texts, compress)
    with new_file(path, layout.size) as out:
        layout.write_to(out)
        for rows in blocks(max((len(array) for _, array in places), default=0), ROWS):
            for place, array in places:
                _write_rows(out, place, array, rows)


class LogLayout(io.RawIOBase):
    """A sparse file in memory: pages never written take no room and read as zeros."""

    PAGE = 2**12

    def __init__(self) -> None:
        """An empty file."""
        self.size = self._place = 0
        self._pages: dict[int, bytearray] = defaultdict(lambda: bytearray(self.PAGE))

    def write_to(self, out: BinaryIO) -> None:
        """Give the new file `out` this size and content. Raises OSError.

        Pages that nobody wrote stay holes.
        """
        out.truncate(self.size)
        for page, content in sorted(self._pages.items()):
            start = page * self.PAGE
            write_at(out, start, memoryview(content)[: max(0, self.size - start)])

    def write(self, content: Any) -> int:
        """Write the content at the current position, which moves on; its bytes, as HDF5 asks."""
        given = memoryview(content).cast("B")
        for part, room in self._parts(len(given)):
            room[:] = given[part]
        self.size = max(self.size, self._place)
        return len(given)

    def readinto(self, room: Any) -> int:
        """Read from the current position until `room` is full."""
        wanted = memoryview(room).cast("B")
        for part, content in self._parts(len(wanted)):
            wanted[part] = content
        return len(wanted)

    def _parts(self, count: int) -> Iterator[tuple[slice, memoryview]]:
        """The next `count` bytes page by page: a slice of them, and the memory of the page."""
        done = 0
        while done < count:
            page, at = divmod(self._place, self.PAGE)
            size = min(count - done, self.PAGE - at)
            yield slice(done, done + size), memoryview(self._pages[page])[at : at + size]
            done += size
            self._place += size

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Set the position."""
        base = {io.SEEK_SET: 0, io.SEEK_CUR: self._place, io.SEEK_END: self.size}[whence]
        self._place = base + offset
        return self._place

    def tell(self) -> int:
        """The position."""
        return self._place

    def truncate(self, size: int | None = None) -> int:
        """Set the file's length."""
        self.size = self._place if size is None else size
        return self.size


def _fill(
    file: h5py.File, recording: Recording, texts: Texts, compress: bool
) -> list[tuple[int, Vector]]:
    """Create datasets and attributes; returns the arrays yet to be written, with their offsets.

    An offset is the byte of the file at which an array begins; of a log that is to `compress`
    everything is written here.
    """
    file.attrs.create("podusv_format", np.int32(FORMAT))
    describe(file, _facts(recording, texts))
    group = file.create_group(PROVENANCE, **UNDATED)
    group.create_dataset(RESOLVED, data=text(texts.resolved_yaml))
    arrays = {**recording.signals, **recording.fixed}
    names = sorted(arrays, key="time".__ne__)  # the scale of the time axis first
    places = []
    scales = _scales(file, arrays, recording.about)
    for name in names:
        dataset = _dataset(file, name, arrays[name], compress)
        describe(dataset, _description(recording.about[name]))
        if name == "time":
            dataset.make_scale(name)
            scales[name] = dataset
        else:
            for position, axis in enumerate(recording.about[name].dimensions):
                dataset.dims[position].attach_scale(scales[axis])
        if not compress and arrays[name].size:
            places.append((dataset.id.get_offset(), arrays[name]))
    return places


def _facts(recording: Recording, texts: Texts) -> dict[str, str]:
    """The attributes of the whole log by name; a message only of a run that did not finish."""
    facts = {
        "Conventions": CONVENTIONS,
        "title": texts.title,
        "source": texts.source,
        "podusv_version": texts.version,
        "status": recording.status,
        "controller": recording.controller,
    }
    return facts | ({"message": recording.message} if recording.message else {})


def _scales(
    file: h5py.File, arrays: Mapping[str, Vector], about: Mapping[str, Signal]
) -> dict[str, h5py.Dataset]:
    """The dimension scale of every axis but time, by axis, made in the file.

    `arrays` and `about` are by the name of the signal. Raises ValueError if lengths along an axis
    differ.
    """
    lengths: dict[str, int] = {}
    for name, array in arrays.items():
        for axis, size in zip(about[name].dimensions, array.shape, strict=True):
            if lengths.setdefault(axis, size) != size:
                raise ValueError(f"{name}: {size} values along {axis}, not {lengths[axis]}")
    return {axis: _scale(file, axis, size) for axis, size in lengths.items() if axis != "time"}


def _scale(file: h5py.File, axis: str, size: int) -> h5py.Dataset:
    """The dimension scale 0, 1, ..., size - 1 of an axis without values, such as `pod`."""
    scale = file.create_dataset(axis, data=np.arange(size, dtype=np.int32))
    scale.make_scale(axis)
    describe(scale, {"units": "1", "long_name": AXES.get(axis, axis)})
    return scale


def _dataset(file: h5py.File, name: str, array: Vector, compress: bool) -> h5py.Dataset:
    """The dataset `name` of an array; without `compress` empty room that is filled later.

    Its place in the file is fixed at once, so that rows can be written past HDF5; it notes no
    times, so that equal logs have equal bytes.
    """
    if compress and array.size:
        return file.create_dataset(name, data=array, dtype="<f8", **_COMPRESSED)
    made = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    made.set_obj_track_times(False)
    made.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    made.set_fill_time(h5py.h5d.FILL_TIME_NEVER)  # podusv writes the numbers
    space = h5py.h5s.create_simple(array.shape)
    return h5py.Dataset(h5py.h5d.create(file.id, name.encode(), h5py.h5t.IEEE_F64LE, space, made))


def _description(signal: Signal) -> dict[str, str]:
    """The attributes of a signal's dataset."""
    facts = {"units": signal.unit, "long_name": signal.meaning, "symbol": signal.symbol}
    # The same as the dimension scales, for readers that do not follow references.
    facts["axes"] = " ".join(signal.dimensions)
    return facts | ({"wrapped": "modulo 2 pi"} if signal.wrapped else {})


def describe(thing: h5py.HLObject, facts: Mapping[str, str]) -> None:
    """Give an object these attributes, texts."""
    for name, words in facts.items():
        thing.attrs.create(name, text(words))


def text(words: str) -> np.ndarray[tuple[()], np.dtype[np.bytes_]]:
    """A text as HDF5 stores it."""
    # Of fixed length: variable-length strings make readers of damaged files hang.
    # Names of files that are no UTF-8 have lone halves of characters, which UTF-8 does not encode.
    content = words.encode("utf-8", "backslashreplace")
    return np.array(content, dtype=h5py.string_dtype("utf-8", max(1, len(content))))


def _write_rows(out: BinaryIO, place: int, array: Vector, rows: slice) -> None:
    """Write these rows of an array into the dataset that begins at byte `place` of the file.

    A shorter array has none of the later rows.
    """
    part = np.ascontiguousarray(array[rows], dtype="<f8")
    if part.size:
        write_at(out, place + rows.start * part[0].nbytes, part.reshape(-1).data.cast("B"))


def write_at(out: BinaryIO, place: int, content: memoryview | bytes) -> None:
    """Write all of `content` at a place [bytes] of an unbuffered file. Raises OSError."""
    out.seek(place)
    while content:
        content = content[out.write(content) :]
