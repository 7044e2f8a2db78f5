"""One tree from several sources: `extends` below, `--set` on top."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from functools import reduce

from podusv_cli.config.source import read, read_text, scalar
from podusv_cli.config.tree import Fault, Mark, Node, merge, overlay
from podusv_cli.config.words import found

FLOW = ("[", "{", "'", '"')  # what lists, mappings and text in quotes start with


def composed(text: str, source: str, overrides: Sequence[str], faults: list[Fault]) -> Node | None:
    """The tree of a scenario's text over what it extends, with the overrides on top.

    None where the text cannot be read to its end. File names in `extends` are relative to `source`.
    """
    layers = _layers(text, (source,), faults)
    settings = [_setting(override, faults) for override in overrides]
    if not layers:
        return None
    # All overrides are one layer, so that their order matters only where they give the same key.
    nothing = Node({}, Mark(source))
    top = reduce(lambda a, b: overlay(a, b, lambda *_: False), settings, nothing)
    return replace(reduce(merge, [*reversed(layers), top]), mark=Mark(source))


def _layers(text: str, sources: tuple[str, ...], faults: list[Fault]) -> list[Node]:
    """The tree of the last of `sources`, then those that it extends, nearest first.

    None of them has the key `extends`; the last one is marked faulty where what it extends cannot
    be had. Of several bases the later one goes over the earlier.
    """
    node = _mapping(text, sources[-1], faults)
    if not node:
        return []
    own = {key: entry for key, entry in node.mapping.items() if key != "extends"}
    layers = [replace(node, content=own)]
    above = node.mapping.get("extends")
    named = () if above is None else above.content if isinstance(above.content, tuple) else (above,)
    for name in reversed(named):
        base = _base(name, sources, faults)
        below = _layers(base[1], (*sources, base[0]), faults) if base else []
        layers = [*layers, *below] if below else [replace(layers[0], faulty=True), *layers[1:]]
    return layers


def _mapping(text: str, source: str, faults: list[Fault]) -> Node | None:
    node = read(text, source, faults)
    if node and not isinstance(node.content, dict):
        what = found(node.content, node.text)
        faults.append(
            Fault(node.mark, "", f"a scenario is a mapping of keys to values, found {what}")
        )
        return None
    return node


def _base(above: Node, sources: tuple[str, ...], faults: list[Fault]) -> tuple[str, str] | None:
    """Name and text of the file that `extends` names, or None and a fault."""
    if not isinstance(above.content, str):
        if not above.faulty:
            what = found(above.content, above.text)
            faults.append(Fault(above.mark, "extends", f"must be a file name, found {what}"))
        return None
    path = os.path.join(os.path.dirname(sources[-1]), above.content)
    text = read_text(path, above.mark, "extends", faults)
    if text is not None and os.path.realpath(path) in [
        os.path.realpath(source) for source in sources
    ]:
        way = " -> ".join([*sources, path])
        faults.append(Fault(above.mark, "extends", f"goes round in a circle: {way}"))
        return None
    return None if text is None else (path, text)


def _setting(override: str, faults: list[Fault]) -> Node:
    """The tree that `a.b=v` stands for; v is a scalar, text in quotes, a list or a mapping."""
    name, equals, text = override.partition("=")
    shown = override if override.isprintable() else ascii(override)
    mark = Mark(f"--set {shown}")
    keys = name.strip().split(".")
    node: Node | None = None
    if not equals or not all(keys):
        faults.append(Fault(mark, "", "write it as --set section.key=value"))
    elif text.lstrip().startswith(FLOW):
        node = read(text, mark.source, faults, placed=False)
    else:
        node = scalar(text.strip(), mark, name.strip(), faults)
    if node is None:
        return Node({}, mark)
    for key in reversed(keys):
        node = Node({key: replace(node, key_mark=mark)}, mark)
    return node
