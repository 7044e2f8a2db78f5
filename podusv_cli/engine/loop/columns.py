"""The columns of a table of logged rows as signals."""

from __future__ import annotations

from collections.abc import Mapping

from podusv_cli.core.kernel import Vector
from podusv_cli.core.signal import Signal


def by_name(labels: list[str], table: Vector, about: Mapping[str, Signal]) -> dict[str, Vector]:
    """The columns of a table by name (rows,); those of a vector together (rows, size).

    `labels` names every column; the numbers of a vector have one name and lie side by side. All are
    views of the table.
    """
    vectors = {name for name, part in about.items() if part.axes}
    columns: dict[str, list[int]] = {}
    for column, name in enumerate(labels):
        columns.setdefault(name, []).append(column)
    return {
        name: table[:, at[0] : at[-1] + 1] if name in vectors else table[:, at[0]]
        for name, at in columns.items()
    }
