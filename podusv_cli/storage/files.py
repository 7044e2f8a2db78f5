"""Files that are there whole or not at all, and failures told in one sentence."""

from __future__ import annotations

import ctypes
import errno
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from podusv_cli.core.errors import StorageError
from podusv_cli.process.temporary_names import forget_files, part_name

CREATE = os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
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


def exchange(one: Path, other: Path) -> None:
    """Two names trade places at one instant. OSError, ENOSYS where the system has no such call."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    here, swapping = -100, 2  # AT_FDCWD, RENAME_EXCHANGE
    if rename(here, os.fsencode(one), here, os.fsencode(other), swapping) != 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


def create(path: Path, content: bytes) -> None:
    """Write a new file through to the disk. Raises StorageError, also where `path` exists.

    A failure may leave a piece of the file: only for folders that are not yet visible.
    """
    with explained(f"cannot write {path} ({len(content)} bytes)"):
        _create(path, content)


def make_folder(path: Path) -> None:
    """Make a folder with all above it, where it is not there yet. Raises StorageError."""
    with explained(f"cannot make the folder {path}"):
        path.mkdir(parents=True, exist_ok=True)


def sync_folder(folder: Path) -> None:
    """Make the names in `folder` durable. Raises StorageError."""
    with explained(f"cannot write {folder} to the disk"):
        _sync_folder(folder)


def write_out(descriptor: int, content: bytes | memoryview) -> None:
    """Write all of the content to an open file. Raises OSError."""
    rest = memoryview(content)
    while rest:
        rest = rest[os.write(descriptor, rest) :]


def _create(path: Path, content: bytes) -> None:
    descriptor = os.open(path, CREATE | os.O_WRONLY, 0o666)
    try:
        write_out(descriptor, content)
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
