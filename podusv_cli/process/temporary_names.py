"""Hidden names for what is in the making; they say who makes it.

So no instant exists at which such a part belongs to nobody, and what a killed process left can be
told from what a live one is making.
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

_PART = re.compile(
    r"\.((?P<name>.+)\.)?podusv-(?P<machine>[0-9a-f]{8})-(?P<process>[0-9]+)-[0-9a-f]{8}\.part",
    re.DOTALL,  # a name may hold any letter, a new line too
)


def part_name(final: str = "") -> str:
    """A new name for a part that this process makes; `final` is what it will be called, if told."""
    shown = f".{final}" if final else ""
    return f"{shown}.podusv-{_machine()}-{os.getpid()}-{secrets.token_hex(4)}.part"


def is_part(name: str) -> bool:
    """Whether this is the name of a part, whoever makes it."""
    return _PART.fullmatch(name) is not None


def abandoned(folder: Path) -> Iterator[tuple[Path, str]]:
    """Parts in `folder` whose makers are dead, and their final names ("" where not told).

    Those of other machines are left out: nobody here can tell whether their makers live.
    """
    with suppress(OSError):
        for entry in list(os.scandir(folder)):
            found = _PART.fullmatch(entry.name)
            if found and found["machine"] == _machine() and not _alive(int(found["process"])):
                yield Path(entry.path), found["name"] or ""


def forget_files(folder: Path) -> None:
    """Clear away the files that killed processes were writing into `folder`."""
    for path, final in abandoned(folder):
        if not final:
            with suppress(OSError):
                path.unlink()


def _machine() -> str:
    """Where process numbers mean what they mean here: a machine, or a container on it."""
    names = [platform.node()]
    with suppress(OSError):
        names.append(str(os.stat("/proc/self/ns/pid").st_ino))
    return hashlib.sha256("\n".join(names).encode()).hexdigest()[:8]


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # somebody else's, or no process number at all
        return True
    return True
