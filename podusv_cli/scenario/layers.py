"""One tree from several sources: `extends` below, `--set` on top."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial, reduce

from podusv_cli.core.phrases import describe_found
from podusv_cli.scenario.named_files import ELSEWHERE
from podusv_cli.scenario.shipped import relative_to
from podusv_cli.scenario.yaml_text import MAX_DEPTH, MAX_NODES, plain_node, read, read_text
from podusv_cli.scenario.yaml_tree import (
    NAMED_BY_KEYS,
    Fault,
    Mark,
    Node,
    Route,
    bracketed_key,
    dotted_key,
    merge,
    steps_of,
    with_dotted_key,
    without_misfits,
)

FLOW = ("[", "{", "'", '"')  # what lists, mappings and text in quotes start with


def compose_layers(
    text: str, source: str, overrides: Sequence[str], faults: list[Fault], *, placed: bool = True
) -> Node | None:
    """The tree of a scenario's text over what it extends, with the overrides on top.

    None if the text is no mapping. File names in `extends` are relative to `source`. Faults are
    appended to `faults`, with line and column of the text where `placed`.
    """
    layers = _layers(text, source, faults, placed)
    top = _settings(source, overrides, faults)
    if not layers:
        return None
    # From the farthest base up to the overrides, each over those before it.
    whole = reduce(partial(_over, faults=faults), [*reversed(layers), top])
    return replace(whole, mark=Mark(source))


def self_contained(
    text: str, source: str, overrides: Sequence[str], faults: list[Fault], most: int
) -> Node | None:
    """As `compose_layers`, for a text of at most `most` values that extends no file."""
    node = _mapping(text, source, faults, most=most)
    if node and (above := node.mapping.get("extends")):
        faults.append(Fault(above.mark, "extends", ELSEWHERE))
    top = _settings(source, overrides, faults)
    return node and replace(_over(node, top, faults), mark=Mark(source))


def _settings(source: str, overrides: Sequence[str], faults: list[Fault]) -> Node:
    """All overrides as one layer, so that their order matters only where they give one key."""
    trees = [_override_tree(override, faults) for override in overrides]
    # Not by kind: a kind that one of them gives must not take out what another one gives.
    return reduce(partial(merge, by_kind=False), trees, Node({}, Mark(source)))


def _over(base: Node, top: Node, faults: list[Fault]) -> Node:
    """`top` over `base`; what does not fit there is a fault, and left out."""
    return merge(base, without_misfits(base, top, faults))


def _layers(text: str, source: str, faults: list[Fault], placed: bool) -> list[Node]:
    """The tree of the scenario's text, then those of all that it extends, nearest first.

    Empty if the text is no mapping. The key `extends` is removed, and of extended files
    `description`. The first tree is faulty if an extended file cannot be read. Faults are appended
    to `faults`, with line and column where `placed`.
    """
    node = _mapping(text, source, faults, placed)
    if not node:
        return []
    bases = list(_bases(node, source, faults))
    own = replace(_without(node, "extends"), faulty=node.faulty or not all(bases))
    return [own, *filter(None, bases)]


def _bases(node: Node, source: str, faults: list[Fault]) -> Iterator[Node | None]:
    """The trees of all extended files, nearest first; None for one that cannot be read.

    Of several bases the last named comes first, since it overrides those before it.
    """
    waiting: list[tuple[Node, tuple[str, ...]]] = [
        (name, (source,)) for name in extended_files(node)
    ]
    while waiting:
        name, sources = waiting.pop()
        base = _read_base(name, sources, faults)
        tree = _mapping(base[1], base[0], faults, above=sources) if base else None
        yield tree and _without(tree, "extends", "description")  # which is about that file alone
        if base and tree:
            waiting += [(further, (*sources, base[0])) for further in extended_files(tree)]


def _without(node: Node, *keys: str) -> Node:
    """The tree without these keys at its top."""
    return replace(node, content={k: e for k, e in node.mapping.items() if k not in keys})


def extended_files(node: Node) -> tuple[Node, ...]:
    """The nodes of the file names in `extends`, which may be one or a list; maybe none."""
    above = node.mapping.get("extends")
    if above is None:
        return ()
    return above.content if isinstance(above.content, tuple) else (above,)


def _mapping(
    text: str,
    source: str,
    faults: list[Fault],
    placed: bool = True,
    most: int = MAX_NODES,
    above: tuple[str, ...] = (),
) -> Node | None:
    """The tree of a text that is a mapping; None where it is none, with a fault for that.

    `placed` says whether faults may give line and column, `most` how many values the text may have,
    `above` the files that extend it, outermost first.
    """
    node = read(text, source, faults, placed=placed, most=most, above=above)
    if node and not isinstance(node.content, dict):
        # The text is not shown: the file may be one that the user may not read.
        what = "text" if isinstance(node.content, str) else describe_found(node.content, node.text)
        faults.append(
            Fault(node.mark, "", f"a scenario is a mapping of keys to values, found {what}")
        )
        return None
    return node and _named_alike(node, (), faults)


def _named_alike(node: Node, at: Route, faults: list[Fault]) -> Node:
    """The tree with keys as names in one form, `disturbance[2].seed`.

    That is for sections whose entries are named by keys. `at` leads to the node. A key that is
    given in both forms is a fault.
    """
    inside = {(*at, key): entry for key, entry in node.mapping.items()}
    for place, entry in inside.items():
        if any(named[: len(place)] == place for named in NAMED_BY_KEYS):
            node = node.with_entry(str(place[-1]), _named_alike(entry, place, faults))
    if at not in NAMED_BY_KEYS or not node.mapping:
        return node
    alike: dict[str, Node] = {}
    for key, entry in node.mapping.items():
        if bracketed_key(key) in alike:
            text = f"given twice, as {bracketed_key(key)} too"
            faults.append(Fault(entry.key_mark or entry.mark, dotted_key((*at, key)), text))
        alike[bracketed_key(key)] = entry
    return replace(node, content=alike)


def _read_base(
    above: Node, sources: tuple[str, ...], faults: list[Fault]
) -> tuple[str, str] | None:
    """Name and text of the file that `extends` names, or None and a fault.

    `above` is the node of the name, `sources` are the files on the way to it, to find circles.
    """
    if not isinstance(above.content, str):
        if not above.faulty:
            what = describe_found(above.content, above.text)
            faults.append(Fault(above.mark, "extends", f"must be a file name, found {what}"))
        return None
    path = relative_to(sources[-1], above.content)
    text = read_text(path, above.mark, "extends", faults)
    # Real paths, as a circle may lead through a link.
    if text is not None and os.path.realpath(path) in [
        os.path.realpath(source) for source in sources
    ]:
        way = " -> ".join([*sources, path])
        faults.append(Fault(above.mark, "extends", f"goes round in a circle: {way}"))
        return None
    return None if text is None else (path, text)


def _override_tree(override: str, faults: list[Fault]) -> Node:
    """The tree that `a.b=v` of `--set` stands for; an empty one with a fault if it cannot be read.

    v is a scalar, text in quotes, a list or a mapping.
    """
    name, equals, text = override.partition("=")
    shown = override if override.isprintable() else ascii(override)
    mark = Mark(f"--set {shown}")
    keys = list(with_dotted_key(steps_of(name.strip())))
    node: Node | None = None
    if not equals or not all(keys):
        faults.append(Fault(mark, "", "write it as --set section.key=value"))
    elif len(keys) > MAX_DEPTH:
        faults.append(Fault(mark, "", f"nested deeper than {MAX_DEPTH} levels"))
        keys = []
    elif text.lstrip().startswith(FLOW[:2]) and text.count("{") > text.count("}"):
        faults.append(
            Fault(mark, "", "a brace is never closed; in a shell, put the whole value in quotes")
        )
    elif text.lstrip().startswith(FLOW):
        node = read(text, mark.source, faults, placed=False)
    else:
        node = plain_node(text.strip(), mark, name.strip(), faults)
    if node is None:
        return Node({}, mark)
    # From the innermost key outwards.
    for key in reversed(keys):
        node = Node({key: replace(node, key_mark=mark)}, mark)
    return node
