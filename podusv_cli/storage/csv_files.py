"""CSV files, in which no cell and no heading is a formula of a spreadsheet."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from functools import cache
from io import StringIO
from typing import TYPE_CHECKING, Any

from podusv_cli.core import escaping

if TYPE_CHECKING:
    import pandas as pd


def lines(rows: Iterable[Sequence[object]]) -> str:
    """Rows of a short table, the headings first; numbers in full precision."""
    written = StringIO()
    cells = ([escaping.csv(c) if isinstance(c, str) else c for c in row] for row in rows)
    csv.writer(written, lineterminator="\n").writerows(cells)
    return written.getvalue()


def text(frame: pd.DataFrame, digits: str | None = None) -> str:
    """A table without its index; numbers in full precision, or in this format such as `%.6g`.

    An infinite number is `inf`, an unknown one empty.
    """
    escaped = cache(escaping.csv)  # a column of a long table repeats few words

    def cell(content: Any) -> Any:
        return escaped(content) if isinstance(content, str) else content

    words = [name for name in frame.columns if frame[name].dtype.kind not in "biuf"]
    shown = frame.assign(**{name: frame[name].map(cell) for name in words})
    heads = [escaping.csv(str(name)) for name in frame.columns]
    return shown.to_csv(index=False, header=heads, float_format=digits, lineterminator="\n")
