"""One writer at a time in the folder of a study or a search, which stays in the folder."""

from __future__ import annotations

import errno
import os
import platform
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from podusv_cli.core.errors import StorageError
from podusv_cli.process.interrupts import interrupts_enabled
from podusv_cli.storage.files import LOCKS, make_folder, names_inside, storage_errors

if TYPE_CHECKING:
    from filelock import BaseFileLock

# What a writer makes; tables are also made while runs still come, and both note their sessions.
RUNS, TABLES, PROVENANCE = LOCKS
PATIENCE = 600.0  # s that a driver waits for another process to finish the tables
WITHOUT_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.ENOTSUP)  # what such a file system answers


@contextmanager
def sole_writer(
    folder: Path,
    what: str = RUNS,
    patience: float = 0.0,
    warn: Callable[[str], None] = lambda text: None,
) -> Iterator[None]:
    """Make the folder, and keep other processes from writing into it during the block.

    The lock is one of the operating system, which ends with its process. `warn` is told where
    another process has it, for whose end this waits `patience` [s]. Raises StorageError where it
    has it still, for a file system without locks, and for a link, pipe or device in the folder.
    """
    make_folder(folder)
    _check_plain(folder)
    path = folder / what
    # The wait may take minutes, and nothing is begun that an interrupt could leave in half.
    with storage_errors(f"cannot lock {folder}"), interrupts_enabled():
        lock = _lock_folder(path, patience, warn)
    try:
        # Who holds the lock, for the message of others
        with suppress(OSError):  # a full disk, where only the message lacks these words
            path.write_text(f"{os.getpid()} {platform.node()}")
        yield
    finally:
        with suppress(PermissionError):  # of Windows, where its release removes it
            path.unlink(missing_ok=True)  # while it is locked; who waits for it looks for a new one
        lock.release()


def _lock_folder(path: Path, patience: float, warn: Callable[[str], None]) -> BaseFileLock:
    """A lock on a folder, held. Waits `patience` [s] for another process, and `warn` says so.

    Raises StorageError where another one keeps it, or where there are no locks.
    """
    from filelock import FileLock, Timeout  # 30 ms, for commands that write a study

    lock = FileLock(path, fallback_to_soft=False)  # a soft one outlives a process that is killed
    try:
        # First without patience, so that the user is told before the wait and not after it.
        with suppress(Timeout):
            lock.acquire(timeout=0.0)
            return lock
        other = f"{path.parent}: another podusv process{_holder(path)} writes there"
        if patience:
            warn(f"{other}; waiting {patience:g} s at most for its end")
        try:
            lock.acquire(timeout=patience)
        except Timeout as error:
            raise StorageError(f"{other}; wait until it has ended, or end it") from error
    except OSError as error:
        if error.errno not in WITHOUT_LOCKS:
            raise
        raise StorageError(
            f"cannot lock {path.parent}: its file system has no locks, without which two processes "
            "may write there at once; use a folder on a local disk"
        ) from error
    return lock


def _holder(path: Path) -> str:
    """Process and machine that a lock's file names; "" where it names none."""
    with suppress(OSError, ValueError):
        process, machine = path.read_text().split()
        return f" ({process} on {machine})"
    return ""


def _check_plain(folder: Path) -> None:
    """Raises StorageError for anything in the folder but files and folders.

    Through a link podusv would write elsewhere; what goes meanwhile is another process's.
    """
    for path in map(folder.joinpath, names_inside(folder)):
        # What is gone since it was listed leads nowhere.
        with storage_errors(f"cannot read {path}"), suppress(FileNotFoundError):
            mode = path.lstat().st_mode
            if not stat.S_ISREG(mode):
                what = "a symbolic link" if stat.S_ISLNK(mode) else "no file"
                raise StorageError(
                    f"cannot write {folder}: {path} is {what}; podusv writes nothing out "
                    "of the folder, so remove it"
                )
