"""Ways in which people and loggers damage a CSV file: each gives bytes, and what must be said.

What must be said is a regular expression, "" where the log has to be read as if it were whole. A
damage may be said, or read rightly; it is never silent.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Columns = dict[str, npt.NDArray[np.float64]]


class Damaged(NamedTuple):
    """The bytes of a file, and what a refusal or a warning about it says."""

    content: bytes
    says: str


Damage = Callable[[random.Random, Columns], Damaged]


def weaving(rows: int = 400) -> Columns:
    """A boat that weaves, by algebra; all quantities differ from each other and from 0."""
    fine = np.arange(0.0, 0.1 * rows, 0.01)
    psi = 0.6 + 0.05 * fine + 0.8 * np.sin(0.5 * fine)
    u, v = 1.0 + 0.3 * np.sin(0.2 * fine), 0.15 * np.cos(0.5 * fine)
    north, east = u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)
    found = {
        "time": fine,
        "x": 20.0 + np.cumsum(north) * 0.01,
        "y": -7.0 + np.cumsum(east) * 0.01,
        "psi": psi,
        "u": u,
        "r": 0.05 + 0.4 * np.cos(0.5 * fine),
    }
    return {name: values[::10].copy() for name, values in found.items()}


def cells_of(columns: Mapping[str, npt.NDArray[np.float64]]) -> list[list[str]]:
    """The rows as text, with so many digits as loggers write."""
    return [[f"{x:.9f}" for x in row] for row in zip(*columns.values(), strict=True)]


def text_of(
    head: list[str], rows: list[list[str]], separator: str = ",", end: str = "\n", last: str = ""
) -> str:
    """A file; `last` ends each row."""
    return end.join([separator.join(head), *(separator.join(row) + last for row in rows), ""])


def _plain(columns: Columns) -> tuple[list[str], list[list[str]]]:
    return list(columns), cells_of(columns)


def _whole(text: str, says: str = "") -> Damaged:
    return Damaged(text.encode(), says)


# Forms that are read as they are


def trailing_separators(rng: random.Random, columns: Columns) -> Damaged:
    return _whole(text_of(*_plain(columns), last="," * rng.randint(1, 4)))


def other_separators(rng: random.Random, columns: Columns) -> Damaged:
    return _whole(text_of(*_plain(columns), separator=rng.choice(";\t ")))


def decimal_commas(rng: random.Random, columns: Columns) -> Damaged:
    head, rows = _plain(columns)
    commas = [[cell.replace(".", ",") for cell in row] for row in rows]
    return _whole(text_of(head, commas, separator=rng.choice(";\t ")))


def quoted_decimal_commas(rng: random.Random, columns: Columns) -> Damaged:
    head, rows = _plain(columns)
    return _whole(text_of(head, [[f'"{c.replace(".", ",")}"' for c in row] for row in rows]))


def encodings(rng: random.Random, columns: Columns) -> Damaged:
    text = text_of(*_plain(columns), end=rng.choice(["\n", "\r\n", "\r"]))
    return Damaged(text.encode(rng.choice(["utf-8-sig", "utf-16", "latin-1"])), "")


def degrees_in_latin_1(rng: random.Random, columns: Columns) -> Damaged:
    turned = {**columns, "psi": np.degrees(columns["psi"])}
    text = text_of([{"psi": "psi [°]"}.get(name, name) for name in turned], cells_of(turned))
    return Damaged(text.encode("latin-1"), "")


def blanks_and_comments(rng: random.Random, columns: Columns) -> Damaged:
    head, rows = _plain(columns)
    lines = text_of([f"  {name} " for name in head], [[f" {c} " for c in row] for row in rows])
    noted = []
    for line in lines.splitlines():
        noted += [rng.choice(["", "# a remark, with a comma", "   "])] * (rng.random() < 0.05)
        noted.append(line)
    return _whole("# made by hand\n" + "\n".join(noted) + "\n")


def order_of_columns(rng: random.Random, columns: Columns) -> Damaged:
    names = rng.sample(list(columns), len(columns))
    return _whole(text_of(*_plain({name: columns[name] for name in names})))


def units_in_brackets(rng: random.Random, columns: Columns) -> Damaged:
    ways = {
        "time [ms]": 1e3,
        "x [km]": 1e-3,
        "y (cm)": 100.0,
        "psi [deg]": 180.0 / math.pi,
        "u [kn]": 3600.0 / 1852.0,
        "r [deg/s]": 180.0 / math.pi,
    }
    chosen = rng.sample(list(ways), rng.randint(1, len(ways)))
    changed = {}
    for name, values in columns.items():
        way = next((way for way in chosen if way.split()[0] == name), name)
        changed[way] = values * ways.get(way, 1.0)
    return _whole(
        text_of(
            list(changed),
            [[f"{x:.12f}" for x in row] for row in zip(*changed.values(), strict=True)],
        )
    )


# Cells


def cell_that_is_none(rng: random.Random, columns: Columns) -> Damaged:
    head, rows = _plain(columns)
    separator = rng.choice(",;")
    if separator == ";":
        rows = [[cell.replace(".", ",") for cell in row] for row in rows]
    for _ in range(rng.randint(1, 3)):
        cell = rng.choice(["-", "ERR", "inf", "1e999", "0x1F", "1_0", "12:00", "\u0663", "?"])
        rng.choice(rows)[rng.randrange(len(head))] = cell
    return _whole(text_of(head, rows, separator), "no number")


def cell_of_other_decimals(rng: random.Random, columns: Columns) -> Damaged:
    head, rows = _plain(columns)
    rng.choice(rows)[rng.randrange(1, len(head))] = "0,5"
    return _whole(text_of(head, rows, "\t"), "no number")


def missing_cells(rng: random.Random, columns: Columns) -> Damaged:
    head, rows = _plain(columns)
    for _ in range(rng.randint(1, 30)):
        rng.choice(rows)[rng.randrange(1, len(head))] = rng.choice(["", "nan", "NA", "null"])
    return _whole(text_of(head, rows))


def empty_column(rng: random.Random, columns: Columns) -> Damaged:
    head, rows = _plain(columns)
    at = rng.randrange(len(head))
    return _whole(text_of(head, [[*row[:at], "", *row[at + 1 :]] for row in rows]), "no number")


def sentinels(rng: random.Random, columns: Columns) -> Damaged:
    head, rows = _plain(columns)
    at, value = rng.randrange(1, len(head)), rng.choice(["65535", "655.35", "-32768", "9999"])
    for row in rng.sample(rows, rng.randint(1, 40)):
        row[at] = value
    return _whole(text_of(head, rows), "stands for no value")


def lost_decimal_point(rng: random.Random, columns: Columns) -> Damaged:
    head, rows = _plain(columns)
    row, at = rng.choice(rows[5:-5]), rng.randrange(1, len(head))
    row[at] = row[at].replace(".", "")
    return _whole(text_of(head, rows), "jumps")


# Rows


def broken_rows(rng: random.Random, columns: Columns) -> Damaged:
    lines = text_of(*_plain(columns)).splitlines()
    for _ in range(rng.randint(1, 5)):
        at = rng.randrange(1, len(lines))
        lines[at] = rng.choice(
            [
                lines[at].replace(",", "", 1),
                lines[at].replace(",", ",,", 1),
                lines[at] + ",7",
                lines[at][: len(lines[at]) // 2],
                '"' + lines[at],
                "\0" * 40,
                "garbage",
                lines[at] + lines[at],
            ]
        )
    return _whole("\n".join(lines) + "\n", "number of cells|no number")


def shifted_rows(rng: random.Random, columns: Columns) -> Damaged:
    head, rows = _plain(columns)
    at, cell = rng.randrange(5, len(rows) - 30), rng.randrange(1, 3)
    for row in rows[at : at + rng.randint(1, 20)]:
        row[:] = [*row[:cell], *row[cell + 1 :], ""]
    return _whole(text_of(head, rows), ".")


def cut_file(rng: random.Random, columns: Columns) -> Damaged:
    content = text_of(*_plain(columns)).encode()
    return Damaged(content[: rng.randrange(len(content))], ".")


def swapped_rows(rng: random.Random, columns: Columns) -> Damaged:
    head, rows = _plain(columns)
    at = rng.randrange(len(rows) - 1)
    rows[at : at + 2] = rows[at + 1], rows[at]
    return _whole(text_of(head, rows), "earlier time")


def double_rows(rng: random.Random, columns: Columns) -> Damaged:
    head, rows = _plain(columns)
    for at in sorted(rng.sample(range(len(rows)), rng.randint(1, 20)), reverse=True):
        again, empty = list(rows[at]), rng.randrange(1, len(head))
        first = list(again)
        (first if rng.random() < 0.5 else again)[empty] = ""
        rows[at : at + 1] = first, again
    return _whole(text_of(head, rows), "time of the row before")


def contradicting_rows(rng: random.Random, columns: Columns) -> Damaged:
    head, rows = _plain(columns)
    at = rng.randrange(1, len(rows))
    rows[at][0] = rows[at - 1][0]
    return _whole(text_of(head, rows), "the same time as")


def two_boots(rng: random.Random, columns: Columns) -> Damaged:
    head, rows = _plain(columns)
    at = rng.randrange(30, len(rows) - 30)
    begun = [[f"{float(row[0]) - float(rows[at][0]):.9f}", *row[1:]] for row in rows[at:]]
    again = rng.choice([[], [head]])
    return _whole(text_of(head, [*rows[:at], *again, *begun]), "steps back")


# Names


def no_names(rng: random.Random, columns: Columns) -> Damaged:
    return _whole(text_of(*_plain(columns)).partition("\n")[2], "no names")


def equal_names(rng: random.Random, columns: Columns) -> Damaged:
    head, rows = _plain(columns)
    one, other = rng.sample(range(len(head)), 2)
    head[one] = f" {head[other]}  "
    return _whole(text_of(head, rows), "calls 2 columns")


def name_with_two_units(rng: random.Random, columns: Columns) -> Damaged:
    changed = {"x [ft]" if n == "x" else n: c for n, c in columns.items()}
    changed["x [m]"] = columns["x"]
    return _whole(text_of(*_plain(changed)), "may be any of")


def units_below_names(rng: random.Random, columns: Columns) -> Damaged:
    head, rows = _plain(columns)
    return _whole(text_of(head, [["s", "m", "m", "rad", "m/s", "rad/s"], *rows]), "no number")


def broken_names(rng: random.Random, columns: Columns) -> Damaged:
    head, rows = _plain(columns)
    at = rng.randrange(4)
    head[at] = rng.choice(["", head[at] + "?", head[at][:-1] + "\u00df", "[rad]"])
    return _whole(text_of(head, rows), "nothing is known|no column|allowed|has no")


def header_of_other_separators(rng: random.Random, columns: Columns) -> Damaged:
    head, rows = _plain(columns)
    one, other = rng.sample([",", ";", "\t", " "], 2)
    text = one.join(head) + "\n" + text_of([], rows, other)[1:]
    return _whole(text, "one cell for each name|numbers|no column|none of x")


# Units and frames without a word


def other_unit(rng: random.Random, columns: Columns) -> Damaged:
    changes = [
        ("time", 1e3, "ms"),
        ("time", 1e6, "us"),
        ("time", 1e9, "ns"),
        ("time", 1 / 3600, "hours"),
        ("time", 1 / 60, "units of time|minutes"),
        ("psi", 180 / math.pi, "deg"),
        ("r", 180 / math.pi, "deg/s"),
        ("u", 3600 / 1852, "kn"),
        ("u", 3.6, "km/h"),
    ]
    name, factor, says = rng.choice(changes)
    return _whole(text_of(*_plain({**columns, name: columns[name] * factor})), says)


def _fixes(columns: Columns, lat: float, lon: float) -> tuple[npt.NDArray[np.float64], ...]:
    """Latitudes and longitudes [deg] of x and y, on a sphere: only their form matters."""
    degree = 111e3
    east = degree * math.cos(math.radians(lat))
    return lat + columns["x"] / degree, lon + columns["y"] / east


def places(rng: random.Random, columns: Columns) -> Damaged:
    lat, lon = _fixes(columns, rng.uniform(-70, 70), rng.uniform(-179, 179))
    rest = {name: columns[name] for name in ("time", "psi", "u", "r")}

    def minutes(degrees: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        whole = np.trunc(degrees)
        return 100.0 * whole + 60.0 * (degrees - whole)

    ways: list[tuple[Columns, str]] = [
        ({"lat": minutes(lat), "lon": minutes(lon)}, "beyond (90|180)"),
        ({"lat": np.round(1e7 * lat), "lon": np.round(1e7 * lon)}, "1e-7 deg"),
        ({"x": lat, "y": lon}, "degrees"),
        ({"lat": lat + 180.0, "lon": lon}, "beyond 90"),
        ({"lat": lat, "lon": lon + 360.0}, "beyond 180"),
    ]
    changed, says = rng.choice(ways)
    return _whole(text_of(*_plain({**rest, **changed})), says)


def clock_times(rng: random.Random, columns: Columns) -> Damaged:
    head, rows = _plain(columns)
    begin = rng.randrange(80000)
    for row in rows:
        since = begin + float(row[0])
        row[0] = f"{int(since // 3600):02d}:{int(since // 60) % 60:02d}:{since % 60:04.1f}"
    return _whole(text_of(head, rows), "clock times")


def flipped_bytes(rng: random.Random, columns: Columns) -> Damaged:
    content = bytearray(text_of(*_plain(columns)).encode())
    for _ in range(rng.randint(1, 3)):
        content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
    return Damaged(bytes(content), ".")


DAMAGES: tuple[Damage, ...] = (
    trailing_separators,
    other_separators,
    decimal_commas,
    quoted_decimal_commas,
    encodings,
    degrees_in_latin_1,
    blanks_and_comments,
    order_of_columns,
    units_in_brackets,
    cell_that_is_none,
    cell_of_other_decimals,
    missing_cells,
    empty_column,
    sentinels,
    lost_decimal_point,
    broken_rows,
    shifted_rows,
    cut_file,
    swapped_rows,
    double_rows,
    contradicting_rows,
    two_boots,
    no_names,
    equal_names,
    name_with_two_units,
    units_below_names,
    broken_names,
    header_of_other_separators,
    other_unit,
    places,
    clock_times,
    flipped_bytes,
)
