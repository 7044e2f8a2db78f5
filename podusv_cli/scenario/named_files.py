"""What sections of a scenario take from files beside it: all values, pairs, text, or bytes."""

from __future__ import annotations

import base64
import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

from podusv_cli.core.component import Component
from podusv_cli.core.timed_rows import TextLine, columns, lines_of
from podusv_cli.scenario.keys import Key
from podusv_cli.scenario.shipped import relative_to
from podusv_cli.scenario.yaml_text import MAX_NODES, read, read_bytes, read_text, resolve, text_node
from podusv_cli.scenario.yaml_tree import (
    Fault,
    Mark,
    Node,
    Route,
    dotted_key,
    merge,
    plain,
    without_misfits,
)

MAX_POINTS = MAX_NODES // 4  # a point is three values, and the resolved scenario has to be readable
MOST_FAULTS = 10  # in one file of points
COLUMNS = ("x [m]", "y [m]")

ELSEWHERE = "refers to another file; the scenario that podusv keeps in a folder never does"

YAML = (".yaml", ".yml")  # what the names of files end with that are presets
ANY_FILE = "any FILE.yaml"  # beside the names of presets

Fill = Callable[[Node, str, type[Component], list[Fault]], Node]  # a section with its files
Read = Callable[[str, Mark, str, list[Fault]], Any]  # a file, named at a mark under a key
Form = Callable[[Any, str, str, list[Fault]], Node]  # of what is read, the file's name, the key


def with_contents(root: Node, top: Key, faults: list[Fault], fill: Fill | None = None) -> Node:
    """The tree with what files hold in place of the files' names, or as `fill` has it.

    `top` are the scenario's keys.
    """
    default = root.mapping.get("controller")
    usual = {"controllers": default.word("kind")} if default else {}
    for name, entry in root.mapping.items():
        if key := top.keys.get(name):
            kind = usual.get(name, "")
            root = root.with_entry(
                name, _fill_section(entry, key, (name,), fill or _read, faults, kind)
            )
    return root


def _fill_section(
    node: Node, key: Key, at: Route, fill: Fill, faults: list[Fault], usual: str = ""
) -> Node:
    """A section with what files hold, the sections in it first; `usual` is a kind not given."""
    section = key.kinds.get(node.word("kind") or usual, key)
    if isinstance(node.content, tuple):
        if not (item := key.item(0)) or not item.keys:
            return node
        parts = enumerate(node.content)
        return replace(
            node,
            content=tuple(_fill_section(part, item, (*at, i), fill, faults) for i, part in parts),
        )
    own = section.keys if section.section else {}
    for name, entry in node.mapping.items():
        below = own.get(name) or key.item(name)
        if below and (entry.mapping or isinstance(entry.content, tuple)):
            node = node.with_entry(
                name, _fill_section(entry, below, (*at, name), fill, faults, usual)
            )
    return fill(node, dotted_key(at), section.section, faults) if section.section else node


def _read(given: Node, section: str, model: type[Component], faults: list[Fault]) -> Node:
    """A section of class `model` with what its files hold in place of their names."""
    ways: list[tuple[dict[str, str], Read, Form]] = [
        (model.rows_of, read_text, _points),
        (model.texts_of, read_text, _whole),
        (model.bytes_of, read_bytes, _bytes),
    ]
    for fields, reader, form in ways:
        for key, taker in fields.items():
            given = _read_in(given, section, key, taker, reader, form, faults)
    for key, (taker, name) in model.folders_of.items():
        given = _read_in(given, section, key, taker, partial(_in_folder, name), _whole, faults)
    return _over_file(given, section, model, faults)


def _in_folder(name: str, folder: str, mark: Mark, key: str, faults: list[Fault]) -> str | None:
    """The text of a file in a folder that podusv finished."""
    manifest = os.path.join(folder, "manifest.json")
    if not os.path.isfile(manifest) or not os.path.isfile(os.path.join(folder, name)):
        lacks = f"has no {name}" if os.path.isfile(manifest) else "is not there, or not finished"
        faults.append(Fault(mark, key, f"the folder {folder} {lacks}; podusv identify makes it"))
        return None
    return read_text(os.path.join(folder, name), mark, key, faults)


def without_files(given: Node, section: str, model: type[Component], faults: list[Fault]) -> Node:
    """The section as it is; a fault for every file that it names itself, not with `--set`."""
    preset = ["preset"] if model.presets and given.word("preset").endswith(YAML) else []
    for key in (*model.rows_of, *model.texts_of, *model.bytes_of, *model.folders_of, *preset):
        file = given.mapping.get(key)
        if file and file.mark.line and file.content is not None:
            faults.append(Fault(file.mark, f"{section}.{key}", ELSEWHERE))
    return given


def _over_file(given: Node, section: str, model: type[Component], faults: list[Fault]) -> Node:
    """A section over the values of the file that its preset is, where it is one."""
    if not model.presets or not given.word("preset").endswith(YAML):
        return given
    file = given.mapping["preset"]
    path, key, before = _path(file), f"{section}.preset", len(faults)
    text = read_text(path, file.mark, key, faults)
    base = read(text, path, faults) if text is not None else None
    if base and not base.mapping:
        faults.append(Fault(file.mark, key, f"{path} is no {model.presets.file}: it has no keys"))
    none = Node("", file.mark)
    rest = replace(given, content={n: e for n, e in given.mapping.items() if n != "preset"})
    if len(faults) > before or not base:
        return replace(rest.with_entry("preset", none), faulty=True)
    whole = merge(base, without_misfits(base, rest, faults, (section,)))
    if "preset" not in whole.mapping:
        whole = whole.with_entry("preset", none)
    return _with_source(whole, base, rest)


def _with_source(whole: Node, base: Node, given: Node) -> Node:
    """A section over a file with a `source` that names the numbers that are not the file's."""
    there = {name: plain(entry) for name, entry in base.mapping.items()}
    changed = [n for n, entry in given.mapping.items() if there.get(n) != plain(entry)]
    if not changed or "source" in changed or not base.word("source"):
        return whole
    words = base.word("source").removesuffix(".")
    text = f"{words}; {', '.join(changed)} changed by the scenario."
    return whole.with_entry("source", replace(base.mapping["source"], content=text))


def _read_in(
    given: Node, section: str, key: str, taker: str, read: Read, form: Form, faults: list[Fault]
) -> Node:
    """The content of the file that one key names, under the key `taker` in place of the name."""
    file = given.mapping.get(key)
    if not file or not isinstance(file.content, str):
        return given
    if given.get(taker):
        text = f"give either {key} or {taker}, not both"
        faults.append(Fault(file.mark, f"{section}.{key}", text))
        return given
    name = _path(file)
    before = len(faults)
    dotted = f"{section}.{key}"
    data = read(name, file.mark, dotted, faults)
    content = Node("", file.mark) if data is None else form(data, name, dotted, faults)
    content = replace(content, faulty=len(faults) > before)
    rest = {name: entry for name, entry in given.mapping.items() if name != key}
    return replace(given, content=rest | {taker: content}, faulty=given.faulty or content.faulty)


def _path(file: Node) -> str:
    """The file that a scenario names: beside itself; beside the shell's folder with `--set`."""
    return relative_to(file.mark.source if file.mark.line else "", str(file.content))


def _whole(text: str, name: str, key: str, faults: list[Fault]) -> Node:
    """The text of a file as it is, for a key that takes a text."""
    lines = text.removeprefix("\ufeff").replace("\r\n", "\n")
    return text_node(lines, Mark(name), key, faults, text=lines)


def _bytes(data: bytes, name: str, key: str, faults: list[Fault]) -> Node:
    """The bytes of a file in base64, for a key that takes a network."""
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


def _row(line: TextLine, mark: Mark, faults: list[Fault]) -> Node:
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
