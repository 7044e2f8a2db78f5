"""Folders that appear whole: filled under a hidden name beside their place, then renamed.

A box, whose hidden name says who made it, holds `new`, the folder in the making. A folder that it
replaces trades places with it at one instant; where the file system cannot do that, the box holds
it for a moment as `old`.
"""

from __future__ import annotations

import ctypes
import errno
import os
import shutil
from contextlib import suppress
from pathlib import Path

from podusv_cli.core.errors import StorageError
from podusv_cli.process.temporary_names import abandoned, part_name
from podusv_cli.storage import files

_TAKEN = (errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR)
# There is nothing to trade places with, or a system or file system that cannot.
_NO_EXCHANGE = (errno.ENOENT, errno.ENOSYS, errno.EINVAL, errno.ENOTSUP)


class Taken(StorageError):
    """Something has that name already, and is not to be replaced."""


class Staging:
    """A folder in the making; `folder` is where to fill it, `final` what it will be called."""

    def __init__(self, final: Path) -> None:
        """Make the box, and the folders above it. Raises StorageError where that is impossible."""
        self.final = final
        self._box = final.with_name(part_name(final.name))
        try:
            with files.explained(f"cannot make {final}"):
                final.parent.mkdir(parents=True, exist_ok=True)
                self._box.mkdir()
                self.folder.mkdir()
        except BaseException:
            self.discard()
            raise

    @property
    def folder(self) -> Path:
        """The folder in the making."""
        return self._box / "new"

    def publish(self, *, replace: bool) -> None:
        """Rename the folder to its final name, with `replace` in place of what is there.

        Raises StorageError; `discard` then brings back what was there before. After Taken the
        folder in the making is whole and may be given another `final` name.
        """
        with files.explained(f"cannot make {self.final}"):
            try:
                self._rename()
            except Taken:
                if not replace:
                    raise
                self._replace()
        self.discard()
        files.sync_folder(self.final.parent)

    def discard(self) -> None:
        """Leave nothing behind, and what was there before as it was."""
        _settle(self._box, self.final)

    def _rename(self) -> None:
        try:
            os.rename(self.folder, self.final)
        except OSError as error:
            if error.errno not in _TAKEN:
                raise
            text = f"{self.final} is there already and is left as it is"
            raise Taken(text) from error

    def _replace(self) -> None:
        if not self._exchanged():
            with suppress(FileNotFoundError):
                os.rename(self.final, _old(self._box))
            self._rename()

    def _exchanged(self) -> bool:
        try:
            exchange(self.folder, self.final)
        except OSError as error:
            if error.errno not in _NO_EXCHANGE:
                raise
            return False
        return True


def exchange(one: Path, other: Path) -> None:
    """Two names trade places at one instant. OSError, ENOSYS where the system has no such call."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    here, swapping = -100, 2  # AT_FDCWD, RENAME_EXCHANGE
    if rename(here, os.fsencode(one), here, os.fsencode(other), swapping) != 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


def sweep(parent: Path) -> None:
    """Clear away the boxes in `parent` whose makers are dead, and put back what they replaced."""
    for box, final in abandoned(parent):
        if final:
            _settle(box, parent / final)


def _settle(box: Path, final: Path) -> None:
    """Remove a box; an old folder in it that was not replaced after all comes back."""
    with suppress(OSError):
        if _old(box).exists():
            # Renamed before it is deleted: half of a folder must not come back.
            os.rename(_old(box), box / "replaced" if final.exists() else final)
        shutil.rmtree(box, ignore_errors=True)


def _old(box: Path) -> Path:
    return box / "old"
