"""HDF5 files that keep all of their data in themselves; through others, any file could be read."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py

from podusv_cli.core.errors import StorageError
from podusv_cli.core.system import name_of_open_file
from podusv_cli.storage import files

# What h5py raises on damaged files; ValueError includes text that is not UTF-8.
DAMAGE = (
    OSError,
    RuntimeError,
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    MemoryError,
    OverflowError,
)


@contextmanager
def readable(path: Path, kind: str) -> Iterator[None]:
    """Turn what h5py raises in the block into a StorageError that calls the file no `kind`."""
    try:
        yield
    except DAMAGE as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise StorageError(f"{path}: damaged, or not {kind} of podusv: {reason}") from error


@contextmanager
def open_hdf5(path: Path, kind: str) -> Iterator[h5py.File]:
    """A regular file with all of its data in itself.

    Whatever h5py raises in the block is a StorageError that calls the file no `kind`.
    """
    with _descriptor(path) as name, readable(path, kind), h5py.File(name, "r") as file:
        check(file)
        yield file


@contextmanager
def _descriptor(path: Path) -> Iterator[str]:
    """A name of the open file: under its own name there may be another one by now.

    HDF5 reads it by itself, as it may close it when Python has ended and cannot be called.
    """
    with files.open_regular(path) as raw:
        yield name_of_open_file(raw.fileno(), path)


def check_link(group: h5py.h5g.GroupID, name: str) -> None:
    """Raise ValueError where a member of a group is a link to elsewhere."""
    if group.links.get_info(name.encode()).type != h5py.h5l.TYPE_HARD:
        raise ValueError(f"{name} is a link to elsewhere")


def dataset(group: h5py.h5g.GroupID, name: str) -> h5py.h5d.DatasetID:
    """A dataset with all its data in this file. Raises ValueError for another one."""
    check_link(group, name)
    handle = h5py.h5d.open(group, name.encode())
    # Checked before anything else: the mere shape of a virtual dataset can open other files.
    made = handle.get_create_plist()
    if made.get_layout() == h5py.h5d.VIRTUAL or made.get_external_count():
        raise ValueError(f"{name} keeps its data in another file")
    return handle


def check(file: h5py.File) -> None:
    """Raises ValueError where any member of the file, in whatever group, has data elsewhere."""
    names: list[bytes] = []
    file.id.links.visit(names.append)  # follows no link to elsewhere, and no link twice
    for name in map(bytes.decode, names):
        check_link(file.id, name)
        if h5py.h5o.get_info(file.id, name.encode()).type == h5py.h5o.TYPE_DATASET:
            dataset(file.id, name)
