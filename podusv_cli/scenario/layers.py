"""One tree from several sources: `extends` below, `--set` on top."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import reduce

from podusv_cli.scenario.phrases import found
from podusv_cli.scenario.yaml_text import (
    MAX_CHARACTERS,
    MAX_DEPTH,
    MAX_NODES,
    read,
    read_text,
    scalar,
)
from podusv_cli.scenario.yaml_tree import Fault, Mark, Node, count, merge, overlay

# In a scenario and all that it extends; each file alone has the limits of its reader.
MOST = {"files": 100, "characters": 2 * MAX_CHARACTERS, "values": 3 * MAX_NODES}
FLOW = ("[", "{", "'", '"')  # what lists, mappings and text in quotes start with


def composed(text: str, source: str, overrides: Sequence[str], faults: list[Fault]) -> Node | None:
    """The tree of a scenario's text over what it extends, with the overrides on top.

    None where the text cannot be read to its end. File names in `extends` are relative to `source`.
    """
    layers = _layers(text, source, faults)
    settings = [_setting(override, faults) for override in overrides]
    if not layers:
        return None
    # All overrides are one layer, so that their order matters only where they give the same key.
    nothing = Node({}, Mark(source))
    top = reduce(lambda a, b: overlay(a, b, lambda *_: False), settings, nothing)
    return replace(reduce(merge, [*reversed(layers), top]), mark=Mark(source))


def _layers(text: str, source: str, faults: list[Fault]) -> list[Node]:
    """The tree of the scenario's text, then those of all that it extends, nearest first.

    None of them has the key `extends`; the first one is marked faulty where a file that is extended
    cannot be had. Of several bases the later one goes over the earlier.
    """
    node = _mapping(text, source, faults)
    if not node:
        return []
    bases = list(_bases(node, source, _amounts(text, node), faults))
    own = replace(_own(node), faulty=node.faulty or not all(bases))
    return [own, *filter(None, bases)]


def _bases(
    node: Node, source: str, amounts: Counter[str], faults: list[Fault]
) -> Iterator[Node | None]:
    """The trees of all that a scenario extends, nearest first; None for one that cannot be had."""
    waiting: list[tuple[Node, tuple[str, ...]]] = [(name, (source,)) for name in _named(node)]
    while waiting:
        name, sources = waiting.pop()
        if most := _exceeded(amounts):
            text = f"this scenario and all that it extends are more than {most}; extend fewer files"
            faults.append(Fault(name.mark, "extends", text))
            yield None
            return
        base = _base(name, sources, faults)
        tree = _mapping(base[1], base[0], faults) if base else None
        yield tree and _own(tree)
        if base and tree:
            amounts += _amounts(base[1], tree)
            waiting += [(further, (*sources, base[0])) for further in _named(tree)]


def _own(node: Node) -> Node:
    """The tree without `extends`."""
    return replace(node, content={k: e for k, e in node.mapping.items() if k != "extends"})


def _named(node: Node) -> tuple[Node, ...]:
    """The file names that `extends` has."""
    above = node.mapping.get("extends")
    if above is None:
        return ()
    return above.content if isinstance(above.content, tuple) else (above,)


def _amounts(text: str, node: Node) -> Counter[str]:
    """What a file adds to the totals that are limited."""
    return Counter({"files": 1, "characters": len(text), "values": count(node)})


def _exceeded(amounts: Counter[str]) -> str:
    """A total that allows no further file, in words; empty where there is none."""
    full = (f"{most:,} {what}" for what, most in MOST.items() if amounts[what] >= most)
    return next(full, "")


def _mapping(text: str, source: str, faults: list[Fault]) -> Node | None:
    node = read(text, source, faults)
    if node and not isinstance(node.content, dict):
        # The file may be none of the user's: its text is not repeated.
        what = "text" if isinstance(node.content, str) else found(node.content, node.text)
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
    elif len(keys) > MAX_DEPTH:
        faults.append(Fault(mark, "", f"nested deeper than {MAX_DEPTH} levels"))
        keys = []
    elif text.lstrip().startswith(FLOW):
        node = read(text, mark.source, faults, placed=False)
    else:
        node = scalar(text.strip(), mark, name.strip(), faults)
    if node is None:
        return Node({}, mark)
    for key in reversed(keys):
        node = Node({key: replace(node, key_mark=mark)}, mark)
    return node
