"""The folder where compiled code is kept: one that nobody but its user can write to.

Whoever can write a piece of compiled code has it run by the next command. So the folder and all
folders above it have to be safe from other users.
"""

from __future__ import annotations

import grp
import logging
import os
import pwd
import re
import shutil
import stat
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

from podusv_cli.core.escaping import visible
from podusv_cli.process.temporary_names import remove_abandoned_files, temporary_name

KEPT = 8  # folders of this many other states of the source stay on disk
DIGEST = re.compile(r"[0-9a-f]{16}")
# By this name and first line other programs know a cache; the second line says that it is ours.
MARK = "CACHEDIR.TAG"
MARKED = b"Signature: 8a477f597d28d172789f06886806bc55\n# Compiled code of podusv.\n"


@cache
def code_folder(name: str) -> Path | None:
    """The folder `name` in $PODUSV_CACHE, else in podusv under $XDG_CACHE_HOME or ~/.cache.

    None where neither will do. A line on stderr says why a place was passed over, and what is used.
    """
    refused = []
    for root in _roots():
        try:
            folder = _made(root, name)
        except OSError as error:
            refused.append(f"{root}: {error.strerror or error}")
            continue
        if refused:
            _warn(f"compiled code is kept in {root} ({refused[0]})")
        return folder
    reasons = "; ".join(refused) or "there is no home folder"
    _warn(
        "compiled code is not kept, so each command compiles anew; set PODUSV_CACHE to a folder "
        f"that only you can write to ({reasons})"
    )
    return None


def _warn(text: str) -> None:
    logging.getLogger("podusv").warning("podusv: %s", visible(text))


def write(path: Path, content: bytes) -> None:
    """Make or replace a file; it is whole, whoever else writes or reads it. Raises OSError."""
    part = path.with_name(temporary_name())
    try:
        part.write_bytes(content)
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def _demand(true: bool, otherwise: str) -> None:
    if not true:
        raise PermissionError(0, otherwise)


def _roots() -> Iterator[Path]:
    if given := os.environ.get("PODUSV_CACHE"):
        yield Path(given).absolute()
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    if os.path.isabs(home):  # without a home it is `~`, which is no place to make a folder
        yield Path(home, "podusv")


def _made(root: Path, name: str) -> Path:
    """The folder, there, safe, marked, and rid of what is old. Raises OSError."""
    _check(root)
    root.mkdir(parents=True, exist_ok=True, mode=0o700)
    folder = root / name
    folder.mkdir(exist_ok=True, mode=0o700)
    _check(folder)  # and the root, which somebody else may have made just now
    if not _is_marked(folder):
        write(folder / MARK, MARKED)
    _forget_old(folder)
    remove_abandoned_files(folder)
    return folder


def _check(root: Path) -> None:
    """PermissionError where others can put something in place of this folder or of one above it.

    The way there is looked at as it is written, and as it is with all links resolved.
    """
    real = Path(os.path.realpath(root))
    for path in dict.fromkeys((root, *root.parents, real, *real.parents)):
        with suppress(FileNotFoundError):
            found = path.lstat()
            owners = {os.getuid()} if path == real else {os.getuid(), 0}
            _demand(path != real or stat.S_ISDIR(found.st_mode), f"{path} is not a folder")
            _demand(found.st_uid in owners, f"another user owns {path}")
            _demand(not _open_to_others(found), f"others can write to {path}")


def _open_to_others(found: os.stat_result) -> bool:
    if stat.S_ISLNK(found.st_mode) or found.st_mode & stat.S_ISVTX:  # as /tmp: names are safe there
        return False
    grouped = found.st_mode & stat.S_IWGRP and not _is_own_group(found.st_gid)
    return bool(found.st_mode & stat.S_IWOTH or grouped)


def _is_own_group(number: int) -> bool:
    """Whether the group has the user's name and nobody else in it, as many systems make them."""
    with suppress(KeyError):
        group, user = grp.getgrgid(number), pwd.getpwuid(os.getuid()).pw_name
        return group.gr_name == user and set(group.gr_mem) <= {user}
    return False


def _is_marked(folder: Path) -> bool:
    with suppress(OSError):
        return (folder / MARK).read_bytes() == MARKED
    return False


def _forget_old(current: Path) -> None:
    """Remove the folders that were used longest ago, of those that bear the mark of podusv."""
    alike = [path for path in current.parent.iterdir() if DIGEST.fullmatch(path.name)]
    caches = [path for path in alike if path != current and _is_marked(path)]
    for old in sorted(caches, key=lambda path: -path.stat().st_mtime)[KEPT:]:
        shutil.rmtree(old, ignore_errors=True)
