"""Reading files that may be anything: only regular files, never through a link, never too much."""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path

from podusv_cli.core.errors import StorageError
from podusv_cli.storage.files import explained

LARGEST_TEXT = 16 * 2**20  # bytes
LARGEST_FILE = 4 * 2**30  # bytes
ELSEWHERE = "; read it with h5py or xarray, or log less often (log.every)"


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


def read_bytes(path: Path, limit: int, remedy: str = "") -> bytes:
    """The whole file; StorageError, with a remedy, where it holds more than `limit` bytes."""
    with opened(path) as file:
        size = os.fstat(file.fileno()).st_size
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
