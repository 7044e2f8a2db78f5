"""Columns of a log too large for memory: a file of bare numbers for each, read through maps."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.storage.files import explained, make_folder, write_out


class ColumnFiles:
    """`recording.Columns` whose rows lie in files of a folder, float64 and no more.

    Written in the ordinary way, so that a full disk is an error and no signal. Whoever owns the
    folder removes it; what `whole` gave stays usable until then.
    """

    def __init__(self, folder: Path) -> None:
        """Make the folder. Raises StorageError."""
        make_folder(folder)
        self._folder = folder
        self._shapes: dict[str, tuple[int, ...]] = {}

    def append(self, rows: Mapping[str, Vector]) -> None:
        """Write more rows behind those of before. Raises StorageError."""
        for name, array in rows.items():
            with explained(f"cannot keep the log in {self._folder} ({array.nbytes} bytes more)"):
                _append(self._folder / name, array)
            count = self._shapes.get(name, (0,))[0] + len(array)
            self._shapes[name] = (count, *array.shape[1:])

    def whole(self) -> dict[str, Vector]:
        """Maps of the files, of which no more is in memory than is looked at. StorageError."""
        with explained(f"cannot read the log in {self._folder}"):
            return {name: _mapped(self._folder / name, s) for name, s in self._shapes.items()}


def _append(path: Path, array: Vector) -> None:
    flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC
    descriptor = os.open(path, flags, 0o600)
    try:
        write_out(descriptor, np.ascontiguousarray(array).reshape(-1).data.cast("B"))
    finally:
        os.close(descriptor)


def _mapped(path: Path, shape: tuple[int, ...]) -> Vector:
    if 0 in shape:  # of nothing there is no map
        return np.zeros(shape)
    return np.memmap(path, np.float64, "r", shape=shape).view(np.ndarray)
