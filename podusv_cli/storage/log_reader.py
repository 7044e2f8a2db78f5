"""Reading log.h5, formats 1 and 2, without trusting the file.

A log may be damaged, refer to other files, or claim any size. So the sizes are added up before the
first array is made, and everything that podusv does not write is refused. The manifest's digest
says whether a log is unchanged.
"""

from __future__ import annotations

import math
import unicodedata
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path
from typing import NamedTuple, get_args

import h5py
import numpy as np
import numpy.typing as npt

from podusv_cli.core.errors import StorageError
from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording, Status
from podusv_cli.core.signal import NAME, Signal
from podusv_cli.storage import hdf5
from podusv_cli.storage.files import ELSEWHERE, LARGEST_FILE, LARGEST_TEXT, file_size, opened
from podusv_cli.storage.log import PROVENANCE, RESOLVED
from podusv_cli.storage.manifest import other_format

LARGEST_CONTENT = LARGEST_FILE  # bytes of numbers
MOST_MEMBERS = 1000
_FILTERS = {h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_FLETCHER32}
_AXIS, _NUMBERS = h5py.h5t.STD_I32LE, h5py.h5t.IEEE_F64LE  # types of what is in a log
# Axes and wrapped angles of logs of format 1, which lack these attributes.
OLD_AXES = {
    "rbf_center": "node input", "rbf_width": "input", "W_star_u": "node", "W_star_r": "node",
    "window_start": "window", "V_lambda": "window", "V_Delta": "window", "V_bound": "window",
    "v_bound": "window", "W_hat_u": "time node", "W_hat_r": "time node",
    **dict.fromkeys(
        ("n", "n_part", "delta", "n_cmd", "n_part_cmd", "delta_cmd", "thrust", "power"), "time pod"
    ),
}  # fmt: skip
OLD_WRAPPED = ("psi_d", "psi_e", "psi_d_held")


class _Member(NamedTuple):
    """An array of the file."""

    dataset: h5py.h5d.DatasetID
    signal: Signal

    @property
    def bytes(self) -> int:
        return 8 * int(math.prod(self.dataset.shape))


def read_log(path: Path, largest: float = LARGEST_CONTENT) -> Recording:
    """The recording in a log file; contiguous arrays are mapped from the file.

    `seen` is not logged and stays None. Raises StorageError, also if the file or its numbers take
    more than `largest` bytes.
    """
    with _opened(path, largest) as (file, raw):
        members = _members(file)
        total = sum(member.bytes for member in members)
        if total > largest:
            claim = f"claims {total} bytes of data, at most {largest} allowed"
            raise StorageError(f"cannot read {path}: {claim}{ELSEWHERE}")
        content = np.memmap(raw, np.uint8, "r")  # one map: each would keep a file open
        arrays = {member.signal.name: _array(member, content) for member in members}
        about = {member.signal.name: member.signal for member in members}
        return Recording(
            status=_status(file),
            controller=_attribute(file.id, "controller"),
            signals={name: array for name, array in arrays.items() if not about[name].fixed},
            fixed={name: array for name, array in arrays.items() if about[name].fixed},
            message=_optional_attribute(file.id, "message"),
            about=about,
        )


def resolved_yaml(path: Path) -> str:
    """The complete scenario of a log file. Raises StorageError."""
    with _opened(path) as (file, _):
        hdf5.check_link(file.id, PROVENANCE)
        group = h5py.h5g.open(file.id, PROVENANCE.encode())
        return _text(_dataset(group, RESOLVED)).decode()


@contextmanager
def _opened(
    path: Path, largest: float = LARGEST_FILE
) -> Iterator[tuple[h5py.File, BufferedReader]]:
    """A log with a known format, and its open file; errors in the block become StorageError."""
    with opened(path) as raw:
        if file_size(raw) > largest:
            found = f"{file_size(raw)} bytes, at most {largest} allowed"
            raise StorageError(f"cannot read {path}: {found}{ELSEWHERE}")
        with hdf5.readable(path, "a log"), h5py.File(raw) as file:
            _check_format(file)
            yield file, raw


def _check_format(file: h5py.File) -> None:
    if file.userblock_size:
        raise ValueError("no HDF5 file of the kind that podusv writes")
    attribute = h5py.h5a.open(file.id, b"podusv_format")
    if attribute.get_type() != h5py.h5t.STD_I32LE or attribute.shape != ():
        raise ValueError("podusv_format is no number")
    found = np.zeros((), dtype="<i4")
    attribute.read(found)
    if misfit := other_format(int(found)):
        raise ValueError(misfit)


def _status(file: h5py.File) -> Status:
    found = _attribute(file.id, "status")
    for status in get_args(Status):
        if found == status:
            return status  # type: ignore[no-any-return]
    raise ValueError(f"unknown status {found!r}")


def _attribute(thing: h5py.h5g.GroupID | h5py.h5d.DatasetID, name: str) -> str:
    words = _text(h5py.h5a.open(thing, name.encode())).decode()
    if any(unicodedata.category(c) == "Cc" and c not in "\t\n\r" for c in words):
        raise ValueError(f"{name} holds characters that are no text")
    return words


def _optional_attribute(thing: h5py.h5g.GroupID | h5py.h5d.DatasetID, name: str) -> str:
    """An attribute's text, "" if there is no such attribute."""
    return _attribute(thing, name) if h5py.h5a.exists(thing, name.encode()) else ""


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


def _dataset(group: h5py.h5g.GroupID, name: str) -> h5py.h5d.DatasetID:
    """A dataset with all its data in this file and only the expected filters."""
    dataset = hdf5.dataset(group, name)
    filters = _filters(dataset.get_create_plist())
    if not set(filters) <= _FILTERS or len(set(filters)) < len(filters):
        raise ValueError(f"{name} is packed in an unknown way")
    if dataset.shape is None:
        raise ValueError(f"{name} is empty")
    return dataset


def _members(file: h5py.File) -> list[_Member]:
    """All arrays in the order of writing; arrays agree in length along every axis."""
    if len(file) > MOST_MEMBERS:
        raise ValueError(f"it has {len(file)} members, more than {MOST_MEMBERS}")
    for name in file:
        if not NAME.fullmatch(str(name)):  # bytes where it is no UTF-8
            raise ValueError(f"{name!r} is no name of a signal")
    datasets = {name: _dataset(file.id, name) for name in file if name != PROVENANCE}
    members = [
        _member(n, dataset) for n, dataset in datasets.items() if dataset.get_type() != _AXIS
    ]
    if not any(member.signal.name == "time" for member in members):
        raise ValueError("it has no time")
    lengths: dict[str, int] = {}
    for member in members:
        _check_shape(member, lengths)
    return members


def _member(name: str, dataset: h5py.h5d.DatasetID) -> _Member:
    if dataset.get_type() != _NUMBERS:
        raise ValueError(f"{name} holds no 64-bit numbers")
    if not h5py.h5a.exists(dataset, b"symbol"):
        raise ValueError(f"{name!r} does not say what signal it is")
    unit, meaning, symbol = (_attribute(dataset, fact) for fact in ("units", "long_name", "symbol"))
    stated_axes = _optional_attribute(dataset, "axes")
    axes = (stated_axes or OLD_AXES.get(name, "time")).split()
    over_time = axes[:1] == ["time"]
    wrapped = bool(_optional_attribute(dataset, "wrapped")) or (
        not stated_axes and name in OLD_WRAPPED
    )
    beside = tuple(axes[over_time:])
    return _Member(dataset, Signal(name, unit, meaning, symbol, beside, wrapped, not over_time))


def _check_shape(member: _Member, lengths: dict[str, int]) -> None:
    """Check an array's length along every axis; `lengths` holds those of the arrays before it."""
    dataset, signal, axes = *member, member.signal.dimensions
    if len(dataset.shape) != len(axes):
        raise ValueError(
            f"{signal.name} has {len(dataset.shape)} dimensions instead of {len(axes)}"
        )
    for axis, size in zip(axes, dataset.shape, strict=True):
        if lengths.setdefault(axis, size) != size:
            found = f"{size} values along {axis} instead of {lengths[axis]}"
            raise ValueError(f"{signal.name} has {found}")
        if not size and axis != "time":
            raise ValueError(f"{signal.name} has no values along {axis}")


def _array(member: _Member, content: npt.NDArray[np.uint8]) -> Vector:
    dataset, name = member.dataset, member.signal.name
    layout = dataset.get_create_plist().get_layout()
    if not member.bytes:
        return np.empty(dataset.shape)
    if layout == h5py.h5d.CHUNKED:
        _check_chunks(name, dataset, member.bytes)
        numbers = np.empty(dataset.shape)
        dataset.read(h5py.h5s.ALL, h5py.h5s.ALL, numbers)
        return numbers
    place = dataset.get_offset()
    if place is None or place + member.bytes > len(content):
        raise ValueError(f"{name} has no numbers in this file")
    numbers = np.ndarray(dataset.shape, np.float64, content.data, place)
    return numbers if numbers.flags.aligned else numbers.copy()


def _filters(made: h5py.h5p.PropDCID) -> list[int]:
    return [made.get_filter(i)[0] for i in range(made.get_nfilters())]


def _check_chunks(name: str, dataset: h5py.h5d.DatasetID, size: int) -> None:
    """Refuse missing chunks, which HDF5 fills with zeros, and chunks that unpack beyond `size`."""
    part = dataset.get_create_plist().get_chunk()
    if any(side > most for side, most in zip(part, dataset.shape, strict=True)):
        raise ValueError(f"{name} is packed in an unknown way")
    sides = zip(dataset.shape, part, strict=True)
    if dataset.get_num_chunks() != math.prod(-(-most // side) for most, side in sides):
        raise ValueError(f"{name} is damaged: a chunk is missing")
    if dataset.get_storage_size() > 2 * size + 4096:
        raise ValueError(f"{name} is packed in an unknown way")
    for number in range(dataset.get_num_chunks()):
        stored = dataset.get_chunk_info(number)
        _, packed = dataset.read_direct_chunk(stored.chunk_offset)
        if h5py.h5z.FILTER_DEFLATE in _filters(dataset.get_create_plist()):
            _check_inflated(name, packed, 8 * math.prod(part))


def _check_inflated(name: str, packed: bytes, size: int) -> None:
    """Refuse a chunk that unpacks to more than `size` bytes, which HDF5 would allocate."""
    try:
        content = zlib.decompressobj().decompress(packed, size + 1)
    except zlib.error as error:
        raise ValueError(f"{name} is damaged: {error}") from error
    if len(content) > size:
        raise ValueError(f"{name} is packed in an unknown way")
