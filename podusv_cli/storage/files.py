"""Whole files: written so that they are there entirely or not at all, and read without surprises.

Reading takes only regular files, never through a link, never more than a limit. Every failure is
one sentence.
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
from podusv_cli.process.temporary_names import forget_files, part_name

LARGEST_TEXT = 16 * 2**20  # bytes
LARGEST_FILE = 4 * 2**30  # bytes
ELSEWHERE = "; read it with h5py or xarray, or log less often (log.every)"
_CREATE = os.O_CREAT | os.O_EXCL | os.O_CLOEXEC | os.O_WRONLY
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
def explained(doing: str) -> Iterator[None]:
    """Turn an OSError inside into a StorageError that says `doing` and the cause."""
    try:
        yield
    except OSError as error:
        cause = CAUSES.get(error.errno or 0) or error.strerror or str(error)
        raise StorageError(f"{doing}: {cause}") from error


def write_bytes(path: Path, content: bytes) -> None:
    """Put `content` under the name `path`: before and after a failure the file is whole.

    Raises StorageError naming path, size and cause; the old file, if any, is then untouched, unless
    only the last step failed, which makes the new name durable.
    """
    write_all({path: content})


def write_all(contents: Mapping[Path, bytes]) -> None:
    """The same for several files; all are on the disk before the first gets its name.

    A disk that fills up leaves the old files. StorageError also where something that is no file has
    the name.
    """
    parts = {path: path.with_name(part_name()) for path in contents}
    folders = dict.fromkeys(path.parent for path in contents)
    for folder in folders:
        forget_files(folder)
    try:
        for path, part in parts.items():
            with explained(f"cannot write {path} ({len(contents[path])} bytes)"):
                _refuse_odd(path)
                _create(part, contents[path])
        for path, part in parts.items():
            with explained(f"cannot write {path} ({len(contents[path])} bytes)"):
                os.replace(part, path)
    finally:
        for part in parts.values():
            with suppress(OSError):
                part.unlink()
    for folder in folders:
        sync_folder(folder)


def check_places(paths: Iterable[Path]) -> None:
    """Raise the StorageError that writing these files would end with, as far as can be known.

    Folders need not be there yet. Nothing is left behind.
    """
    for path in paths:
        with explained(f"cannot write {path}"):
            _refuse_odd(path)
            probe = next(p for p in path.parents if os.path.lexists(p)) / part_name()
            try:
                _create(probe, b"")
            finally:
                probe.unlink(missing_ok=True)


def _refuse_odd(path: Path) -> None:
    """What is no file would be replaced by one, a device too."""
    if path.is_symlink() or (path.exists() and not path.is_file()):
        raise StorageError(f"cannot write {path}: it is there already and is not a file")


def create(path: Path, content: bytes) -> None:
    """Write a new file through to the disk. Raises StorageError, also where `path` exists.

    A failure may leave a piece of the file: only for folders that are not yet visible.
    """
    with explained(f"cannot write {path} ({len(content)} bytes)"):
        _create(path, content)


@contextmanager
def growing(path: Path, size: int) -> Iterator[BinaryIO]:
    """A new file to be filled with `size` bytes inside the block, and on the disk after it.

    Raises StorageError where `create` would, and for every OSError inside.
    """
    with explained(f"cannot write {path} ({size} bytes)"):
        descriptor = os.open(path, _CREATE, 0o666)
        with os.fdopen(descriptor, "wb", buffering=0) as file:
            yield file
            os.fsync(descriptor)


def mapped(folder: Path, size: int) -> Vector:
    """Room for `size` numbers in a nameless file of the folder, for what memory does not hold.

    Its disk space is reserved here, so that a full disk is a StorageError now and not a signal when
    a number is stored.
    """
    doing = f"cannot keep the log in {folder} ({8 * size} bytes)"
    with explained(doing), tempfile.TemporaryFile(dir=folder) as file:
        os.posix_fallocate(file.fileno(), 0, 8 * size)
        return np.memmap(file, np.float64, "r+", shape=size).view(np.ndarray)


def make_folder(path: Path) -> None:
    """Make a folder with all above it, where it is not there yet. Raises StorageError."""
    with explained(f"cannot make the folder {path}"):
        path.mkdir(parents=True, exist_ok=True)


def sync_folder(folder: Path) -> None:
    """Make the names in `folder` durable. Raises StorageError."""
    with explained(f"cannot write {folder} to the disk"):
        _sync_folder(folder)


def _create(path: Path, content: bytes) -> None:
    descriptor, rest = os.open(path, _CREATE, 0o666), memoryview(content)
    try:
        while rest:
            rest = rest[os.write(descriptor, rest) :]
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _sync_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    except OSError as error:
        # Some network file systems know no fsync of folders; there is nothing to wait for then.
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise
    finally:
        os.close(descriptor)


@contextmanager
def opened(path: Path) -> Iterator[BufferedReader]:
    """The regular file `path`; raises StorageError for anything else, and never waits."""
    # Opening a named pipe waits for its writer, unless O_NONBLOCK says not to.
    flags = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    with explained(f"cannot read {path}"):
        descriptor = os.open(path, flags)
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            os.close(descriptor)
            raise StorageError(f"cannot read {path}: not a regular file")
        with open(descriptor, "rb") as file:
            yield file


def file_size(file: BufferedReader) -> int:
    """Bytes of an open file."""
    return os.fstat(file.fileno()).st_size


def read_bytes(path: Path, limit: int, remedy: str = "") -> bytes:
    """The whole file; StorageError, with a remedy, where it holds more than `limit` bytes."""
    with opened(path) as file:
        size = file_size(file)
        if size > limit:
            raise StorageError(f"cannot read {path}: {size} bytes, at most {limit} allowed{remedy}")
        return file.read(size)


def read_text(path: Path, limit: int = LARGEST_TEXT) -> str:
    """A UTF-8 text of at most `limit` bytes; raises StorageError."""
    try:
        return read_bytes(path, limit).decode()
    except UnicodeDecodeError as error:
        raise StorageError(f"cannot read {path}: not UTF-8 text ({error})") from error


def fingerprint(path: Path) -> tuple[str, int]:
    """SHA-256 in hex, and size in bytes; raises StorageError."""
    with opened(path) as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        return digest, file.tell()
