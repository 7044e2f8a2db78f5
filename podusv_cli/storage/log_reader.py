"""Reading log.h5 from anywhere: nothing in the file is believed before it has been checked.

A log could name other files to read from, claim any size, or be damaged. So it is read into memory
first, only known names are looked at, and sizes are added up before the first array is made.
"""

from __future__ import annotations

import hashlib
import io
import math
import unicodedata
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import product, repeat
from pathlib import Path
from typing import get_args

import h5py
import numpy as np

from podusv_cli.core.errors import StorageError
from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording, Status
from podusv_cli.core.signal import NAME, Signal
from podusv_cli.storage import log_layout, trees
from podusv_cli.storage.packing import unpacked
from podusv_cli.storage.regular import ELSEWHERE, LARGEST_FILE, LARGEST_TEXT, read_bytes

LARGEST_CONTENT = LARGEST_FILE  # bytes, unpacked; packed, no log is larger
MOST_MEMBERS = 1000
WORDS = ("units", "long_name", "symbol", "axes", "wrapped")  # attributes of a variable
_FILTERS = [h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_FLETCHER32]
# What h5py raises on damaged files; ValueError includes text that is not UTF-8.
_DAMAGE = (OSError, RuntimeError, ValueError, KeyError, TypeError, MemoryError, OverflowError)


def read_log(path: Path) -> Recording:
    """The recording in a log file; `seen` is not logged and stays None. Raises StorageError."""
    with _opened(path) as (file, image):
        about = _about(file)
        arrays = _arrays(file, about, image, path)
        return Recording(
            status=_status(file),
            controller=_words(file, "controller"),
            signals={k: v for k, v in arrays.items() if not about[k].fixed},
            fixed={k: v for k, v in arrays.items() if about[k].fixed},
            message=_message(file),
            about=about,
        )


def resolved_yaml(path: Path) -> str:
    """The scenario, every value explicit, that a log file was made from. Raises StorageError."""
    with _opened(path) as (file, _):
        _check_hard_link(file.id, log_layout.PROVENANCE)
        group = h5py.h5g.open(file.id, log_layout.PROVENANCE.encode())
        dataset = _dataset(group, log_layout.RESOLVED)
        content = _text(dataset)
        digest = _text(h5py.h5a.open(dataset, b"sha256")).decode()
        if hashlib.sha256(content or b"\0").hexdigest() != digest:
            raise ValueError("the scenario in it does not fit its checksum")
        return content.decode()


@contextmanager
def _opened(path: Path) -> Iterator[tuple[h5py.File, bytes]]:
    """The log in memory, its format checked, and its bytes; faults inside become a StorageError."""
    image = read_bytes(path, LARGEST_FILE, ELSEWHERE)
    try:
        trees.check(image)
        with h5py.File(io.BytesIO(image)) as file:
            _check_format(file)
            yield file, image
    except _DAMAGE as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise StorageError(f"{path}: damaged, or not a log of podusv: {reason}") from error


def _check_format(file: h5py.File) -> None:
    attribute = h5py.h5a.open(file.id, b"podusv_format")
    if attribute.get_type() != h5py.h5t.STD_I32LE or attribute.shape != ():
        raise ValueError("podusv_format is no number")
    found = np.zeros((), dtype="<i4")
    attribute.read(found)
    if found != log_layout.FORMAT:
        raise ValueError(f"written in format {found}; this podusv reads format {log_layout.FORMAT}")


def _status(file: h5py.File) -> Status:
    found = _words(file, "status")
    for status in get_args(Status):
        if found == status:
            return status  # type: ignore[no-any-return]
    raise ValueError(f"unknown status {found!r}")


def _message(file: h5py.File) -> str:
    if not h5py.h5a.exists(file.id, b"message"):
        return ""
    return _words(file, "message")


def _words(file: h5py.File, name: str) -> str:
    words = _text(h5py.h5a.open(file.id, name.encode())).decode()
    if any(unicodedata.category(c) == "Cc" and c not in "\t\n\r" for c in words):
        raise ValueError(f"{name} holds characters that are no text")
    return words


def _text(holder: h5py.h5a.AttrID | h5py.h5d.DatasetID) -> bytes:
    """The single string of fixed length that an attribute or dataset holds."""
    kind = holder.get_type()
    if not isinstance(kind, h5py.h5t.TypeStringID) or kind.is_variable_str() or holder.shape != ():
        raise ValueError("a text in it is no single string of fixed length")
    if kind.get_size() > LARGEST_TEXT:
        raise ValueError(f"a text of {kind.get_size()} bytes in it")
    content = np.zeros((), dtype=f"S{kind.get_size()}")
    if isinstance(holder, h5py.h5d.DatasetID):
        holder.read(h5py.h5s.ALL, h5py.h5s.ALL, content, mtype=kind)
    else:
        holder.read(content, mtype=kind)
    return content.tobytes().rstrip(b"\0")


def _check_hard_link(group: h5py.h5g.GroupID, name: str) -> None:
    if group.links.get_info(name.encode()).type != h5py.h5l.TYPE_HARD:
        raise ValueError(f"{name} is a link to elsewhere")


def _dataset(group: h5py.h5g.GroupID, name: str) -> h5py.h5d.DatasetID:
    """A dataset all of whose data are in this file, behind no filter but the expected ones."""
    _check_hard_link(group, name)
    dataset = h5py.h5d.open(group, name.encode())
    # Asked before anything else: the mere shape of a virtual dataset can open other files.
    made = dataset.get_create_plist()
    if made.get_layout() == h5py.h5d.VIRTUAL or made.get_external_count():
        raise ValueError(f"{name} keeps its data in another file")
    if not set(_filters(made)) <= set(_FILTERS):
        raise ValueError(f"{name} is packed in an unknown way")
    if dataset.shape is None:
        raise ValueError(f"{name} is empty")
    return dataset


def _filters(made: h5py.h5p.PropDCID) -> list[int]:
    return [made.get_filter(i)[0] for i in range(made.get_nfilters())]


def _arrays(
    file: h5py.File, about: Mapping[str, Signal], image: bytes, path: Path
) -> dict[str, Vector]:
    """All signals, in the order in which they were written."""
    datasets = {name: _dataset(file.id, name) for name in about}
    lengths = {"time": math.prod(datasets["time"].shape)}
    for name, dataset in datasets.items():
        _check_numbers(about[name], dataset, lengths)
    total = sum(8 * math.prod(dataset.shape) for dataset in datasets.values())
    if total > LARGEST_CONTENT:
        claim = f"claims {total} bytes of data, at most {LARGEST_CONTENT} allowed"
        raise StorageError(f"cannot read {path}: {claim}{ELSEWHERE}")
    return {name: _unpacked(name, dataset, image) for name, dataset in datasets.items()}


def _about(file: h5py.File) -> dict[str, Signal]:
    """What the file says of each of its variables but the axes'."""
    if len(file) > MOST_MEMBERS:
        raise ValueError(f"it has {len(file)} members, more than {MOST_MEMBERS}")
    unfit = [name for name in file if not (isinstance(name, str) and NAME.fullmatch(name))]
    if unfit:
        raise ValueError(f"{unfit[0]!r} is no signal's name")
    words = {name: _said_of(file, name) for name in file if name != log_layout.PROVENANCE}
    about = {n: log_layout.described(n, said) for n, said in words.items() if "symbol" in said}
    axes = {axis for signal in about.values() for axis in signal.dimensions}
    unknown = [name for name in words if name not in about and name not in axes]
    if unknown:
        raise ValueError(f"{unknown[0]!r} is neither a signal nor an axis of one")
    if "time" not in about:
        raise ValueError("it has no time")
    return about


def _said_of(file: h5py.File, name: str) -> dict[str, str]:
    dataset = _dataset(file.id, name)
    held = [word for word in WORDS if h5py.h5a.exists(dataset, word.encode())]
    return {word: _text(h5py.h5a.open(dataset, word.encode())).decode() for word in held}


def _check_numbers(signal: Signal, dataset: h5py.h5d.DatasetID, lengths: dict[str, int]) -> None:
    """Doubles, as long along every axis as all others; `lengths` learns from the first."""
    name, axes = signal.name, signal.dimensions
    if dataset.get_type() != h5py.h5t.IEEE_F64LE:
        raise ValueError(f"{name} holds no 64-bit numbers")
    if len(dataset.shape) != len(axes):
        raise ValueError(f"{name} has {len(dataset.shape)} dimensions instead of {len(axes)}")
    for axis, size in zip(axes, dataset.shape, strict=True):
        if lengths.setdefault(axis, size) != size:
            raise ValueError(f"{name} has {size} values along {axis} instead of {lengths[axis]}")
        if not size and axis != "time":
            raise ValueError(f"{name} has no values along {axis}")


def _unpacked(name: str, dataset: h5py.h5d.DatasetID, image: bytes) -> Vector:
    """The numbers of a dataset, chunk by chunk, each behind its checksum.

    The index of chunks has no checksum. Where an entry is damaged, HDF5 itself would quietly fill
    in zeros, or end the process for a chunk that is shorter than its own checksum.
    """
    shape, made = dataset.shape, dataset.get_create_plist()
    numbers = np.empty(shape)
    if not numbers.size:
        return numbers
    if _filters(made) != _FILTERS:
        raise ValueError(f"{name} has no checksums")
    part = made.get_chunk()
    # A chunk larger than the array would only cost memory.
    if any(side > size for side, size in zip(part, shape, strict=True)):
        raise ValueError(f"{name} is packed in an unknown way")
    for corner in product(*map(range, repeat(0), shape, part)):
        place = numbers[tuple(slice(at, at + side) for at, side in zip(corner, part, strict=True))]
        try:
            chunk = unpacked(_stored(dataset, corner, image), part)
        except ValueError as error:
            raise ValueError(f"{name} is damaged: {error}") from error
        place[...] = chunk[tuple(map(slice, place.shape))]
    return numbers


def _stored(dataset: h5py.h5d.DatasetID, corner: tuple[int, ...], image: bytes) -> bytes:
    """The bytes of a chunk as they lie in the file."""
    found = dataset.get_chunk_info_by_coord(corner)
    if found.byte_offset is None or found.byte_offset + found.size > len(image):
        raise ValueError("a chunk is missing")
    if found.filter_mask:
        raise ValueError("a chunk is packed in an unknown way")
    return image[found.byte_offset : found.byte_offset + found.size]
