"""Files that are there whole or not at all, and failures told in one sentence."""

from __future__ import annotations

import errno
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from podusv_cli.errors import StorageError

CAUSES = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the disk quota is used up",
    errno.EFBIG: "larger than the file size limit of this session",
    errno.EACCES: "not permitted",
    errno.EPERM: "not permitted",
    errno.EROFS: "the file system is read-only",
    errno.ENOENT: "no such file or folder",
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
    part = path.with_name(f".podusv-{secrets.token_hex(8)}.part")
    with explained(f"cannot write {path} ({len(content)} bytes)"):
        try:
            _create(part, content)
            os.replace(part, path)
        finally:
            with suppress(OSError):
                part.unlink()
        _sync_folder(path.parent)


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


def _create(path: Path, content: bytes) -> None:
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
    try:
        rest = memoryview(content)
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
