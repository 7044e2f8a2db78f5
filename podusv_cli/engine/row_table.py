"""The march's rows: in one table, or a piece at a time, handed on where the table is full."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Columns
from podusv_cli.engine.closed_loop import Plan
from podusv_cli.engine.grid import TimeGrid

NUMBER = 8  # bytes
PIECE = 32 * 2**20  # bytes of rows that are held where they go on to columns


def rows_held(plan: Plan, grid: TimeGrid, most: int) -> int:
    """How many whole rows of this loop `most` bytes hold, at least one, at most all."""
    return max(1, min(grid.rows, most // (NUMBER * plan.width)))


class Pieces:
    """Rows of a march: a table that is filled again and again, and columns for what was in it.

    Without columns the table has to hold all rows.
    """

    def __init__(
        self, plan: Plan, log: Vector, columns: Columns | None,
        named: Callable[[Vector], Mapping[str, Vector]],
    ) -> None:  # fmt: skip
        """`log` is where the march writes; `named` gives the signals in some rows of it."""
        self._plan, self._columns, self._named = plan, columns, named
        self._table = log.reshape(-1, plan.width)
        self._handed = 0  # rows that the columns have

    @property
    def plan(self) -> Plan:
        """The layout with the row that the table begins with."""
        return self._plan._replace(first_row=self._handed)

    def ranges(self) -> Iterator[tuple[int, int]]:
        """Ranges of instants whose rows fit into the table; between two they are handed on."""
        first, end = 0, self._plan.steps + 1
        while first < end:
            border = (self._handed + len(self._table)) * self._plan.log_every
            yield first, min(border, end)
            if border < end:
                self.hand_on(border)
            first = border

    def hand_on(self, reached: int) -> None:
        """Append the rows of the instants before `reached` to the columns."""
        if self._columns is not None:
            rows = self._rows(reached)
            self._columns.append(self._named(self._table[: rows - self._handed]))
            self._handed = rows

    def signals(self, reached: int) -> Mapping[str, Vector]:
        """All signals of the instants before `reached`."""
        if self._columns is None:
            return self._named(self._table[: self._rows(reached)])
        self.hand_on(reached)
        return self._columns.whole()

    def _rows(self, reached: int) -> int:
        return -(-reached // self._plan.log_every)
