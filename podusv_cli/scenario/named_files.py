"""What fields of a scenario take from files beside it: pairs of a CSV file, text, or bytes."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

from podusv_cli.core.component import Component
from podusv_cli.core.timed_rows import Line, columns, lines_of
from podusv_cli.scenario.shipped import relative_to
from podusv_cli.scenario.yaml_text import MAX_NODES, read_bytes, read_text, resolve, text_node
from podusv_cli.scenario.yaml_tree import Fault, Mark, Node

MAX_POINTS = MAX_NODES // 4  # a point is three values, and the resolved scenario has to be readable
MOST_FAULTS = 10  # in one file of points
COLUMNS = ("x [m]", "y [m]")

ELSEWHERE = "refers to another file; the scenario that podusv keeps in a folder never does"

Read = Callable[[str, Mark, str, list[Fault]], Any]  # a file, named at a mark under a key
Form = Callable[[Any, str, str, list[Fault]], Node]  # of what is read, the file's name, the key


def with_files(given: Node, section: str, model: type[Component], faults: list[Fault]) -> Node:
    """A section of class `model` with what its files hold in place of their names."""
    ways: list[tuple[dict[str, str], Read, Form]] = [
        (model.rows_of, read_text, _points),
        (model.texts_of, read_text, _whole),
        (model.bytes_of, read_bytes, _bytes),
    ]
    for fields, read, form in ways:
        for key, taker in fields.items():
            given = _read_in(given, section, key, taker, read, form, faults)
    return given


def without_files(
    given: Node, section: str, model: type[Component], faults: list[Fault]
) -> Node:  # fmt: skip
    """The section as it is; a fault for every file that it names itself, not with `--set`."""
    for key in (*model.rows_of, *model.texts_of, *model.bytes_of):
        file = given.mapping.get(key)
        if file and file.mark.line and file.content is not None:
            faults.append(Fault(file.mark, f"{section}.{key}", ELSEWHERE))
    return given


def _read_in(
    given: Node, section: str, key: str, taker: str, read: Read, form: Form, faults: list[Fault]
) -> Node:  # fmt: skip
    """The content of the file that one key names, under the key `taker` in place of the name."""
    file = given.mapping.get(key)
    if not file or not isinstance(file.content, str):
        return given
    if given.get(taker):
        text = f"give either {key} or {taker}, not both"
        faults.append(Fault(file.mark, f"{section}.{key}", text))
        return given
    name = relative_to(file.mark.source if file.mark.line else "", file.content)
    before = len(faults)
    dotted = f"{section}.{key}"
    data = read(name, file.mark, dotted, faults)
    content = Node("", file.mark) if data is None else form(data, name, dotted, faults)
    content = replace(content, faulty=len(faults) > before)
    rest = {name: entry for name, entry in given.mapping.items() if name != key}
    return replace(given, content=rest | {taker: content}, faulty=given.faulty or content.faulty)


def _whole(text: str, name: str, key: str, faults: list[Fault]) -> Node:
    lines = text.removeprefix("\ufeff").replace("\r\n", "\n")
    return text_node(lines, Mark(name), key, faults, text=lines)


def _bytes(data: bytes, name: str, key: str, faults: list[Fault]) -> Node:
    return Node(base64.b64encode(data).decode("ascii"), Mark(name))


def _points(text: str, name: str, key: str, faults: list[Fault]) -> Node:
    return Node(tuple(_rows(text, name, faults)), Mark(name))


def _rows(text: str, name: str, faults: list[Fault]) -> Iterator[Node]:
    """A node for every line: x and y, in the order of the header where there is one."""
    header, filled = lines_of(text)
    try:
        order = columns(header, COLUMNS, "the file") if header else [0, 1]
    except ValueError as error:
        faults.append(Fault(Mark(name, header.number if header else 1, 1), "", str(error)))
        return
    if len(filled) > MAX_POINTS:
        faults.append(Fault(Mark(name), "", f"more than {MAX_POINTS:,} points"))
        return
    most = len(faults) + MOST_FAULTS
    for line in filled:
        row = _row(line, Mark(name, line.number, 1), faults)
        if len(faults) > most:
            return
        cells = row.content
        yield replace(row, content=tuple(cells[i] for i in order if i < len(cells)))


def _row(line: Line, mark: Mark, faults: list[Fault]) -> Node:
    numbers = [resolve(cell) for cell in line.cells]
    wrong = [isinstance(n, (str, bool)) or n is None for n in numbers]
    # The line is not shown: the file may be one that the user may not read.
    if len(numbers) != 2:
        text = f"must be two numbers x,y [m], found {len(numbers)} between commas"
        faults.append(Fault(mark, "", text))
    elif any(wrong):
        place = ("first", "second")[wrong.index(True)]
        faults.append(Fault(mark, "", f"must be two numbers x,y [m]; the {place} is no number"))
    pairs = zip(numbers, line.cells, strict=True)
    return Node(tuple(Node(number, mark, text=cell) for number, cell in pairs), mark)
