"""What can go wrong, as values with an exit code and a sentence for the user."""

from __future__ import annotations

import traceback
from collections.abc import Hashable, Sequence
from pathlib import Path

from podusv_cli.core.escaping import visible


class PodusvError(Exception):
    """A failure that podusv explains in one line; anything else is a bug (exit code 1)."""

    exit_code = 1

    def lines(self) -> list[str]:
        """The lines to be shown; a name in one of them may hold anything, a new line too."""
        return [str(self)]


class ScenarioError(PodusvError):
    """A scenario that cannot be run; carries every fault at once."""

    exit_code = 2

    def __init__(self, faults: Sequence[Hashable]) -> None:
        """Take the faults; the text of each says place, key and what is wrong."""
        self.faults = faults
        super().__init__("\n".join(self.lines()))

    def lines(self) -> list[str]:
        """One line for each fault."""
        return [str(fault) for fault in self.faults]


class UsageError(PodusvError):
    """A command that was asked for what it does not have."""

    exit_code = 2


class StorageError(PodusvError):
    """Reading or writing failed: disk full, not writable, missing or damaged file."""

    exit_code = 5


class NotConvergedError(PodusvError):
    """A computation that did not come to a number that could be relied on."""

    exit_code = 3


class SizingError(PodusvError):
    """Hull and actuator do not give a number for a default that follows from them."""

    exit_code = 2


class LawError(PodusvError):
    """A law, or another component, that does not keep to its declaration or fails when asked."""

    exit_code = 2


def in_a_line(error: BaseException) -> str:
    """What was raised, in what words and where: `KeyError: 'gain' (pid.py, line 60)`."""
    frames = traceback.extract_tb(error.__traceback__)
    where = f" ({Path(frames[-1].filename).name}, line {frames[-1].lineno})" if frames else ""
    return visible(f"{type(error).__name__}: {' '.join(str(error).split())}{where}")
