"""Trees of plain data with the position of every key and value."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

LONGEST_PLACE = 9  # digits of a place in a list; Python refuses to read thousands of them
Route = tuple[str | int, ...]
# The keys of a quantity that a study draws, and those of them that say how it is drawn.
QUANTITY = {
    "uniform",
    "log_uniform",
    "normal",
    "lognormal",
    "triangular",
    "choice",
    "integers",
    "angle",
    "times",
    "plus",
    "seed",
    "identified",
    "rows",
    "keys",
}
NAMED_BY_KEYS = (
    ("sweep", "vary"),
    ("sweep", "grid"),
    ("tune", "space"),
    ("doubt", "vary"),
    ("identify", "priors"),
)  # sections whose entries have names with dots
RANGE = {"log", "around", "keep"}  # and some of the above: what a gain may be
DISTRIBUTIONS = QUANTITY - {"keys"}


@dataclass(frozen=True)
class Mark:
    """A position: a source with line and column from 1; line 0 if the source has no lines.

    `above` are the files by whose `extends` the source was read, the scenario's own first.
    """

    source: str
    line: int = 0
    column: int = 0
    above: tuple[str, ...] = ()

    def __str__(self) -> str:
        """`file:line:column`, or just the source."""
        return f"{self.source}:{self.line}:{self.column}" if self.line else self.source


@dataclass(frozen=True)
class Fault:
    """An error: its position, key and message."""

    mark: Mark
    key: str
    text: str

    def __str__(self) -> str:
        """One line: place, key, text."""
        return ": ".join(filter(None, (str(self.mark), printable(self.key), self.text)))


@dataclass(frozen=True)
class Node:
    """A value: a scalar, a tuple of nodes, or a mapping from key to node.

    `key_mark` is the position of its key. `text` is a scalar as written. `faulty` says that a
    fault was reported here: a scalar or list has no content, a mapping may lack keys. `instead_of`
    is the section of another kind that it stands in place of; `kinds.merge_kept` says what it
    keeps.
    """

    content: Any
    mark: Mark
    key_mark: Mark | None = None
    text: str = ""
    faulty: bool = False
    instead_of: Node | None = None

    @property
    def mapping(self) -> dict[str, Node]:
        """The entries; empty if this is not a mapping."""
        return self.content if isinstance(self.content, dict) else {}

    def get(self, key: str) -> Any:
        """The plain content of an entry; None where there is no such entry."""
        entry = self.mapping.get(key)
        return entry.content if entry else None

    def word(self, key: str) -> str:
        """The text of an entry; empty where there is none, and where it is no text."""
        content = self.get(key)
        return content if isinstance(content, str) else ""

    def with_entry(self, key: str, entry: Node) -> Node:
        """This mapping with an entry added or replaced."""
        return replace(self, content={**self.mapping, key: entry})


def dotted_key(route: Route) -> str:
    """`network.nodes[0]` for ("network", "nodes", 0)."""
    parts = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in route)
    return printable(parts).removeprefix(".")


def route(key: str) -> Route:
    """("network", "nodes", 0) for `network.nodes[0]`."""
    steps = re.findall(r"\[(\d+)\]|([^.\[\]]+)", key)
    return tuple(int(place) if place else name for place, name in steps)


def steps_of(key: str) -> tuple[str, ...]:
    """("disturbance", "2", "seed") for `disturbance[2].seed` and for `disturbance.2.seed`."""
    return tuple(re.sub(r"\[(\d+)\]", r".\1", key).split("."))


def bracketed_key(key: str) -> str:
    """`disturbance[2].seed`, also for `disturbance.2.seed`."""
    return re.sub(r"\.(\d+)(?=\.|\[|$)", r"[\1]", key)


def with_dotted_key(steps: Route) -> Route:
    """The steps of a key, of which `vessel.m` in `sweep.vary.vessel.m.times` is a single one."""
    above, rest = steps[:2], steps[2:]
    if above not in NAMED_BY_KEYS:
        return steps
    # `seed` may be the end of a name.
    ends = (i for i, step in enumerate(rest) if step in (QUANTITY | RANGE) - {"seed"})
    end = next(ends, len(rest))
    return (*above, *filter(None, [bracketed_key(dotted_key(rest[:end]))]), *rest[end:])


def printable(text: str) -> str:
    """The text, escaped if it has invisible or direction-changing characters."""
    return text if text.isprintable() else ascii(text)[1:-1]


def follow(root: Node, route: Route) -> list[Node]:
    """The nodes from the root along the route, as far as it goes."""
    nodes = [root]
    for step in route:
        content = nodes[-1].content
        steps = content if isinstance(content, dict) else range(len(_items(content)))
        if step not in steps:
            break
        nodes.append(content[step])
    return nodes


def _items(content: Any) -> tuple[Node, ...]:
    return content if isinstance(content, tuple) else ()


def tree_with(key: str, node: Node, root: Node) -> Node:
    """The tree that has only `node`, at the key; its place is that of `root`."""
    for step in reversed(route(key)):
        node = Node({str(step): node}, node.mark)
    return replace(node, mark=root.mark)


def find(root: Node, route: Route) -> Node | None:
    """The node at the end of the route, or None."""
    nodes = follow(root, route)
    return nodes[-1] if len(nodes) == len(route) + 1 else None


def plain(node: Node) -> Any:
    """Dicts, tuples and scalars without positions. Faulty values are left out."""
    if isinstance(node.content, dict):
        return {
            key: plain(entry)
            for key, entry in node.content.items()
            if entry.mapping or not entry.faulty
        }
    if isinstance(node.content, tuple):
        return tuple(plain(item) for item in node.content)
    return node.content


def merge(base: Node, top: Node, *, by_kind: bool = True) -> Node:
    """`top` over `base`: mappings key by key, other values replaced.

    With `by_kind`, a section of another kind or preset stands in place of the base's section; where
    only the preset differs, the kind is kept. A mapping of positions {"0": ...} over a list changes
    those items only.
    """
    if _names_places(base, top):
        items = list(base.content)
        for place, item in top.content.items():
            items[int(place)] = merge(items[int(place)], item, by_kind=by_kind)
        return replace(top, content=tuple(items), faulty=top.faulty or base.faulty)
    if not (isinstance(base.content, dict) and isinstance(top.content, dict)):
        return top
    if by_kind and _another_kind(base, top):
        kind = base.content.get("kind")
        if kind and "kind" not in top.content:
            return top.with_entry("kind", kind)
        # `kinds.merge_kept` later takes over what fits; here the models are not known.
        return replace(top, instead_of=base) if top.word("kind") != base.word("kind") else top
    entries = dict(base.content)
    for key, entry in top.content.items():
        known = key in entries
        entries[key] = merge(entries[key], entry, by_kind=by_kind) if known else entry
    faulty = top.faulty or base.faulty
    return replace(top, content=entries, faulty=faulty, instead_of=base.instead_of)


def without_misfits(base: Node, top: Node, faults: list[Fault], at: Route = ()) -> Node:
    """`top` without entries at places that lists of `base` do not have; these are faults.

    `at` leads to both. A mapping with a kind replaces a list.
    """
    entries = _items(base.content)
    if entries and top.mapping and "kind" not in top.mapping:
        strange = [key for key in top.mapping if not _is_place(key, len(entries))]
        named = any(entry.mapping for entry in entries)
        # A list of plain values may be replaced by a mapping; an entry of sections, never by a
        # name.
        wrong = [key for key in strange if named or key.lstrip("-").isdecimal()]
        for key in wrong:
            mark = top.mapping[key].key_mark or top.mapping[key].mark
            kinds = [entry.word("kind") for entry in entries]
            place = bracketed_key(dotted_key((*at, key)))
            faults.append(Fault(mark, place, entries_of(bracketed_key(dotted_key(at)), kinds)))
        if wrong:
            return base
    if not top.mapping or _another_kind(base, top):
        return top
    below = base.mapping or {str(i): entry for i, entry in enumerate(entries)}
    both = {
        key: without_misfits(below[key], entry, faults, (*at, key)) if key in below else entry
        for key, entry in top.mapping.items()
    }
    return replace(top, content=both)


def entries_of(key: str, kinds: Sequence[Any]) -> str:
    """A sentence on what the list at `key` has; `kinds` are those of its entries, None for none."""
    last = len(kinds) - 1
    kinds_there = ", ".join(kind for kind in kinds if isinstance(kind, str))
    to = f" to {key}[{last}]" if last else ""
    kinds_told = f" ({kinds_there})" if kinds_there else ""
    count = f"{len(kinds)} entries" if last else "1 entry"
    return f"the list has {count}, {key}[0]{to}{kinds_told}; name one of these"


def _names_places(base: Node, top: Node) -> bool:
    """Whether `top` is a mapping of places in the list `base`."""
    places = top.mapping
    return bool(places) and all(_is_place(place, len(_items(base.content))) for place in places)


def _is_place(key: str, count: int) -> bool:
    """Whether a key is a place in a list of `count` entries."""
    return key.isdecimal() and len(key) <= LONGEST_PLACE and int(key) < count


def _another_kind(base: Node, top: Node) -> bool:
    """Whether `top` has another kind or preset than `base`, whose keys then do not apply.

    The kind of a distribution is its key: `{uniform: [0, 1]}`.
    """
    pairs = [(base.get(key), top.get(key)) for key in ("kind", "preset")]
    if any(None not in pair and pair[0] != pair[1] for pair in pairs):
        return True
    ways = [set(node.mapping) - {"keys"} for node in (base, top)]
    return all(way and way <= DISTRIBUTIONS | RANGE for way in ways) and ways[0] != ways[1]
