"""What differs between Linux, macOS and Windows: a system's own names, asked for in one place."""

from __future__ import annotations

import os
import signal

# Those that a system has: SIGHUP where the terminal is lost, SIGBREAK by Ctrl-Break on Windows.
SIGNALS = tuple(
    getattr(signal, name)
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
    if hasattr(signal, name)
)


def open_flags(*names: str) -> int:
    """Flags for `os.open` by name, without those that this system lacks; bytes stay as they are.

    Windows would otherwise write a carriage return before each line feed, in HDF5, too.
    """
    flags = 0
    for name in (*names, "O_BINARY"):
        flags |= getattr(os, name, 0)
    return flags


def usable_cores() -> int:
    """The cores that this process may run on."""
    import psutil  # which few commands need

    affinity = getattr(psutil.Process(), "cpu_affinity", None)  # macOS has none
    return len(affinity()) if affinity else os.cpu_count() or 1


def physical_memory() -> int:
    """Bytes of memory that this machine has."""
    import psutil

    return int(psutil.virtual_memory().total)


def is_running(process: int) -> bool:
    """Whether a process of this number runs, whoever's it is; true for what is no such number.

    `os.kill(process, 0)` asks the same on Linux and ends the process on Windows.
    """
    import psutil

    try:
        return bool(psutil.pid_exists(process))
    except (OverflowError, OSError):
        return True


def belongs_to_user(status: os.stat_result) -> bool:
    """Whether a file is the user's own; Windows keeps owners elsewhere, and homes private."""
    whose = getattr(os, "getuid", None)
    return whose is None or status.st_uid == whose()
