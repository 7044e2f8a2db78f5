"""Folders that appear whole: filled under a hidden name beside their place, then renamed.

A box `.<name>.podusv-<machine>-<process>-<random>.part` holds `new`, the folder in the making, and
for a moment `old`, the folder that it replaces. The box's own name says who made it, so that no
instant exists at which it belongs to nobody.
"""

from __future__ import annotations

import errno
import hashlib
import os
import platform
import re
import secrets
import shutil
from contextlib import suppress
from pathlib import Path

from podusv_cli.errors import StorageError
from podusv_cli.logbook import atomic

_BOX = re.compile(
    r"\.(?P<name>.+)\.podusv-(?P<machine>[0-9a-f]{8})-(?P<process>[0-9]+)-[0-9a-f]{8}\.part"
)
_TAKEN = (errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR)


class Staging:
    """A folder in the making; `folder` is where to fill it, `final` what it will be called."""

    def __init__(self, final: Path) -> None:
        """Make the box, and the folders above it. Raises StorageError where that is impossible."""
        owner = f"{_machine()}-{os.getpid()}-{secrets.token_hex(4)}"
        self.final = final
        self._box = final.with_name(f".{final.name}.podusv-{owner}.part")
        try:
            with atomic.explained(f"cannot make {final}"):
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

        Raises StorageError; what was there before is then there again.
        """
        try:
            with atomic.explained(f"cannot make {self.final}"):
                if replace:
                    with suppress(FileNotFoundError):
                        os.rename(self.final, _old(self._box))
                self._rename()
        finally:
            _settle(self._box, self.final)
        atomic.sync_folder(self.final.parent)

    def discard(self) -> None:
        """Leave nothing behind, and what was there before as it was."""
        _settle(self._box, self.final)

    def _rename(self) -> None:
        try:
            os.rename(self.folder, self.final)
        except OSError as error:
            if error.errno not in _TAKEN:
                raise
            text = f"{self.final} was made by somebody else in the meantime and is left as it is"
            raise StorageError(text) from error


def sweep(parent: Path) -> None:
    """Clear away the boxes in `parent` whose makers are dead, and put back what they replaced.

    Boxes of other machines are left alone: nobody here can tell whether their makers live.
    """
    with suppress(OSError):
        for entry in list(os.scandir(parent)):
            found = _BOX.fullmatch(entry.name)
            if found and found["machine"] == _machine() and not _alive(int(found["process"])):
                _settle(Path(entry.path), parent / found["name"])


def _settle(box: Path, final: Path) -> None:
    """Remove a box; an old folder in it that was not replaced after all comes back."""
    with suppress(OSError):
        if _old(box).exists():
            # Renamed before it is deleted: half of a folder must not come back.
            os.rename(_old(box), box / "replaced" if final.exists() else final)
        shutil.rmtree(box, ignore_errors=True)


def _old(box: Path) -> Path:
    return box / "old"


def _machine() -> str:
    return hashlib.sha256(platform.node().encode()).hexdigest()[:8]


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # somebody else's, or no process number at all
        return True
    return True
