"""What a file of a log holds before anybody knows what its columns mean."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import Vector

Columns = Mapping[str, Vector]
LISTED = 30  # columns that a message names


class LogFault(UsageError):
    """Logs cannot be used as they are; a sentence each says where, why, and what may help."""

    def __str__(self) -> str:
        """The sentences below each other."""
        return "\n".join(self.lines())

    def lines(self) -> list[str]:
        """A line a sentence."""
        return [str(sentence) for sentence in self.args]


@dataclass(frozen=True)
class Contents:
    """The columns of a file by the names that it gives them, NaN where a value is missing.

    `doubts` say of a column which of its cells are no numbers, `warnings` what is wrong with the
    whole file; neither names the file.
    """

    columns: Columns
    doubts: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()


def list_names(columns: Iterable[str]) -> str:
    """The first of the names, and how many more there are."""
    names = list(columns)
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return ", ".join(names[:LISTED]) + more
