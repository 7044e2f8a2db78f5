"""Numbers that are written with a unit, such as `45 deg`, in podusv's own units."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from podusv_cli.scenario.keys import OF_KEYS, Key
from podusv_cli.scenario.yaml_tree import Node


def in_si(root: Node, top: Key) -> Node:
    """The tree with plain numbers in place of numbers with a unit, where the unit fits the key.

    `top` are the scenario's keys. A node keeps its text as it was written. What does not fit stays
    text, which the models refuse.
    """
    default = root.mapping.get("controller")
    usual = default.word("kind") if default else ""
    return _convert_node(root, top, usual)


def _convert_node(node: Node, key: Key, usual: str) -> Node:
    """The node with plain numbers; `key` describes it.

    `usual` is the kind of `controllers` that have none of their own: that of `controller`.
    """
    if isinstance(node.content, dict):
        return replace(node, content=dict(_entries(node, key, usual)))
    if isinstance(node.content, tuple):
        if not _has_text(node):  # as in most lists of thousands of waypoints
            return node
        return replace(node, content=tuple(_items(node.content, key, usual)))
    return replace(node, content=key.number(node.content))


def _entries(node: Node, key: Key, usual: str) -> Iterator[tuple[str, Node]]:
    """The entries of a section, by name, with all numbers in SI units.

    `key` describes the section; `usual` is the kind of a law that names none.
    """
    kind = node.word("kind") or (usual if key.path[:1] == ("controllers",) else "")
    section = key.kinds.get(kind, key)
    for name, entry in node.mapping.items():
        below = section.keys.get(name) or key.item(name)
        # The numbers of a drawn quantity have the unit of the keys that it changes.
        if below and key.path in OF_KEYS and (named := _words(entry.mapping.get("keys"))):
            below = below.of_keys(*named)
        yield name, _convert_node(entry, below, usual) if below else entry


def _items(items: tuple[Node, ...], key: Key, usual: str) -> Iterator[Node]:
    """The items of a list, with all numbers in SI units; `usual` as in `_entries`."""
    for place, item in enumerate(items):
        below = key.item(place)
        yield _convert_node(item, below, usual) if below else item


def _has_text(node: Node) -> bool:
    """Whether a word stands anywhere in the tree; `[10, kn]` is a number with its unit."""
    parts = [*node.mapping.values()] or node.content
    return (
        any(map(_has_text, parts)) if isinstance(parts, (list, tuple)) else isinstance(parts, str)
    )


def _words(node: Node | None) -> list[Any]:
    """The texts of a list; of anything else, none."""
    items = node.content if node and isinstance(node.content, tuple) else ()
    return [item.content for item in items if isinstance(item.content, str)]
