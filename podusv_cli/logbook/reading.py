"""Reading log.h5 from anywhere: nothing in the file is believed before it has been checked.

A log could name other files to read from, claim any size, or be damaged. So it is read into memory
first, only known names are looked at, and sizes are added up before the first array is made.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import product
from pathlib import Path
from typing import get_args

import h5py
import numpy as np

from podusv_cli.errors import StorageError
from podusv_cli.kernels import Vector
from podusv_cli.logbook import layout
from podusv_cli.logbook.regular import LARGEST_TEXT, read_bytes
from podusv_cli.recording import Recording, Status
from podusv_cli.signals import SIGNALS

LARGEST_FILE = 2 * 2**30  # bytes
LARGEST_CONTENT = 4 * 2**30  # bytes, unpacked
_FILTERS = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32}
_CHECKSUM = 4  # bytes that Fletcher's adds to a chunk
# What h5py raises on damaged files; ValueError includes text that is not UTF-8.
_DAMAGE = (OSError, RuntimeError, ValueError, KeyError, TypeError, MemoryError, OverflowError)


def read_log(path: Path) -> Recording:
    """The recording in a log file; `seen` is not logged and stays None. Raises StorageError."""
    with _opened(path) as file:
        arrays = _arrays(file)
        return Recording(
            status=_status(file),
            controller=_text(h5py.h5a.open(file.id, b"controller")).decode(),
            signals={k: v for k, v in arrays.items() if k not in layout.FIXED_AXES},
            fixed={k: v for k, v in arrays.items() if k in layout.FIXED_AXES},
            message=_message(file),
        )


def resolved_yaml(path: Path) -> str:
    """The scenario, every value explicit, that a log file was made from. Raises StorageError."""
    with _opened(path) as file:
        _check_hard_link(file.id, layout.PROVENANCE)
        group = h5py.h5g.open(file.id, layout.PROVENANCE.encode())
        dataset = _dataset(group, layout.RESOLVED)
        content = _text(dataset)
        digest = _text(h5py.h5a.open(dataset, b"sha256")).decode()
        if hashlib.sha256(content or b"\0").hexdigest() != digest:
            raise ValueError("the scenario in it does not fit its checksum")
        return content.decode()


@contextmanager
def _opened(path: Path) -> Iterator[h5py.File]:
    """The log in memory, its format checked; what goes wrong inside becomes a StorageError."""
    image = read_bytes(path, LARGEST_FILE)
    try:
        with h5py.File(h5py.h5f.open_file_image(image)) as file:
            _check_format(file)
            yield file
    except _DAMAGE as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise StorageError(f"{path}: damaged, or not a log of podusv: {reason}") from error


def _check_format(file: h5py.File) -> None:
    attribute = h5py.h5a.open(file.id, b"podusv_format")
    if attribute.get_type() != h5py.h5t.STD_I32LE or attribute.shape != ():
        raise ValueError("podusv_format is no number")
    found = np.zeros((), dtype="<i4")
    attribute.read(found)
    if found != layout.FORMAT:
        raise ValueError(f"written in format {found}; this podusv reads format {layout.FORMAT}")


def _status(file: h5py.File) -> Status:
    found = _text(h5py.h5a.open(file.id, b"status")).decode()
    for status in get_args(Status):
        if found == status:
            return status  # type: ignore[no-any-return]
    raise ValueError(f"unknown status {found!r}")


def _message(file: h5py.File) -> str:
    if not h5py.h5a.exists(file.id, b"message"):
        return ""
    return _text(h5py.h5a.open(file.id, b"message")).decode()


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
    if not set(_filters(made)) <= _FILTERS:
        raise ValueError(f"{name} is packed in an unknown way")
    if dataset.shape is None:
        raise ValueError(f"{name} is empty")
    return dataset


def _filters(made: h5py.h5p.PropDCID) -> list[int]:
    return [made.get_filter(i)[0] for i in range(made.get_nfilters())]


def _arrays(file: h5py.File) -> dict[str, Vector]:
    """All signals, in the order in which they were written."""
    datasets = {name: _dataset(file.id, name) for name in _names(file)}
    lengths = {"time": math.prod(datasets["time"].shape)}
    for name, dataset in datasets.items():
        _check_numbers(name, dataset, lengths)
    total = sum(8 * math.prod(dataset.shape) for dataset in datasets.values())
    if total > LARGEST_CONTENT:
        raise ValueError(f"claims {total} bytes of data, at most {LARGEST_CONTENT} allowed")
    for name, dataset in datasets.items():
        _check_chunks(name, dataset)
    return {name: h5py.Dataset(dataset)[()] for name, dataset in datasets.items()}


def _names(file: h5py.File) -> list[str]:
    names = [name for name in file if name not in layout.AXES and name != layout.PROVENANCE]
    unknown = [name for name in names if name not in SIGNALS]
    if unknown:
        raise ValueError(f"{unknown[0]!r} is no signal that this podusv knows")
    if "time" not in names:
        raise ValueError("it has no time")
    return names


def _check_numbers(name: str, dataset: h5py.h5d.DatasetID, lengths: dict[str, int]) -> None:
    """Doubles, as long along every axis as all others; `lengths` learns from the first."""
    if dataset.get_type() != h5py.h5t.IEEE_F64LE:
        raise ValueError(f"{name} holds no 64-bit numbers")
    axes = layout.axes(name)
    if len(dataset.shape) != len(axes):
        raise ValueError(f"{name} has {len(dataset.shape)} dimensions instead of {len(axes)}")
    for axis, size in zip(axes, dataset.shape, strict=True):
        if lengths.setdefault(axis, size) != size:
            raise ValueError(f"{name} has {size} values along {axis} instead of {lengths[axis]}")


def _check_chunks(name: str, dataset: h5py.h5d.DatasetID) -> None:
    """Every chunk can be found and went through every filter, so that its checksum counts.

    The index of chunks has no checksum. Where an entry is damaged, HDF5 itself would quietly fill
    in zeros, or end the process for a chunk that is shorter than its own checksum.
    """
    shape, made = dataset.shape, dataset.get_create_plist()
    if math.prod(shape) == 0:
        return
    if sorted(_filters(made)) != sorted(_FILTERS):
        raise ValueError(f"{name} has no checksums")
    sides = list(zip(shape, made.get_chunk(), strict=True))
    count = math.prod(-(-size // part) for size, part in sides)
    # The count bounds the search; a chunk larger than the array would only cost memory.
    if dataset.get_num_chunks() != count or any(part > size for size, part in sides):
        raise ValueError(f"{name} is incomplete")
    for corner in product(*(range(0, size, part) for size, part in sides)):
        left_out, content = dataset.read_direct_chunk(corner)
        if left_out or len(content) <= _CHECKSUM:
            raise ValueError(f"{name} is packed in an unknown way")
