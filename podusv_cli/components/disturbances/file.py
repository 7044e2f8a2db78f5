"""A recorded load."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import field_validator, model_validator

from podusv_cli.components.disturbances.base import Disturbance
from podusv_cli.core.component import value
from podusv_cli.core.interpolation import linear, segment
from podusv_cli.core.kernel import Vector, kernel, tail
from podusv_cli.core.timed_rows import timed_rows

LAYOUTS = {4: ("t [s]", "b_u [N]", "b_v [N]", "b_r [N m]")}


@lru_cache(maxsize=4)  # one record is read a dozen times in a run
def _rows(text: str) -> Vector:
    """The rows t [s], b_u [N], b_v [N], b_r [N m] of a text (rows, 4). Raises ValueError."""
    rows = timed_rows(text, "the record", LAYOUTS)
    # The cache hands the same rows to every run
    rows.flags.writeable = False
    return rows


class FromFile(Disturbance):
    """A recorded load, in straight lines between its rows.

    Before the first and after the last row the nearest row holds, as with the law `schedule`: a
    record that is to end in calm water ends with a row of zeros.
    """

    of_time: ClassVar[bool] = True
    kind: Literal["file"] = "file"
    texts_of: ClassVar[dict[str, str]] = {"file": "rows"}
    file: str | None = value(None, "", "CSV file beside the scenario; its text is read into `rows`")
    rows: str = value("", "", "lines of t [s], b_u [N], b_v [N], b_r [N m], times increasing")

    @field_validator("rows")
    @classmethod
    def _readable(cls, rows: str) -> str:
        """The text as it is. Raises ValueError where it cannot be read as rows of loads."""
        _rows(rows)
        return rows

    @model_validator(mode="after")
    def _check_content(self) -> Self:
        """Raises ValueError where no file is named."""
        if not self.rows:
            raise ValueError("file is missing; name a CSV file with columns t, b_u, b_v, b_r")
        return self

    def constants(self) -> dict[str, float]:
        """How many rows there are, for the kernel."""
        return {"count": float(len(_rows(self.rows)))}

    def table(self) -> Vector:
        """The times [s], then the loads [N, N, N m] row by row: (4 rows,)."""
        rows = _rows(self.rows)
        return np.concatenate([rows[:, 0], rows[:, 1:].ravel()])

    def bounds(self) -> tuple[float, float, float]:
        """The largest magnitudes that are recorded [N, N, N m]."""
        u, v, r = np.abs(_rows(self.rows)[:, 1:]).max(axis=0).tolist()
        return u, v, r

    # t [s]; table: `count` times [s], then as many loads (3). Writes b (3) [N, N, N m]; beyond the
    # rows the nearest one's.
    @staticmethod
    @kernel
    def evaluate(t: float, k: Any, table: Vector, b: Vector) -> None:
        """The load between the two rows around t."""
        count = int(k.count)
        i = min(segment(t, count, table), count - 2)
        s = min(max((t - table[i]) / (table[i + 1] - table[i]), 0.0), 1.0)
        before, after = tail(table, count + 3 * i), tail(table, count + 3 * (i + 1))
        for j in range(3):
            b[j] = linear(s, before[j], after[j])
