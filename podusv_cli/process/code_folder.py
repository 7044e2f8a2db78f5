"""The folder where compiled code is kept: one that nobody but its user can write to.

Whoever can write a piece of compiled code has it run by the next command. So others must not be
able to write into the folder, nor into the one that it lies in.
"""

from __future__ import annotations

import logging
import os
import re
import shutil
import stat
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

from podusv_cli.core.escaping import visible
from podusv_cli.core.system import belongs_to_user
from podusv_cli.process.temporary_names import remove_abandoned_files, temporary_name

KEPT = 2  # folders of this many other states of what translates kernels stay on disk
PIECES = 4000  # of compiled code in a folder; of more the oldest are removed
OTHERS = stat.S_IWGRP | stat.S_IWOTH
DIGEST = re.compile(r"[0-9a-f]{16}")
# By this name and first line other programs know a cache; the second line says that it is ours.
MARK = "CACHEDIR.TAG"
MARKED = b"Signature: 8a477f597d28d172789f06886806bc55\n# Compiled code of podusv.\n"


@cache
def code_folder(name: str) -> Path | None:
    """The folder `name` in $PODUSV_CACHE, else in podusv under $XDG_CACHE_HOME or ~/.cache.

    On Windows under %LOCALAPPDATA% in place of the last. It is made if it is not there; None where
    no place will do. A line on stderr says why a place was passed over, and what is used.
    """
    refused = []
    for root in _roots():
        try:
            folder = _make_folder(root, name)
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
    """Warn the user, in one line."""
    logging.getLogger("podusv").warning("podusv: %s", visible(text))


def write(path: Path, content: bytes) -> None:
    """Make or replace the file `path`; it is whole, whoever else writes or reads it.

    Raises OSError. Renaming within a folder is one step.
    """
    part = path.with_name(temporary_name())
    try:
        part.write_bytes(content)
        part.replace(path)
    # Also on Ctrl+C, which would leave the part behind.
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def _demand(true: bool, otherwise: str) -> None:
    """Raises PermissionError with the text `otherwise` unless something is `true`."""
    if not true:
        raise PermissionError(0, otherwise)


def _roots() -> Iterator[Path]:
    """The folders in which code may be kept, the user's own choice first."""
    if given := os.environ.get("PODUSV_CACHE"):
        yield Path(given).absolute()
    local = os.environ.get("LOCALAPPDATA") if os.name == "nt" else None
    home = os.environ.get("XDG_CACHE_HOME") or local or os.path.expanduser("~/.cache")
    if os.path.isabs(home):  # without a home it is `~`, which is no place to make a folder
        yield Path(home, "podusv")


def _make_folder(root: Path, name: str) -> Path:
    """The folder `name` in `root`: there, safe, marked, and rid of what is old. Raises OSError."""
    _check(root)  # before anything is made in a folder that is not the user's
    root.mkdir(parents=True, exist_ok=True, mode=0o700)
    folder = root / name
    folder.mkdir(exist_ok=True, mode=0o700)
    _check(folder)  # and the root, which somebody else may have made just now
    if not _is_marked(folder):
        write(folder / MARK, MARKED)
    _forget_old(folder)
    _forget_pieces(folder)
    remove_abandoned_files(folder)
    return folder


def _check(folder: Path) -> None:
    """Raises PermissionError where somebody else owns this folder or can write into it.

    A folder that is not there yet will do.
    """
    with suppress(FileNotFoundError):
        status = folder.stat()
        _demand(stat.S_ISDIR(status.st_mode), f"{folder} is not a folder")
        _demand(belongs_to_user(status), f"another user owns {folder}")
        _demand(
            os.name == "nt" or not status.st_mode & OTHERS,
            f"others can write to {folder}: chmod go-w {folder}",
        )


def _is_marked(folder: Path) -> bool:
    """Whether podusv made this folder; it removes nothing from any other."""
    with suppress(OSError):
        return (folder / MARK).read_bytes() == MARKED
    return False


def _forget_old(current: Path) -> None:
    """Remove the folders that were used longest ago, of those that bear the mark of podusv."""
    alike = [path for path in current.parent.iterdir() if DIGEST.fullmatch(path.name)]
    caches = [path for path in alike if path != current and _is_marked(path)]
    for old in sorted(caches, key=lambda path: -path.stat().st_mtime)[KEPT:]:
        shutil.rmtree(old, ignore_errors=True)


def _forget_pieces(folder: Path) -> None:
    """Remove the pieces that were made longest ago, of more than `PIECES`."""
    pieces = list(folder.glob("*.code"))
    if len(pieces) > PIECES:
        for old in sorted(pieces, key=lambda path: -path.stat().st_mtime)[PIECES // 2 :]:
            old.unlink(missing_ok=True)
