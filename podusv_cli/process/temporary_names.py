"""Hidden names of unfinished files and folders, which carry machine and process.

The name tells files that a killed process left from files that a running process is writing.
"""

from __future__ import annotations

import hashlib
import os
import platform
import re
import secrets
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from podusv_cli.core.system import is_running

_PART = re.compile(
    r"\.((?P<name>.+)\.)?podusv-(?P<machine>[0-9a-f]{8})-(?P<process>[0-9]+)-[0-9a-f]{8}\.part",
    re.DOTALL,  # a name may hold any letter, a new line too
)


def temporary_name(final: str = "") -> str:
    """A new hidden name; `final` is the name that the finished file or folder will have."""
    shown = f".{final}" if final else ""
    return f"{shown}.podusv-{_machine()}-{os.getpid()}-{secrets.token_hex(4)}.part"


def find_abandoned(folder: Path) -> Iterator[tuple[Path, str]]:
    """Unfinished files and folders of ended processes, and their final names ("" if unknown).

    Those of other machines are left out, since it is unknown here whether their process runs.
    """
    with suppress(OSError):
        # A list, as callers remove one by one what they are given.
        for entry in list(os.scandir(folder)):
            match = _PART.fullmatch(entry.name)
            if match and match["machine"] == _machine() and not is_running(int(match["process"])):
                yield Path(entry.path), match["name"] or ""


def remove_abandoned_files(folder: Path) -> None:
    """Delete the unfinished files that killed processes left in `folder`."""
    for path, final in find_abandoned(folder):
        if not final:
            with suppress(OSError):
                path.unlink()


def _machine() -> str:
    """Eight digits for the machine, or the container on it, where process numbers are unique.

    A container has a name space of process numbers of its own.
    """
    names = [platform.node()]
    with suppress(OSError):
        names.append(str(os.stat("/proc/self/ns/pid").st_ino))
    return hashlib.sha256("\n".join(names).encode()).hexdigest()[:8]
