"""What a section keeps of one of another kind that it stands in place of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from podusv_cli.core.phrases import as_yaml
from podusv_cli.scenario.keys import Key
from podusv_cli.scenario.yaml_tree import Node, Route, bracketed_key, dotted_key, merge, plain


def merge_kept(root: Node, top: Key, dropped: list[str]) -> Node:
    """The tree whose sections have what they keep of those that they stand in place of.

    `top` are the scenario's keys. For each section that keeps not everything, or numbers that may
    be defaults of the other kind, a sentence with the values is appended to `dropped`.
    """
    return _merge_node(root, top, (), dropped)


def _merge_node(node: Node, key: Key, at: Route, dropped: list[str]) -> Node:
    """The node with what it stands `instead_of` merged in below it, layer by layer.

    `key` describes the node and `at` leads to it. Sentences on what another kind has no use for are
    appended to `dropped`.
    """
    # That section may itself stand in place of another one.
    if node.instead_of:
        base = _merge_node(node.instead_of, key, at, dropped)
        dropped += [*_lost_keys(base, node, key, at), *_sized_for_another(base, node, key, at)]
        node = over(base, replace(node, instead_of=None), key)
    item = key.item(0)
    if isinstance(node.content, tuple):
        if not item or not item.kinds:
            return node
        parts = enumerate(node.content)
        return replace(
            node, content=tuple(_merge_node(part, item, (*at, i), dropped) for i, part in parts)
        )
    section = key.kinds.get(node.word("kind"), key)
    for name, entry in node.mapping.items():
        below = section.keys.get(name) or key.item(name)
        if below and (entry.mapping or isinstance(entry.content, tuple)):
            node = node.with_entry(name, _merge_node(entry, below, (*at, name), dropped))
    return node


def over(base: Node, own: Node, key: Key) -> Node:
    """The section `own` over those values of `base` that its kind takes, too.

    `key` is what the models say of both. A key of the same name with another type or unit is
    another key, and the default of one kind means nothing to another: a scenario that is written
    out has all of them. Disturbances keep nothing of another kind (`stands_alone`).
    """
    new = key.kinds.get(own.word("kind") or base.word("kind"))
    if not new or not isinstance(own.content, dict):
        return own
    taken = {name: part for name, part in base.mapping.items() if _is_taken(name, base, new, key)}
    # By kind, `merge` would set the base aside once more.
    return merge(replace(base, content=taken), own, by_kind=False)


def _is_taken(name: str, base: Node, new: Key, key: Key) -> bool:
    """Whether the kind `new` takes the value `name` of the section `base`.

    The section may be of another kind; `key` is its key.
    """
    old = key.kinds.get(base.word("kind"))
    if name == "kind" or not old or old.kind == new.kind:
        return name in new.keys
    if new.model.stands_alone or name not in new.keys or name not in old.keys:
        return False
    one, other = old.keys[name], new.keys[name]
    alike = (one.annotation, one.unit) == (other.annotation, other.unit)
    return alike and not _usual(base.mapping[name], old, name)


def _lost_keys(base: Node, own: Node, key: Key, at: Route) -> list[str]:
    """A sentence on values of `base` that the section `own` does not keep, or an empty list.

    Defaults do not count.
    """
    old, new = (key.kinds.get(node.word("kind")) for node in (base, own))
    if not old or not new or new.model.stands_alone:
        return []
    lost = {
        name: part
        for name, part in base.mapping.items()
        if not (_is_taken(name, base, new, key) or name in own.mapping or _usual(part, old, name))
    }
    return (
        [f"{_describe_change(own, at)} in place of {old.kind}, which loses {_join_names(lost)}"]
        if lost
        else []
    )


def _sized_for_another(base: Node, own: Node, key: Key, at: Route) -> list[str]:
    """A sentence on numbers kept from another kind that may have been its defaults, or none.

    `base` and `own` are the section below and above, `at` leads to it, `key` describes it. A
    section that is written out has them all as numbers, as if each had been chosen.
    """
    old, new = (key.kinds.get(node.word("kind")) for node in (base, own))
    if not old or not new or old.kind == new.kind or not base.mapping.keys() >= old.keys.keys():
        return []
    if any(plain(base.mapping[name]) is None for name in old.model.rules):
        return []  # so that the numbers are given ones
    sized = {
        name: part
        for name, part in base.mapping.items()
        if name in {*old.model.rules} & {*new.model.rules}
        and name not in own.mapping
        and _is_taken(name, base, new, key)
    }
    if not sized:
        return []
    return [
        f"{_describe_change(own, at)} keeps {_join_names(sized)}, which may have been defaults "
        f"of {old.kind}; null takes those of {new.kind}"
    ]


def _describe_change(own: Node, at: Route) -> str:
    """Where a section has another kind, and which."""
    return f"{own.mapping['kind'].mark}: {bracketed_key(dotted_key(at))}: kind {own.word('kind')}"


def _join_names(parts: Mapping[str, Node]) -> str:
    return ", ".join(f"{name}: {as_yaml(plain(part))}" for name, part in parts.items())


def _usual(part: Node, kind: Key, name: str) -> bool:
    """Whether a value is the default of a kind's key."""
    default = kind.keys[name].default if name in kind.keys else None
    return bool(plain(part) == getattr(default, "model_dump", lambda: default)())
