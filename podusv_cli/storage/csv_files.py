"""CSV files, in which no cell and no heading is a formula of a spreadsheet."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from io import StringIO
from typing import TYPE_CHECKING, Any

from podusv_cli.core import escaping

if TYPE_CHECKING:
    import pandas as pd


def lines(rows: Iterable[Sequence[object]], digits: str | None = None) -> str:
    """Rows of a short table as CSV, the headings first; numbers as `text` has them.

    With `digits`, a format such as `%.6g`, an unknown number is an empty cell, too.
    """

    def cell(content: object) -> object:
        """A cell as csv writes it; NaN as an empty one where there are `digits`."""
        if isinstance(content, str):
            return escaping.csv(content)
        if digits and isinstance(content, float):
            return "" if math.isnan(content) else digits % content
        return content

    written = StringIO()
    csv.writer(written, lineterminator="\n").writerows(map(cell, row) for row in rows)
    return written.getvalue()


def records(rows: Sequence[Mapping[str, object]], digits: str | None = None) -> str:
    """As `lines`, of rows by the names of their columns, the same in all; none without a row."""
    heads = list(rows[0]) if rows else []
    return lines([heads, *(list(row.values()) for row in rows)], digits)


def text(frame: pd.DataFrame, digits: str | None = None) -> str:
    """A table as CSV without its index; numbers in full precision, or in `digits` such as `%.6g`.

    An infinite number is `inf`, an unknown one empty.
    """
    escaped = cache(escaping.csv)  # a column of a long table repeats few words

    def cell(content: Any) -> Any:
        """A cell, escaped where it is a text."""
        return escaped(content) if isinstance(content, str) else content

    words = [name for name in frame.columns if frame[name].dtype.kind not in "biuf"]
    shown = frame.assign(**{name: frame[name].map(cell) for name in words})
    heads = [escaping.csv(str(name)) for name in frame.columns]
    return shown.to_csv(index=False, header=heads, float_format=digits, lineterminator="\n")
