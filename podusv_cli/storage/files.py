"""Atomic writing of files, and reading of regular files up to a size limit.

A file is written completely or not at all. Links are not followed. Errors are StorageError.
"""

from __future__ import annotations

import errno
import hashlib
import os
import stat
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from io import BufferedReader
from pathlib import Path
from typing import BinaryIO

import numpy as np

from podusv_cli.core.errors import StorageError
from podusv_cli.core.kernel import Vector
from podusv_cli.core.system import open_flags
from podusv_cli.process.temporary_names import remove_abandoned_files, temporary_name

LARGEST_TEXT = 16 * 2**20  # bytes
LARGEST_FILE = 4 * 2**30  # bytes
# In a folder while it is written.
LOCKS = (".podusv-runs.lock", ".podusv-tables.lock", ".podusv-provenance.lock")
ELSEWHERE = "; read it with h5py or xarray, or log less often (log.every)"
_CREATE = open_flags("O_CREAT", "O_EXCL", "O_CLOEXEC", "O_WRONLY")
CAUSES = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the disk quota is used up",
    errno.EFBIG: "larger than the file size limit of this session",
    errno.EACCES: "not permitted",
    errno.EPERM: "not permitted",
    errno.EROFS: "the file system is read-only",
    errno.ENOENT: "no such file or folder",
    errno.EEXIST: "something that exists already is in the way",
    errno.ENOTDIR: "a part of the path is a file, not a folder",
    errno.ELOOP: "a symbolic link, which podusv does not follow here",
    errno.ENAMETOOLONG: "the name is too long",
}


@contextmanager
def storage_errors(failure: str) -> Iterator[None]:
    """Turn an OSError in the block into a StorageError `<failure>: <cause>`."""
    try:
        yield
    except OSError as error:
        cause = CAUSES.get(error.errno or 0) or error.strerror or str(error)
        raise StorageError(f"{failure}: {cause}") from error


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file atomically, in place of an older one.

    Raises StorageError naming path, size and cause. The older file is then unchanged, unless only
    the last step failed, which syncs the folder.
    """
    write_all({path: content})


def write_all(contents: Mapping[Path, bytes]) -> None:
    """Write several files; all are on the disk before the first replaces an older one.

    Raises StorageError, also where the name belongs to something that is not a file.
    """
    parts = {path: path.with_name(temporary_name()) for path in contents}
    folders = dict.fromkeys(path.parent for path in contents)
    for folder in folders:
        remove_abandoned_files(folder)
    try:
        for path, part in parts.items():
            with storage_errors(f"cannot write {path} ({len(contents[path])} bytes)"):
                _check_regular_file(path)
                _create(part, contents[path])
        for path, part in parts.items():
            with storage_errors(f"cannot write {path} ({len(contents[path])} bytes)"):
                os.replace(part, path)
    finally:
        # Those that were renamed are not there any more.
        for part in parts.values():
            with suppress(OSError):
                part.unlink()
    for folder in folders:
        sync_folder(folder)


def write_texts(folder: Path, texts: Mapping[str, str]) -> None:
    """As `write_all` for texts by their names in the folder, whose folders are made."""
    for name in texts:
        make_folder((folder / name).parent)
    write_all({folder / name: text.encode() for name, text in texts.items()})


def check_places(paths: Iterable[Path]) -> None:
    """Raises StorageError if these files cannot be written; nothing is left behind.

    Their folders need not exist yet: a probe is written into the nearest one that does.
    """
    for path in paths:
        with storage_errors(f"cannot write {path}"):
            _check_regular_file(path)
            probe = next(p for p in path.parents if os.path.lexists(p)) / temporary_name()
            try:
                _create(probe, b"")
            finally:
                probe.unlink(missing_ok=True)


def _check_regular_file(path: Path) -> None:
    """Raises StorageError for a link, folder or device, which writing would replace by a file."""
    if path.is_symlink() or (path.exists() and not path.is_file()):
        raise StorageError(f"cannot write {path}: it is there already and is not a file")


def create(path: Path, content: bytes) -> None:
    """Write a new file and sync it. Raises StorageError, also where `path` exists.

    A failure may leave a part of the file, so use it only in unfinished folders.
    """
    with storage_errors(f"cannot write {path} ({len(content)} bytes)"):
        _create(path, content)


@contextmanager
def new_file(path: Path, size: int, *, sync: bool = True) -> Iterator[BinaryIO]:
    """A new file of `size` bytes, open for writing in the block and synced after it.

    Without `sync` it is not synced, and whoever writes several files syncs them together. Raises
    StorageError as `create` does, and for every OSError in the block.
    """
    with storage_errors(f"cannot write {path} ({size} bytes)"):
        descriptor = os.open(path, _CREATE, 0o666)
        with os.fdopen(descriptor, "wb", buffering=0) as file:
            yield file
            if sync:
                os.fsync(descriptor)


def disk_array(folder: Path, size: int) -> Vector:
    """An array (size,) of numbers in a nameless file of the folder, for logs larger than memory.

    Its disk space is reserved at once, so that a full disk is a StorageError here and not a signal
    (SIGBUS) when a number is stored; ZFS, macOS and Windows reserve nothing.
    """
    failure = f"cannot keep the log in {folder} ({8 * size} bytes)"
    # Windows gives the file a name until the array is gone, and renames no folder with it inside.
    place = None if os.name == "nt" else folder
    with storage_errors(failure), tempfile.TemporaryFile(dir=place) as file:
        # A file that is only made longer is sparse: it takes space when a page is first written.
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(file.fileno(), 0, 8 * size)
        else:
            file.truncate(8 * size)
        return np.memmap(file, np.float64, "r+", shape=size).view(np.ndarray)


def is_empty(folder: Path) -> bool:
    """Whether a folder is missing or holds nothing but a lock and what killed processes left.

    Their unfinished files are removed. Raises StorageError.
    """
    remove_abandoned_files(folder)
    with storage_errors(f"cannot read {folder}"):
        # A writer's lock is no content: whoever asks may hold it.
        return not folder.exists() or {path.name for path in folder.iterdir()} <= {*LOCKS}


def names_inside(folder: Path, above: str = "") -> Iterator[str]:
    """All but folders and locks in a folder and in those in it: names as `logs/pid-0-0/log.h5`.

    Links are not followed. What another process removes meanwhile is left out. Raises StorageError.
    """
    with (
        storage_errors(f"cannot list {folder}"),
        suppress(FileNotFoundError),
        os.scandir(folder) as entries,
    ):
        for entry in entries:
            if entry.is_dir(follow_symlinks=False):
                yield from names_inside(Path(entry.path), f"{above}{entry.name}/")
            elif entry.name not in LOCKS:
                yield f"{above}{entry.name}"


def make_folder(path: Path) -> None:
    """Make a folder and its parents, if missing. Raises StorageError."""
    with storage_errors(f"cannot make the folder {path}"):
        path.mkdir(parents=True, exist_ok=True)


def sync_file(path: Path) -> None:
    """Sync a file to the disk. Raises StorageError."""
    with storage_errors(f"cannot write {path} to the disk"), path.open("r+b") as file:
        os.fsync(file.fileno())


def sync_folder(folder: Path) -> None:
    """Sync the names in `folder` to the disk, where the system can. Raises StorageError."""
    if not hasattr(os, "O_DIRECTORY"):
        return  # Windows opens no folders
    with storage_errors(f"cannot write {folder} to the disk"):
        descriptor = os.open(folder, open_flags("O_RDONLY", "O_DIRECTORY", "O_CLOEXEC"))
        try:
            os.fsync(descriptor)
        except OSError as error:
            # Some network file systems have no fsync of folders.
            if error.errno not in (errno.EINVAL, errno.ENOTSUP):
                raise
        finally:
            os.close(descriptor)


def _create(path: Path, content: bytes) -> None:
    """Write a new file and wait until it is on the disk; a file that is there is an OSError."""
    descriptor, rest = os.open(path, _CREATE, 0o666), memoryview(content)
    try:
        while rest:  # a call may write less than it is given
            rest = rest[os.write(descriptor, rest) :]
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def open_regular(path: Path) -> Iterator[BufferedReader]:
    """A regular file, open for reading; raises StorageError for a link, pipe or device."""
    # Without O_NONBLOCK, opening a named pipe would wait for its writer.
    flags = open_flags("O_RDONLY", "O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC")
    with storage_errors(f"cannot read {path}"):
        descriptor = os.open(path, flags)
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            os.close(descriptor)
            raise StorageError(f"cannot read {path}: not a regular file")
        with open(descriptor, "rb") as file:
            yield file


def file_size(file: BufferedReader) -> int:
    """Bytes of an open file."""
    return os.fstat(file.fileno()).st_size


def read_text(path: Path) -> str:
    """A UTF-8 text of at most LARGEST_TEXT bytes; raises StorageError."""
    with open_regular(path) as file:
        size = file_size(file)
        if size > LARGEST_TEXT:
            raise StorageError(f"cannot read {path}: {size} bytes, at most {LARGEST_TEXT} allowed")
        # No more than was measured: the file may grow meanwhile.
        content = file.read(size)
    try:
        return content.decode()
    except UnicodeDecodeError as error:
        raise StorageError(f"cannot read {path}: not UTF-8 text ({error})") from error


def fingerprint(path: Path) -> tuple[str, int]:
    """SHA-256 in hex, and size in bytes; raises StorageError."""
    with open_regular(path) as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        return digest, file.tell()
