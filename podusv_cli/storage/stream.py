"""A new file that grows under a library which cannot cope with a full disk: HDF5."""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from podusv_cli.storage.files import CREATE, explained


class Stream(io.RawIOBase):
    """A file that keeps its first OSError in `error` and pretends that there was none.

    Told of a failure, HDF5 cannot close its file any more, and h5py raises something else, or the
    process ends, as it does when HDF5 writes by itself. Whoever writes calls `check` now and then.
    """

    def __init__(self, raw: BinaryIO) -> None:
        """`raw` is where it goes, opened for reading and writing, without a buffer."""
        self._raw, self._place = raw, 0
        self.size = 0
        self.error: OSError | None = None

    def check(self) -> None:
        """Raise the OSError that came."""
        if self.error:
            raise self.error

    def write(self, content: Any) -> int:
        """All of the content, at the present place."""
        rest = memoryview(content).cast("B")
        count = len(rest)
        self._try(lambda: _write_all(self._raw, self._place, rest))
        self._place += count
        self.size = max(self.size, self._place)
        return count

    def readinto(self, room: Any) -> int:
        """Fill the room from the present place on; with zeros where nothing came to be written."""
        whole = memoryview(room).cast("B")
        whole[:] = bytes(len(whole))
        self._try(lambda: _read_all(self._raw, self._place, whole))
        self._place += len(whole)
        return len(whole)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Go to a place; the end is where it would be without an error."""
        base = {os.SEEK_SET: 0, os.SEEK_CUR: self._place, os.SEEK_END: self.size}[whence]
        self._place = base + offset
        return self._place

    def tell(self) -> int:
        """The present place."""
        return self._place

    def truncate(self, size: int | None = None) -> int:
        """Make the file that long."""
        self.size = self._place if size is None else size
        self._try(lambda: self._raw.truncate(self.size))
        return self.size

    def readable(self) -> bool:
        """Yes."""
        return True

    def writable(self) -> bool:
        """Yes."""
        return True

    def seekable(self) -> bool:
        """Yes."""
        return True

    def _try(self, act: Callable[[], object]) -> None:
        try:
            act()
        except OSError as error:
            self.error = self.error or error


def _write_all(raw: BinaryIO, place: int, rest: memoryview) -> None:
    raw.seek(place)
    while rest:
        rest = rest[raw.write(rest) :]


def _read_all(raw: BinaryIO, place: int, room: memoryview) -> None:
    raw.seek(place)
    while room and (count := raw.readinto(room)):  # type: ignore[attr-defined]
        room = room[count:]


@contextmanager
def growing(path: Path) -> Iterator[Stream]:
    """A new file to write to, on the disk when the block is over.

    Raises StorageError naming path, size and cause, also where `path` exists. A failure may leave
    a piece of the file: only for folders that are not yet visible.
    """
    with explained(f"cannot write {path}"):
        descriptor = os.open(path, CREATE | os.O_RDWR, 0o666)
    with os.fdopen(descriptor, "r+b", buffering=0) as raw:
        stream = Stream(raw)
        try:
            yield stream
        except Exception:
            if stream.error is None:
                raise
        with explained(f"cannot write {path} (more than {stream.size} bytes)"):
            stream.check()
            os.fsync(descriptor)
