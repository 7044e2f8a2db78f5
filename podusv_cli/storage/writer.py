"""One writer at a time in the folder of a study or a search, which stays in the folder."""

from __future__ import annotations

import os
import platform
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from podusv_cli.core.errors import StorageError
from podusv_cli.process.interrupts import interrupts_enabled
from podusv_cli.storage.files import LOCKS, make_folder, storage_errors

RUNS, TABLES = LOCKS  # what a writer makes; tables are also made while runs still come
PATIENCE = 600.0  # s that a driver waits for another process to finish the tables


@contextmanager
def sole_writer(folder: Path, what: str = RUNS, patience: float = 0.0) -> Iterator[None]:
    """Make the folder, and keep other processes from writing into it during the block.

    The lock is one of the operating system, which ends with its process. Raises StorageError where
    another process has it after `patience` [s], and for a link, pipe or device in the folder.
    """
    from filelock import FileLock, Timeout  # 30 ms, for commands that write a study

    make_folder(folder)
    _check_plain(folder)
    path = folder / what
    with storage_errors(f"cannot lock {folder}"):
        try:
            with interrupts_enabled():
                lock = FileLock(path)
                lock.acquire(timeout=patience)
        except Timeout as error:
            raise StorageError(
                f"{folder}: another podusv process{_holder(path)} writes there; wait until it has "
                "ended, end it, or name another folder with --out"
            ) from error
    try:
        with suppress(OSError):  # a full disk, where only the message lacks these words
            path.write_text(f"{os.getpid()} {platform.node()}")
        yield
    finally:
        path.unlink(missing_ok=True)  # while it is locked; who waits for it looks for a new one
        lock.release()


def _holder(path: Path) -> str:
    """Process and machine that a lock's file names; "" where it names none."""
    with suppress(OSError, ValueError):
        process, machine = path.read_text().split()
        return f" ({process} on {machine})"
    return ""


def _check_plain(folder: Path) -> None:
    """Raise StorageError for anything in the folder but files and folders."""
    with storage_errors(f"cannot read {folder}"):
        for place, folders, files in os.walk(folder):
            for path in (Path(place, name) for name in (*folders, *files)):
                with suppress(FileNotFoundError):  # another process has removed it
                    mode = path.lstat().st_mode
                    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
                        what = "a symbolic link" if stat.S_ISLNK(mode) else "no file"
                        raise StorageError(
                            f"cannot write {folder}: {path} is {what}; podusv writes nothing out "
                            "of the folder, so remove it"
                        )
