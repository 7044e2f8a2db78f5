"""What sections of a scenario take from files beside it: all values, pairs, text, or bytes."""

from __future__ import annotations

import base64
import os
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Any

from podusv_cli.core.component import Component, ValuesOf
from podusv_cli.scenario.keys import Key
from podusv_cli.scenario.point_files import Placing
from podusv_cli.scenario.shipped import relative_to
from podusv_cli.scenario.yaml_text import read, read_bytes, read_text, text_node
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

ELSEWHERE = "refers to another file; the scenario that podusv keeps in a folder never does"

YAML = (".yaml", ".yml")  # what the names of files end with that are presets
ANY_FILE = "any FILE.yaml"  # beside the names of presets

Fill = Callable[[Node, str, type[Component], list[Fault]], Node]  # a section with its files
Read = Callable[[str, Mark, str, list[Fault]], Any]  # a file, named at a mark under a key
Form = Callable[[Any, str, str, list[Fault]], Node]  # of what is read, the file's name, the key


def with_contents(root: Node, top: Key, faults: list[Fault], remarks: list[str]) -> Node:
    """The tree with what files hold in place of the files' names.

    `top` are the scenario's keys. `remarks` takes sentences about what of a file is left out.
    """
    placing = Placing(root, remarks)
    return placing.with_origin(fill_sections(root, top, faults, partial(_read, placing)))


def fill_sections(root: Node, top: Key, faults: list[Fault], fill: Fill) -> Node:
    """The tree with every section that is a component as `fill` makes it; `top` has the keys."""
    default = root.mapping.get("controller")
    # A law without a kind has that of `controller`.
    usual = {"controllers": default.word("kind")} if default else {}
    for name, entry in root.mapping.items():
        if key := top.keys.get(name):
            kind = usual.get(name, "")
            root = root.with_entry(name, _fill_section(entry, key, (name,), fill, faults, kind))
    return root


def _fill_section(
    node: Node, key: Key, at: Route, fill: Fill, faults: list[Fault], usual: str = ""
) -> Node:
    """A section with what files hold, the sections in it first.

    `key` describes it, `at` leads to it; `usual` is its kind where it gives none.
    """
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


def _read(
    placing: Placing, given: Node, section: str, model: type[Component], faults: list[Fault]
) -> Node:
    """A section of class `model` with what its files hold in place of their names.

    The class says which of its keys name files, and which key takes the content.
    """
    ways: list[tuple[dict[str, str], Read, Form]] = [
        (model.rows_of, read_text, placing.points),
        (model.texts_of, read_text, _whole),
        (model.bytes_of, read_bytes, _bytes),
    ]
    for fields, reader, form in ways:
        for key, taker in fields.items():
            given = _read_in(given, section, key, taker, reader, form, faults)
    for key, values_of in model.values_of.items():
        given = _under(given, section, key, values_of, placing.remarks, faults)
    for key, (taker, name) in model.folders_of.items():
        given = _read_in(given, section, key, taker, partial(_in_folder, name), _whole, faults)
    return _over_file(given, section, model, faults)


def _under(
    given: Node,
    section: str,
    key: str,
    values_of: ValuesOf,
    remarks: list[str],
    faults: list[Fault],
) -> Node:
    """A section over the values that another program's file has, in place of the file's name.

    `given` is the section, and `key` names the file. `values_of` reads its text: the values, and
    sentences on what is left out, which are added to `remarks`.
    """
    file = given.mapping.get(key)
    if not file or not isinstance(file.content, str):
        return given
    name, dotted = _path(file), f"{section}.{key}"
    rest = {n: entry for n, entry in given.mapping.items() if n != key}
    text = read_text(name, file.mark, dotted, faults)
    try:
        values, said = values_of(text, rest.keys()) if text is not None else ({}, [])
    except ValueError as error:
        faults.append(Fault(Mark(name), dotted, f"the file {error}"))
        values, said = {}, []
    lines = (f"{name}: {line}" for line in said)
    remarks += (line for line in lines if line not in remarks)
    below = {n: _as_node(content, Mark(name)) for n, content in values.items()}
    return replace(given, content=below | rest, faulty=given.faulty or not values)


def _as_node(content: Any, mark: Mark) -> Node:
    """A value of a file (dict, tuple or single value) as a node, with the values in it.

    All values get the same `mark`, that of the file.
    """
    if isinstance(content, dict):
        return Node({name: _as_node(part, mark) for name, part in content.items()}, mark)
    if isinstance(content, tuple):
        return Node(tuple(_as_node(part, mark) for part in content), mark)
    return Node(content, mark, text=str(content))


def _in_folder(name: str, folder: str, mark: Mark, key: str, faults: list[Fault]) -> str | None:
    """The text of the file `name` in a folder that podusv finished, or None and a fault.

    `mark` and `key` are where the scenario names the folder.
    """
    # The manifest is written last, so without it the folder is unfinished.
    manifest = os.path.join(folder, "manifest.json")
    if not os.path.isfile(manifest) or not os.path.isfile(os.path.join(folder, name)):
        there = os.path.isfile(manifest)
        lacks = f"has no {name}" if there else "is not there, or not finished"
        forced = ", of a hull that it refuses with --force alone" if there else ""
        made = f"the folder {folder} {lacks}; podusv identify makes it{forced}"
        faults.append(Fault(mark, key, made))
        return None
    return read_text(os.path.join(folder, name), mark, key, faults)


def without_files(given: Node, section: str, model: type[Component], faults: list[Fault]) -> Node:
    """The section (`given`) as it is; a fault for every file that it names, but for `--set`.

    A node that `--set` gives has no line. `section` is its key, `model` its class.
    """
    preset = ["preset"] if model.presets and given.word("preset").endswith(YAML) else []
    named = (model.rows_of, model.texts_of, model.bytes_of, model.folders_of, model.values_of)
    for key in (*chain.from_iterable(named), *preset):
        file = given.mapping.get(key)
        if file and file.mark.line and isinstance(file.content, str):
            faults.append(Fault(file.mark, f"{section}.{key}", ELSEWHERE))
    return given


def _over_file(given: Node, section: str, model: type[Component], faults: list[Fault]) -> Node:
    """A section over the values of the file that its preset is, where it is one.

    `section` is its key and `model` its class. A file that cannot be read makes the section faulty.
    """
    if not model.presets or not given.word("preset").endswith(YAML):
        return given
    file = given.mapping["preset"]
    path, key, before = _path(file), f"{section}.preset", len(faults)
    text = read_text(path, file.mark, key, faults)
    base = read(text, path, faults) if text is not None else None
    if base and not base.mapping:
        faults.append(Fault(file.mark, key, f"{path} is no {model.presets.file}: it has no keys"))
    # The values stand in the tree from here on, so no preset is named any more.
    none = Node("", file.mark)
    rest = replace(given, content={n: e for n, e in given.mapping.items() if n != "preset"})
    if len(faults) > before or not base:
        return replace(rest.with_entry("preset", none), faulty=True)
    whole = merge(base, without_misfits(base, rest, faults, (section,)))
    if "preset" not in whole.mapping:
        whole = whole.with_entry("preset", none)
    return _with_source(whole, base, rest)


def _with_source(whole: Node, base: Node, given: Node) -> Node:
    """A section over a file with a `source` that names the numbers that are not the file's.

    `whole` is the merged section, `base` that of the file, `given` that of the scenario.
    """
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
    """The content of the file that `key` names, under the key `taker` in place of the name.

    `read` reads the file and `form` makes a node of it; both append to `faults`.
    """
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
    # As editors on Windows write files; the same content is to give the same scenario.
    lines = text.removeprefix("\ufeff").replace("\r\n", "\n")
    return text_node(lines, Mark(name), key, faults, text=lines)


def _bytes(data: bytes, name: str, key: str, faults: list[Fault]) -> Node:
    """The bytes of a file in base64, for a key that takes a network."""
    return Node(base64.b64encode(data).decode("ascii"), Mark(name))
