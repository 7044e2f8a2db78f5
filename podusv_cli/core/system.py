"""What differs between Linux, macOS and Windows: a system's own names, asked for in one place."""

from __future__ import annotations

import os
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from multiprocessing.process import BaseProcess

# Those that a system has: SIGHUP where the terminal is lost, SIGBREAK by Ctrl-Break on Windows.
SIGNALS = tuple(
    getattr(signal, name)
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
    if hasattr(signal, name)
)


# What Windows takes for a device, with any ending: no file and no folder there has such a name.
PORTS = [f"{port}{number}" for port in ("com", "lpt") for number in range(1, 10)]
DEVICES = {"con", "prn", "aux", "nul", *PORTS}
DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")
TRIES = 10  # of a rename on Windows, where a virus scanner may have a file open for a moment
PAUSE = 0.05  # s between two of them


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


def ask_to_end(process: BaseProcess) -> None:
    """Ask a worker process to end with what it has.

    Windows would end it at once, and has told all processes of a terminal by itself.
    """
    if os.name != "nt":
        process.terminate()


def belongs_to_user(status: os.stat_result) -> bool:
    """Whether a file is the user's own; Windows keeps owners elsewhere, and homes private."""
    whose = getattr(os, "getuid", None)
    return whose is None or status.st_uid == whose()


def name_refused(name: str) -> str:
    """Why no folder can have this name on Windows; "" where it can.

    For every system, since folders of results are passed on to others.
    """
    if name.partition(".")[0].rstrip().lower() in DEVICES:
        return f"{name} is a device on Windows, so no folder can have this name; take another one"
    if name.endswith((".", " ")):
        return f"{name!r} ends in {name[-1]!r}, which Windows leaves out; take another name"
    return ""


def stays_inside(name: str) -> bool:
    """Whether this system takes `a/b` for a file b in a folder a, and for nothing else.

    On Windows `\\` parts folders, a colon names a drive or a stream, and some names are devices.
    """
    is_odd = "\\" in name or ":" in name or any(map(name_refused, name.split("/")))
    return os.name != "nt" or not is_odd


def has_display() -> bool:
    """Whether a browser can show a page."""
    return sys.platform in ("darwin", "win32") or any(map(os.environ.get, DISPLAYS))


def sync_disk() -> bool:
    """Write all files to the disk; False where a system cannot but file by file."""
    sync = getattr(os, "sync", None)
    if sync:
        sync()
    return sync is not None


def name_of_open_file(descriptor: int, path: Path) -> str:
    """A name of an open file that stays its own, whatever is put in its place meanwhile.

    Windows puts nothing in the place of a file that is open.
    """
    return str(path) if os.name == "nt" else f"/dev/fd/{descriptor}"


def relative_path(path: str | Path, folder: str | Path = ".") -> str:
    """A path from a folder on, written as every system reads it; whole from another drive."""
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:
        return Path(path).absolute().as_posix()


def rename_folder(folder: Path, final: Path) -> None:
    """Give `folder` the name `final`, in place of an empty folder if there is one. Raises OSError.

    Windows replaces no folder, and renames none while a file in it is open: there it is tried
    several times.
    """
    if os.name != "nt":
        os.rename(folder, final)
        return
    with suppress(OSError):  # it holds something, or is not there
        os.rmdir(final)
    for left in reversed(range(TRIES)):
        try:
            os.rename(folder, final)
            return
        except PermissionError:
            if not left:
                raise
            time.sleep(PAUSE)
