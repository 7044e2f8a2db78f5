"""Rows of numbers over time, as text with commas."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.units import NUMBER, Scale, spell_unit, units_allowed_for

LARGEST = 900_000  # characters: the resolved scenario, which has the rows, must be readable
NOT_FINITE = re.compile(r"[-+]?(nan|inf|infinity)", re.IGNORECASE)
ScaledUnits = Mapping[tuple[str, str], Scale]  # by column and unit
NONE: ScaledUnits = {}
Layouts = Mapping[int, Sequence[str]]  # by count: the columns' names, as `b_u [N]`


class TextLine(NamedTuple):
    """A line of the text with its number from 1, cut at its commas."""

    number: int
    cells: list[str]


def timed_rows(text: str, noun: str, layouts: Layouts, scales: ScaledUnits = NONE) -> Vector:
    """The rows (rows, columns), as many columns as one of `layouts` has, in its order and units.

    The names in a header say which column is which, and in brackets its unit where that is another
    one, as `n_1 [rpm]`; `scales` are further units. `noun` is what the text is called. Raises
    ValueError, which does not repeat the text: a file may hold what its reader may not see.
    """
    if len(text) > LARGEST:
        raise ValueError(f"{noun} is longer than {LARGEST:,} characters; leave rows out")
    header, lines = lines_of(text)
    if len(lines) < 2:
        raise ValueError(f"{noun} needs at least two lines, has {len(lines)}")
    _check_counts(lines, noun, layouts)
    rows = _numbers(lines, noun)
    if header:
        names = layouts[rows.shape[1]]
        header, units = _in_own_units(header, names, scales)
        named = rows[:, : len(units)]  # a header may leave the gains of a motion out
        # In place, as `named` is a view: the rows themselves change
        named[:] = (named - [unit.zero for unit in units]) * [unit.factor for unit in units]
        rows = _in_order(rows, columns(header, names, noun), header, noun)
    late = np.flatnonzero(np.diff(rows[:, 0]) <= 0.0)
    if late.size:
        number = lines[late[0] + 1].number
        raise ValueError(f"line {number} of {noun}: its time is not after that of the line before")
    return rows


class NamedRows(NamedTuple):
    """Rows of numbers under names, as text with commas has them."""

    names: tuple[str, ...]
    rows: Vector


def named_rows(text: str, noun: str) -> NamedRows:
    """The rows (rows, names) under the names in the first line; `noun` is what the text is called.

    Raises ValueError, which does not repeat the text but for names.
    """
    if len(text) > LARGEST:
        raise ValueError(f"{noun} is longer than {LARGEST:,} characters; leave rows out")
    header, lines = lines_of(text)
    if not header and lines and not _is_number(lines[0].cells[0]):
        header, *lines = lines  # a single column
    if not header or not lines:
        what = "rows of numbers" if header else "first line that names the columns"
        raise ValueError(f"{noun} has no {what}")
    names = tuple(" ".join(cell.split()) for cell in header.cells)
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise ValueError(f"line {header.number} of {noun} names {twice[0]!r} twice")
    _check_counts(lines, noun, {len(names): names})
    return NamedRows(names, _numbers(lines, noun))


def lines_of(text: str) -> tuple[TextLine | None, list[TextLine]]:
    """The header, which is a first line of several cells without any number, and the other lines.

    # starts a comment; lines without anything else are left out.
    """
    # Programs on Windows begin a text with a byte order mark
    lines = [line.partition("#")[0].strip() for line in text.removeprefix("\ufeff").splitlines()]
    filled = [TextLine(number, _cells(line)) for number, line in enumerate(lines, 1) if line]
    if filled and len(filled[0].cells) > 1 and not any(map(_is_number, filled[0].cells)):
        return filled[0], filled[1:]
    return None, filled


def _cells(line: str) -> list[str]:
    """The cells of a line, without blanks and quotes around them."""
    return [cell.strip(' \t"') for cell in line.split(",")]


def _is_number(cell: str) -> bool:
    """Whether a cell is a number, which may be infinite or undefined."""
    return bool(NUMBER.fullmatch(cell) or NOT_FINITE.fullmatch(cell))


def _check_counts(lines: list[TextLine], noun: str, layouts: Layouts) -> None:
    """Raises ValueError for a line with another number of cells than a layout allows.

    All lines must have the same number, that of one of the layouts.
    """
    for number, cells in lines:
        if len(cells) not in layouts or len(cells) != len(lines[0].cells):
            wanted = " or ".join(f"{n} ({_list_names(names)})" for n, names in layouts.items())
            found = "1 value; separate values by commas:" if len(cells) == 1 else f"{len(cells)};"
            raise ValueError(f"line {number} of {noun} has {found} every line must have {wanted}")


def _list_names(names: Sequence[str]) -> str:
    """The names of columns in a list, without their units."""
    return ", ".join(name.partition(" [")[0] for name in names)


def _numbers(lines: list[TextLine], noun: str) -> Vector:
    """The cells as numbers (lines, cells). Raises ValueError for what is no finite number."""
    if wrong := _wrong_cell(lines, noun):
        raise ValueError(wrong)
    rows = np.array([cells for _, cells in lines], dtype=float)
    # A cell may be nan, or as large as 1e999
    if not np.all(np.isfinite(rows)):
        row, column = np.argwhere(~np.isfinite(rows))[0].tolist()
        where = f"line {lines[row].number}, column {column + 1} of {noun}"
        raise ValueError(f"{where} is not a finite number")
    return rows


def _wrong_cell(lines: list[TextLine], noun: str) -> str:
    """Where the first cell of `lines` is that is no number, for a message; "" where all are.

    `noun` is what the text is called, here and below.
    """
    for number, cells in lines:
        for column, cell in enumerate(cells, 1):
            if not _is_number(cell):
                return f"line {number}, column {column} of {noun} is no number"
    return ""


def _in_order(rows: Vector, order: list[int], header: TextLine, noun: str) -> Vector:
    """The rows (rows, columns) with their columns in `order`, the position of each in the text.

    Behind a header that does not name each column they have to be in order already. Raises
    ValueError.
    """
    if order == sorted(order):
        return rows
    if len(order) != rows.shape[1]:
        raise ValueError(f"line {header.number} of {noun} names columns in another order")
    return rows[:, order]


def _in_own_units(
    header: TextLine, names: Sequence[str], scales: ScaledUnits
) -> tuple[TextLine, list[Scale]]:
    """The header with the units that columns of these names have, and the scale to each.

    `names` are podusv's, each with its unit; `scales` are further units by column and unit. A cell
    with a unit that nobody knows stays, for `columns` to refuse. `time`, as logs call it, is `t`.
    """
    own = dict(map(_split_unit, names))
    cells = [re.sub(r"^time(?= \[|$)", "t", " ".join(cell.split())) for cell in header.cells]
    units = [Scale(0.0, 1.0)] * len(cells)
    for i, cell in enumerate(list(cells)):
        name, unit = _split_unit(cell)
        factor = units_allowed_for(own[name]).get(spell_unit(unit)) if own.get(name) else None
        scale = Scale(0.0, float(factor)) if factor else scales.get((name, spell_unit(unit)))
        if scale:
            cells[i], units[i] = f"{name} [{own[name]}]", scale
    return TextLine(header.number, cells), units


def _split_unit(cell: str) -> tuple[str, str]:
    """Name and unit of "b_u [N]"; without a unit, none."""
    name, _, unit = cell.partition(" [")
    return name, unit.removesuffix("]")


def columns(header: TextLine, names: Sequence[str], noun: str) -> list[int]:
    """Positions in the header of the columns `names`, as `b_u [N]`; the unit may be left out.

    Raises ValueError where one is missing, unknown or given twice.
    """
    cells = [" ".join(cell.split()) for cell in header.cells]
    places = [next((i for i, c in enumerate(cells) if c in _forms(n)), None) for n in names]
    known = {form for name in names for form in _forms(name)}
    strange = [i for i, cell in enumerate(cells, 1) if cell not in known]
    if None in places or len(cells) != len(names):
        found = f"column {strange[0]} is none of these" if strange else "one is missing or twice"
        fault = f"line {header.number} of {noun} names columns that are not {', '.join(names)}"
        raise ValueError(f"{fault} (in any order, units may be left out): {found}")
    return [place for place in places if place is not None]


def _forms(name: str) -> tuple[str, str]:
    """The two ways to write the name of a column: with its unit, and without."""
    return name, name.partition(" [")[0]
