"""CSV files as loggers write them: columns of numbers by name, and what is wrong with them.

No library guesses here: a row has as many cells as there are names, a decimal comma is replaced
before numbers are read, and cells that are no numbers are counted.
"""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from itertools import compress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.identify.logs.contents import Contents, LogFault

SEPARATORS = ",;\t|"
NAMED_SEPARATOR = re.compile(r'"?sep=([,;\t| ])"?', re.IGNORECASE)  # a first line of Excel's
COMMENTS = ("#", "//")
SELDOM = 0.05  # of the rows, that may be broken
UNNAMED = "column "  # and its number: the name of a column without one
AS_COMMENT = "delete it, or write # before it"
LONG = 60  # characters of a line that a message shows
SHOWN = 20  # characters of a cell that a message shows
BOMS = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16", b"\xef\xbb\xbf": "utf-8-sig"}
EXPONENT = r"(?:[eE][-+]?\d+)?"
NUMBER = re.compile(rf"[-+]?(?:\d+\.?\d*|\.\d+){EXPONENT}", re.ASCII)
WITH_COMMA = re.compile(rf"^ *[-+]?\d*,\d+{EXPONENT} *$", re.ASCII | re.MULTILINE)
WITH_POINT = re.compile(rf"^ *[-+]?\d*\.\d*{EXPONENT} *$", re.ASCII | re.MULTILINE)
THOUSANDS = re.compile(r"^ *[-+]?[1-9]\d{0,2}(?:,\d{3})+ *$", re.ASCII | re.MULTILINE)
MISSING = {"", "nan", "-nan", "na", "n/a", "null", "none", "<na>"}
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
DATE = re.compile(r"\d{4}-\d\d-\d\d")
CLOCK_TIME = re.compile(r"\d{1,2}:\d\d(:\d\d([.,]\d+)?)?")


class FileLine(NamedTuple):
    """A line of a file: its number from 1, and its cells; none where they cannot be told apart."""

    number: int
    cells: Sequence[str]


def read_csv(path: Path) -> Contents:
    """The columns of a CSV file, whose first line names them; NaN for what is no number.

    Separated by commas, semicolons, tabs, bars or blanks; decimal points or commas. Dates, as
    2026-05-04T10:00:00Z, become seconds since 1970. Raises LogFault.
    """
    try:
        text = decode_text(path.read_bytes())
    except OSError as error:
        raise LogFault(f"{path}: cannot be read: {error.strerror}") from error
    head, *body = list(_lines(text)) or [FileLine(1, ())]
    names = _names(path, head)
    rows, warnings = _whole_rows(path, names, body, head.number)
    _check_title(path, head, rows)
    if not text.endswith(("\n", "\r")) and rows and rows[-1] is body[-1]:
        warnings.append(
            f"its last line ({rows.pop().number}) has no line end and may be cut; it is left out"
        )
    texts = {name: [line.cells[i] for line in rows] for i, name in enumerate(names)}
    texts = {n: cells for n, cells in texts.items() if any(cells) or not n.startswith(UNNAMED)}
    comma, numbers = _has_decimal_commas(path, texts), [line.number for line in rows]
    read = {name: _column(cells, numbers, comma=comma) for name, cells in texts.items()}
    return Contents(
        {name: values for name, (values, _) in read.items()},
        {name: doubt for name, (_, doubt) in read.items() if doubt},
        tuple(warnings),
    )


def decode_text(content: bytes) -> str:
    """The text of a file: UTF-16 where it says so, else UTF-8, else one byte a character."""
    encoding = next((name for bom, name in BOMS.items() if content.startswith(bom)), "utf-8")
    try:
        return content.decode(encoding)
    except UnicodeDecodeError:  # digits and separators are the same in all of these
        return content.decode("latin-1" if encoding == "utf-8" else encoding, errors="replace")


def _lines(text: str) -> Iterator[FileLine]:
    """The lines but empty ones and comments; the first tells what separates cells.

    It is not among them where it is no more than `sep=;`, as Excel writes it.
    """
    separator = None
    for number, line in enumerate(io.StringIO(text, newline=None), 1):
        if not line.strip() or line.lstrip().startswith(COMMENTS):
            continue
        if separator is None and (named := NAMED_SEPARATOR.fullmatch(line.rstrip("\n"))):
            separator = named[1]
            continue
        if separator is None:
            separator = max(SEPARATORS, key=line.count)
            separator = separator if separator in line else " "
        yield FileLine(number, _cells(line.rstrip("\n"), separator))


def _cells(line: str, separator: str) -> Sequence[str]:
    """The cells of a line without blanks at their ends; none where a quote is not closed."""
    if "\0" in line:
        return ()
    if separator == " ":
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    try:
        (cells,) = csv.reader([line], delimiter=separator, skipinitialspace=True, strict=True)
    except csv.Error:
        return ()
    return [cell.strip() for cell in cells]


def _names(path: Path, head: FileLine) -> list[str]:
    """The names in the first line, without empty ones at its end. Raises LogFault."""
    names = [" ".join(name.split()) for name in head.cells]
    where = f"{path}: line {head.number}, its first,"
    if not any(names):
        raise LogFault(f"{where} names no columns; is it UTF-16 without a mark? Save it as UTF-8")
    if sum(map(_is_number, names)) > len(names) / 2:
        raise LogFault(f"{where} has numbers and no names; write a line such as time,x,y,psi above")
    ((name, count),) = Counter(filter(None, names)).most_common(1)
    if count > 1:
        raise LogFault(f"{where} calls {count} columns {name!r}; give each a name of its own")
    while not names[-1]:
        names.pop()
    return [name or f"{UNNAMED}{i}" for i, name in enumerate(names, 1)]


def _check_title(path: Path, head: FileLine, rows: Sequence[FileLine]) -> None:
    """Raises LogFault where numbers stand in the line of names, and names in the next one."""
    if rows and any(map(_is_number, head.cells)) and not any(map(_may_be_value, rows[0].cells)):
        raise LogFault(
            f"{path}: line {head.number} was taken for the names of columns "
            f"({', '.join(head.cells)[:LONG]}), but line {rows[0].number} looks like them; if "
            f"line {head.number} is a title, {AS_COMMENT}"
        )


def _may_be_value(cell: str) -> bool:
    return _is_number(cell) or cell.lower() in MISSING or bool(DATE.match(cell))


def _is_number(cell: str) -> bool:
    return bool(NUMBER.fullmatch(cell.replace(",", ".")))


def _whole_rows(
    path: Path, names: Sequence[str], body: Sequence[FileLine], head: int
) -> tuple[list[FileLine], list[str]]:
    """The lines with a cell a name, and a sentence on the others. Raises LogFault.

    `head` is the number of the line with the names.
    Cells beyond the names are allowed where they are empty; the last line may be cut.
    """
    count = len(names)
    whole = [len(line.cells) >= count and not any(line.cells[count:]) for line in body]
    rows = [*compress(body, whole)]
    broken = [line for line, fits in zip(body, whole, strict=True) if not fits]
    if not broken:
        return rows, []
    first = broken[0]
    cells = "1 cell" if len(first.cells) == 1 else f"{len(first.cells)} cells"
    found = cells if first.cells else "no separate cells"
    what = f"line {first.number} has {found}, and there are {count} names"
    if len(broken) > max(1.0, SELDOM * len(body)):
        names_listed = ", ".join(names[:6]) + (", ..." if count > 6 else "")
        hint = (
            "decimal commas need a semicolon between cells"
            if len(first.cells) >= 2 * count - 1
            else "write one value under each name"
        )
        raise LogFault(
            f"{path}: {len(broken)} of {len(body)} lines do not have one cell for each name "
            f"({names_listed}): {what}; {hint}; line {head} was taken for the names, so if it is a "
            f"title or a comment, {AS_COMMENT}"
        )
    lines = "1 line is" if len(broken) == 1 else f"{len(broken)} lines are"
    return rows, [f"{lines} left out for the number of cells: {what}"]


def _has_decimal_commas(path: Path, texts: Mapping[str, Sequence[str]]) -> bool:
    """Whether a comma is the decimal mark of the numbers. Raises LogFault where nobody knows."""
    joined = ["\n".join(cells) for cells in texts.values()]
    commas = [cell for text in joined if "," in text for cell in WITH_COMMA.findall(text)]
    if not commas:
        return False
    points = sum(len(WITH_POINT.findall(text)) for text in joined)
    if all(map(THOUSANDS.match, commas)):
        if points:
            return False
        raise LogFault(
            f"{path}: {commas[0].strip()!r} may be thousands or have a decimal comma; write "
            "numbers without marks of thousands and with decimal points"
        )
    return len(commas) > points


def _column(cells: Sequence[str], lines: Sequence[int], *, comma: bool) -> tuple[Vector, str]:
    """The numbers of a column, and which of its cells are none; "" where all are.

    In a file with decimal commas a cell with a point is no number.
    """
    plain = [c.replace(".", "_").replace(",", ".") for c in cells] if comma else cells
    values = _numbers(plain)
    values[np.isinf(values)] = np.nan
    unread = np.flatnonzero(np.isnan(values)).tolist()
    bad = [i for i in unread if cells[i].lower() not in MISSING]
    if not bad:
        return values, ""
    first = cells[bad[0]]
    if not np.isfinite(values).any() and DATE.match(first):
        return _seconds(cells)
    if not np.isfinite(values).any() and CLOCK_TIME.fullmatch(first):
        return values, (
            f"has clock times such as {first!r}; write seconds, or dates such as "
            "2026-05-04T12:00:00Z"
        )
    what = "1 cell that is no number" if len(bad) == 1 else f"{len(bad)} cells that are no numbers"
    return values, f"has {what}, the first {first[:SHOWN]!r} in line {lines[bad[0]]}"


def _numbers(cells: Sequence[str]) -> Vector:
    """The numbers in cells, NaN for what is none."""
    try:
        values = np.array([cell or "nan" for cell in cells], float)
    except ValueError:
        values = np.array([float(c) if NUMBER.fullmatch(c) else np.nan for c in cells])
    else:
        odd = [i for i, c in enumerate(cells) if "_" in c or not c.isascii()]  # Python takes these
        values[odd] = np.nan
    return values


def _seconds(cells: Sequence[str]) -> tuple[Vector, str]:
    """Dates as seconds since 1970, NaN for what is none; words about these, if there are any.

    Dates without a zone are those of UTC; an empty cell is NaN without a word.
    """
    import pandas as pd  # slow to import

    dates = pd.to_datetime(pd.Series(cells), errors="coerce", format="ISO8601", utc=True)
    values = np.asarray((dates - EPOCH).dt.total_seconds(), float)
    bad = sum(bool(c) and not np.isfinite(x) for c, x in zip(cells, values, strict=True))
    return values, f"has {bad} cells that are no dates" if bad else ""
