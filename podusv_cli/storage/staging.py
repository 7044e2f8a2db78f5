"""Atomic folders: filled under a hidden name beside their final place, then renamed.

The hidden folder `<box>/new` is filled. To replace an older folder the two are exchanged by one
system call; where the file system has none, the older one is first renamed to `<box>/old`.
"""

from __future__ import annotations

import ctypes
import errno
import os
import shutil
from contextlib import suppress
from pathlib import Path

from podusv_cli.core.errors import StorageError
from podusv_cli.core.system import rename_folder
from podusv_cli.process.temporary_names import find_abandoned, temporary_name
from podusv_cli.storage import files

# What systems answer where the name is that of a folder with files, or of a file.
_TAKEN = (errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR)
# Nothing to exchange with, or no exchange on this system or file system.
_NO_EXCHANGE = (errno.ENOENT, errno.ENOSYS, errno.EINVAL, errno.ENOTSUP)


class Taken(StorageError):
    """The name belongs to something that must not be replaced."""


class Staging:
    """An unfinished folder: `folder` is where to fill it, `final` its later path."""

    def __init__(self, final: Path) -> None:
        """Make the hidden folder beside the `final` path, and its parents. Raises StorageError."""
        self.final = final
        self._box = final.with_name(temporary_name(final.name))
        try:
            with files.storage_errors(f"cannot make {final}"):
                final.parent.mkdir(parents=True, exist_ok=True)
                self._box.mkdir()
                self.folder.mkdir()
        # An interrupt, too, must leave nothing behind.
        except BaseException:
            self.discard()
            raise

    @property
    def folder(self) -> Path:
        """The unfinished folder."""
        return self._box / "new"

    def publish(self, *, replace: bool) -> None:
        """Rename the folder to its final name; with `replace` an older folder is replaced.

        Raises StorageError; `discard` then restores the older folder. After Taken the unfinished
        folder is complete and may be given another `final` path.
        """
        with files.storage_errors(f"cannot make {self.final}"):
            try:
                self._rename()
            except Taken:
                if not replace:
                    raise
                self._replace()
        # After an exchange the older folder lies in the box, and goes with it.
        self.discard()
        files.sync_folder(self.final.parent)

    def discard(self) -> None:
        """Delete the unfinished folder and restore an older one that was not replaced."""
        _remove_box(self._box, self.final)

    def _rename(self) -> None:
        """Give the folder its final name. Raises Taken where something has it."""
        try:
            rename_folder(self.folder, self.final)
        except OSError as error:
            if error.errno not in _TAKEN:
                raise
            # Renaming replaces no folder but an empty one, so nothing can be lost by trying.
            text = f"{self.final} is there already and is left as it is"
            raise Taken(text) from error

    def _replace(self) -> None:
        """Put the folder in place of the old one, in one step where the system can.

        Else the old one waits in the box, from where `discard` brings it back if the second step
        fails.
        """
        if not self._exchange():
            # Another process may have moved the old one away.
            with suppress(FileNotFoundError):
                rename_folder(self.final, _old(self._box))
            self._rename()

    def _exchange(self) -> bool:
        """Swap new and old in one step; False where the file system cannot."""
        try:
            exchange(self.folder, self.final)
        except OSError as error:
            if error.errno not in _NO_EXCHANGE:
                raise
            return False
        return True


def exchange(one: Path, other: Path) -> None:
    """Exchange two paths by one system call, which Python has not.

    Raises OSError, with ENOSYS where there is no such call.
    """
    own = ctypes.CDLL(None, use_errno=True) if os.name == "posix" else None
    rename = getattr(own, "renameat2", None)
    if rename is None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    here, swapping = -100, 2  # AT_FDCWD, RENAME_EXCHANGE
    if rename(here, os.fsencode(one), here, os.fsencode(other), swapping) != 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


def remove_abandoned(parent: Path) -> None:
    """Delete unfinished folders of killed processes; restore folders that they were replacing."""
    for box, final in find_abandoned(parent):
        if final:
            _remove_box(box, parent / final)


def _remove_box(box: Path, final: Path) -> None:
    """Delete a box; an old folder in it that was not replaced is restored to `final`.

    It was replaced if something is at `final`.
    """
    with suppress(OSError):
        if _old(box).exists():
            # Renamed before it is deleted, so that half of a folder is never restored.
            rename_folder(_old(box), box / "replaced" if final.exists() else final)
        shutil.rmtree(box, ignore_errors=True)


def _old(box: Path) -> Path:
    """Where a folder waits that is being replaced."""
    return box / "old"
