"""The folder where compiled code is kept: one that nobody but its user can write to.

Whoever can write a piece of compiled code has it run by the next command. So the folder and all
folders above it have to be safe from other users, and every file is opened through its folder, no
link followed, and its owner asked of what was opened.
"""

from __future__ import annotations

import grp
import logging
import os
import pwd
import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

from podusv_cli.core.escaping import visible
from podusv_cli.process.temporary_names import (
    is_temporary_name,
    remove_abandoned_files,
    temporary_name,
)

KEPT = 8  # folders of this many other states of the source stay on disk
DIGEST = re.compile(r"[0-9a-f]{16}")
PIECE = re.compile(r"\w+\.code")
# By this name and first line other programs know a cache; the second line says that it is ours.
MARK = "CACHEDIR.TAG"
MARKED = b"Signature: 8a477f597d28d172789f06886806bc55\n# Compiled code of podusv.\n"
NEW = os.O_CREAT | os.O_EXCL | os.O_WRONLY
OTHERS = stat.S_IWGRP | stat.S_IWOTH


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


def read(path: Path) -> bytes:
    """What a file of the folder holds. Raises OSError, also where others could have written it."""
    with (
        _opened(path.parent, os.O_DIRECTORY) as folder,
        _opened(path.name, 0, folder) as file,
        open(file, "rb", closefd=False) as stream,
    ):
        return stream.read()


def write(path: Path, content: bytes) -> None:
    """Make or replace a file of the folder; it is whole, whoever else writes or reads it now.

    Raises OSError.
    """
    part = temporary_name()
    with _opened(path.parent, os.O_DIRECTORY) as folder:
        try:
            with _opened(part, NEW, folder) as file, open(file, "wb", closefd=False) as stream:
                stream.write(content)
            os.replace(part, path.name, src_dir_fd=folder, dst_dir_fd=folder)
        except BaseException:
            with suppress(OSError):
                os.unlink(part, dir_fd=folder)
            raise


@contextmanager
def _opened(name: Path | str, flags: int, folder: int | None = None) -> Iterator[int]:
    """A descriptor of a file or folder that is the user's own and no link."""
    # Without O_NONBLOCK a pipe of that name would be waited for.
    safe = os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK
    descriptor = os.open(name, flags | safe, 0o600, dir_fd=folder)
    try:
        found = os.fstat(descriptor)
        _demand(found.st_uid == os.getuid(), f"another user owns {name}")
        _demand(not found.st_mode & OTHERS, f"others can write to {name}")
        yield descriptor
    finally:
        os.close(descriptor)


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
    _check(root)  # somebody else may have made it just now
    folder = root / name
    folder.mkdir(exist_ok=True, mode=0o700)
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
        return read(folder / MARK) == MARKED
    return False


def _forget_old(current: Path) -> None:
    """Remove the folders that were used longest ago.

    They may lie among other people's: what bears no mark of podusv, or holds anything else, stays.
    """
    alike = [path for path in current.parent.iterdir() if DIGEST.fullmatch(path.name)]
    caches = [path for path in alike if path != current and _is_marked(path)]
    for old in sorted(caches, key=lambda path: -path.stat().st_mtime)[KEPT:]:
        with suppress(OSError), _opened(old, os.O_DIRECTORY) as folder:
            _remove(old, folder)


def _remove(old: Path, folder: int) -> None:
    names = [entry.name for entry in os.scandir(folder) if entry.is_file(follow_symlinks=False)]
    own = [
        name for name in names if name == MARK or PIECE.fullmatch(name) or is_temporary_name(name)
    ]
    if len(own) < len(os.listdir(folder)):
        return
    for name in own:
        os.unlink(name, dir_fd=folder)
    old.rmdir()
