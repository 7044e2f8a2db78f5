"""Writing log.h5, chunk by chunk, so that of the file nothing is in memory."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial

import h5py
import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import Signal
from podusv_cli.storage import log_layout
from podusv_cli.storage.packing import LEVEL, packed
from podusv_cli.storage.stream import Stream

# The newest format that HDF5 1.8 reads (so does any MATLAB); it has checksums on what it describes.
_FORMAT = ("v108", "v108")
# The checksum of every chunk (Fletcher) makes damage to the data an error, too. These filters are
# what readers undo; `packing` does them faster than HDF5.
_FILTERS = {"compression": "gzip", "compression_opts": LEVEL, "shuffle": True, "fletcher32": True}


class Log:
    """Signals on their way into a log file, written in order by a thread of its own."""

    def __init__(self, file: h5py.File, stream: Stream, thread: Executor) -> None:
        """`thread` is an executor with one worker; only that touches the file."""
        self._file, self._stream, self._thread = file, stream, thread
        self._about: dict[str, Signal] = {}
        self._scales: dict[str, h5py.Dataset] = {}
        self._under_way: list[Future[None]] = []

    def add(self, arrays: Mapping[str, Vector], about: Mapping[str, Signal]) -> None:
        """Have more arrays written, which stay as they are; `time` with the first ones.

        `about` says what each of them is.
        """
        self._about |= about
        steps = [partial(self._make_axes, arrays)]
        steps += [partial(self._write, n, arrays[n]) for n in sorted(arrays, key="time".__ne__)]
        self._under_way += map(self._thread.submit, steps)

    def done(self) -> None:
        """Wait until all is written.

        KeyError for an array without a signal, ValueError for one whose shape does not fit its axes
        or what is there already, OSError for what the stream ran into.
        """
        while self._under_way:
            self._under_way.pop(0).result()

    def _make_axes(self, arrays: Mapping[str, Vector]) -> None:
        for axis, size in self._new_axes(arrays).items():
            if axis != "time":
                self._scales[axis] = _scale(self._file, axis, size)

    def _write(self, name: str, array: Vector) -> None:
        dataset = _write(self._file, self._about[name], array, self._stream)
        if name == "time":
            dataset.make_scale(name)
            self._scales[name] = dataset
            return
        for position, axis in enumerate(self._about[name].dimensions):
            dataset.dims[position].attach_scale(self._scales[axis])

    def _new_axes(self, arrays: Mapping[str, Vector]) -> dict[str, int]:
        """How long every axis is that has no scale yet, in the order in which they come up."""
        lengths = {axis: len(scale) for axis, scale in self._scales.items()}
        for name, array in arrays.items():
            for axis, size in zip(self._about[name].dimensions, array.shape, strict=True):
                if lengths.setdefault(axis, size) != size:
                    raise ValueError(f"{name}: {size} values along {axis}, not {lengths[axis]}")
        return {axis: size for axis, size in lengths.items() if axis not in self._scales}


@contextmanager
def opened(
    stream: Stream, recording: Recording,
    *, resolved_yaml: str, title: str, source: str, version: str,
) -> Iterator[Log]:  # fmt: skip
    """The log file of a recording, for arrays to be added to; the same ones give the same bytes.

    `resolved_yaml` is the scenario with every value explicit, `source` where the vessel's data come
    from, `version` podusv's. The end of the block raises what `Log.done` does.
    """
    facts = {
        "Conventions": log_layout.CONVENTIONS,
        "title": title,
        "source": source,
        "podusv_version": version,
        "status": recording.status,
        "controller": recording.controller,
    }
    if recording.message:
        facts["message"] = recording.message
    with h5py.File(stream, "w", libver=_FORMAT, track_order=True, track_times=False) as file:
        file.attrs.create("podusv_format", np.int32(log_layout.FORMAT))
        _describe(file, facts)
        with ThreadPoolExecutor(1) as thread:
            log = Log(file, stream, thread)
            try:
                yield log
                log.done()
            except BaseException:  # nobody waits for the rest of a log that will not be
                thread.shutdown(cancel_futures=True)
                raise
        _write_provenance(file, resolved_yaml)
    stream.check()


def _text(words: str) -> np.ndarray[tuple[()], np.dtype[np.bytes_]]:
    # Of fixed length: variable-length strings make readers of damaged files hang.
    content = words.encode("utf-8", "backslashreplace")
    return np.array(content, dtype=h5py.string_dtype("utf-8", max(1, len(content))))


def _describe(thing: h5py.HLObject, facts: Mapping[str, str]) -> None:
    for name, words in facts.items():
        thing.attrs.create(name, _text(words))


def _scale(file: h5py.File, axis: str, size: int) -> h5py.Dataset:
    scale = file.create_dataset(axis, data=np.arange(size, dtype=np.int32))
    scale.make_scale(axis)
    _describe(scale, {"units": "1", "long_name": log_layout.meaning_of_axis(axis)})
    return scale


def _write(file: h5py.File, signal: Signal, array: Vector, stream: Stream) -> h5py.Dataset:
    # HDF5 has no chunks, hence no filters, for an array without any value.
    packing = {"chunks": log_layout.chunk(array.shape), **_FILTERS} if array.size else {}
    dataset = file.create_dataset(signal.name, array.shape, dtype="<f8", **packing)
    for first in range(0, len(array), dataset.chunks[0]) if array.size else ():
        _write_chunk(dataset, array, first)
        stream.check()
    _describe(dataset, log_layout.description(signal))
    return dataset


def _write_chunk(dataset: h5py.Dataset, array: Vector, first: int) -> None:
    chunk = np.zeros(dataset.chunks)  # the last one is a whole one, too
    rows = array[first : first + len(chunk)]
    chunk[: len(rows)] = rows
    dataset.id.write_direct_chunk((first, *[0] * (array.ndim - 1)), packed(chunk))


def _write_provenance(file: h5py.File, resolved_yaml: str) -> None:
    group = file.create_group(log_layout.PROVENANCE, track_order=True, track_times=False)
    text = _text(resolved_yaml)
    dataset = group.create_dataset(log_layout.RESOLVED, data=text)
    # A single value has no chunk and so no checksum of HDF5's own.
    _describe(dataset, {"sha256": hashlib.sha256(text.tobytes()).hexdigest()})
