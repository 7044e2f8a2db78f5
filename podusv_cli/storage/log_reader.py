"""Reading log.h5.

The digest in the manifest says whether a log is unchanged. The reader demands only what the rest of
podusv relies on: every array has all its numbers in this file, and arrays agree in length along
every axis. A log of somebody else may take any memory to read, up to the limit on its size.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path
from typing import Any, get_args

import h5py
import numpy as np
import numpy.typing as npt

from podusv_cli.core.errors import StorageError
from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording, Status
from podusv_cli.core.signal import Signal
from podusv_cli.storage import hdf5
from podusv_cli.storage.files import ELSEWHERE, LARGEST_FILE, file_size, open_regular
from podusv_cli.storage.log import PROVENANCE, RESOLVED
from podusv_cli.storage.manifest import other_format

LARGEST_CONTENT = LARGEST_FILE  # bytes of numbers
NUMBERS = np.dtype("<f8")


def read_log(path: Path, largest: float = LARGEST_CONTENT) -> Recording:
    """The recording in a log file; contiguous arrays are mapped from the file.

    Datasets of other numbers, as scales, are left out. `seen` is not logged and stays None. Raises
    StorageError, also if the file or its numbers take more than `largest` bytes.
    """
    with _open_log(path, largest) as (file, raw):
        datasets = {n: d for n, d in file.items() if isinstance(d, h5py.Dataset)}
        datasets = {name: d for name, d in datasets.items() if d.dtype == NUMBERS}
        total = sum(NUMBERS.itemsize * dataset.size for dataset in datasets.values())
        if total > largest:
            claim = f"claims {total} bytes of data, at most {largest} allowed"
            raise StorageError(f"cannot read {path}: {claim}{ELSEWHERE}")
        about = {name: _signal(name, dataset) for name, dataset in datasets.items()}
        _check_lengths(datasets, about)
        content = np.memmap(raw, np.uint8, "r")  # one map: each would keep a file open
        arrays = {name: _array(dataset, content) for name, dataset in datasets.items()}
        return Recording(
            status=_status(file),
            controller=_text(file.attrs["controller"]),
            signals={name: array for name, array in arrays.items() if not about[name].fixed},
            fixed={name: array for name, array in arrays.items() if about[name].fixed},
            message=_text(file.attrs.get("message", b"")),
            about=about,
        )


def resolved_yaml(path: Path) -> str:
    """The complete scenario of a log file. Raises StorageError."""
    with _open_log(path) as (file, _):
        return _text(file[PROVENANCE][RESOLVED][()])


@contextmanager
def _open_log(
    path: Path, largest: float = LARGEST_FILE
) -> Iterator[tuple[h5py.File, BufferedReader]]:
    """A log with the known format, and its open file; errors in the block become StorageError.

    `largest` is the size [bytes] up to which a file is read.
    """
    with open_regular(path) as raw:
        if file_size(raw) > largest:
            sizes = f"{file_size(raw)} bytes, at most {largest} allowed"
            raise StorageError(f"cannot read {path}: {sizes}{ELSEWHERE}")
        # By the open file whose size was checked: under its name there may be another one by now.
        with hdf5.readable(path, "a log"), h5py.File(raw) as file:
            if misfit := other_format(int(file.attrs["podusv_format"])):
                raise ValueError(misfit)
            hdf5.check(file)
            yield file, raw


def _text(words: Any) -> str:
    """A text as HDF5 gives it, decoded."""
    return bytes(words).decode()


def _status(file: h5py.File) -> Status:
    """How the run ended. Raises ValueError for a word that podusv does not write."""
    status = _text(file.attrs["status"])
    if status not in get_args(Status):
        raise ValueError(f"unknown status {status!r}")
    return status  # type: ignore[return-value]


def _signal(name: str, dataset: h5py.Dataset) -> Signal:
    """What a log says of one of its signals. Raises KeyError or ValueError where it is damaged."""
    unit, meaning, symbol, axes = (
        _text(dataset.attrs[fact]) for fact in ("units", "long_name", "symbol", "axes")
    )
    first, *beside = axes.split()  # as `log` writes them: time first, if it runs over time
    over_time = first == "time"
    axes_beside = tuple(beside) if over_time else (first, *beside)
    wrapped = "wrapped" in dataset.attrs
    return Signal(name, unit, meaning, symbol, axes_beside, wrapped, not over_time)


def _check_lengths(datasets: Mapping[str, h5py.Dataset], about: Mapping[str, Signal]) -> None:
    """Raises KeyError where there is no time, ValueError where lengths along an axis differ."""
    lengths = {"time": len(datasets["time"])}
    for name, dataset in datasets.items():
        for axis, size in zip(about[name].dimensions, dataset.shape, strict=True):
            if lengths.setdefault(axis, size) != size:
                found = f"{size} values along {axis} instead of {lengths[axis]}"
                raise ValueError(f"{name} has {found}")


def _array(dataset: h5py.Dataset, content: npt.NDArray[np.uint8]) -> Vector:
    """A dataset's numbers in its shape; uncompressed ones are a view of `content`.

    `content` has all bytes of the file, mapped into memory. Numbers that do not begin at a multiple
    of 8 bytes, as other programs may write, are copied.
    """
    place = dataset.id.get_offset()
    if place is None:  # compressed, or without numbers
        return np.asarray(dataset[()])
    numbers = np.ndarray(dataset.shape, NUMBERS, content.data, place)
    return numbers if numbers.flags.aligned else numbers.copy()
