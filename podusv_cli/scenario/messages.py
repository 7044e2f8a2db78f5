"""From a tree to a scenario: pydantic's complaints as sentences at the place of the value."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pydantic import ValidationError

from podusv_cli.core.errors import SizingError
from podusv_cli.core.phrases import describe_found, did_you_mean, hint, unknown_word, without_case
from podusv_cli.scenario.keys import NAME, NUMBER, Key, either, limits
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.presets import stands_in
from podusv_cli.scenario.yaml_tree import Fault, Node, Route, dotted_key, follow, plain

MOST_PLACES = 4  # of a key, in a message


def check(root: Node, top: Key, faults: list[Fault]) -> Scenario | None:
    """The scenario of a complete tree, or None with every fault appended to `faults`.

    `top` are the scenario's keys.
    """
    try:
        given = top.scenario.model_validate(with_defaults(top, plain(root)))
    except ValidationError as error:
        faults.extend(dict.fromkeys(_faults(root, top, error)))
        return None
    try:
        return given.in_numbers()
    except SizingError as error:
        faults.append(Fault(follow(root, ("actuator",))[-1].mark, "actuator", str(error)))
        return None


def with_defaults(key: Key | None, data: Any) -> Any:
    """The `data` of a section over its default, which `key` describes; likewise in parts of it.

    Otherwise one key given under `disturbance.b_u` would silently set the others to zero.
    """
    if isinstance(data, tuple):
        return tuple(with_defaults(key and key.item(i), item) for i, item in enumerate(data))
    if not isinstance(data, dict) or key is None:
        return data
    section = key.kinds.get(str(data.get("kind")), key)
    if not section.section:
        return {name: with_defaults(key.item(name), entry) for name, entry in data.items()}
    given = {n: with_defaults(section.keys.get(n), entry) for n, entry in data.items()}
    return dict(key.default) | given if isinstance(key.default, section.section) else given


def _faults(root: Node, top: Key, error: ValidationError) -> Iterator[Fault]:
    """A fault for each complaint of pydantic, but for those of what the loader copied in."""
    for complaint in error.errors(include_url=False):
        key = _key(top, complaint["loc"])
        if not _is_copied(root, key.path):
            yield from SENTENCES.get(complaint["type"], _wrong)(root, key, complaint)


def _is_copied(root: Node, route: Route) -> bool:
    """Whether a value was copied from another section, where it has a message already."""
    # `controller` is then the first of `controllers`, which has the message.
    if stands_in(root) and route[:1] != ("nominal",):
        return route[:1] == ("controller",)
    if route[:1] not in (("nominal",), ("controllers",)):
        return False
    source: Route = ("vessel", *route[1:]) if route[0] == "nominal" else ("controller", *route[2:])
    return follow(root, route)[-1] is follow(root, source)[-1]


def _key(top: Key, location: Route) -> Key:
    """The key at pydantic's location, as far as it is known; tags of unions lead nowhere."""
    key = top
    for step in location:
        key = next(iter(key.inside(step)), key)
    return key


def _is_explained(root: Node, route: Route) -> bool:
    """Whether an earlier fault explains that something is missing here."""
    return any(node.faulty for node in follow(root, route))


def _unknown_key(root: Node, section: Key, complaint: Any) -> Iterator[Fault]:
    """A fault for a key that `section` lacks, with the key that may be meant, or its place."""
    name = str(complaint["loc"][-1])
    route = (*section.path, name)
    node = follow(root, route)[-1]
    hint = (
        _hint_of_blank(section, name)
        or _elsewhere(section, name)
        or did_you_mean(name, section.keys)
    )
    # Kinds as keys are meant as a list, whatever the key is like.
    several = _several(section, follow(root, section.path)[-1])
    hints = several or f"{hint} (allowed: {', '.join(section.keys)})"
    yield Fault(node.key_mark or node.mark, dotted_key(route), f"unknown key{hints}")


def _hint_of_blank(section: Key, name: str) -> str:
    """`; write a blank after the colon: x: 1`, for `{x:1}`."""
    key, _, number = name.partition(":")
    return f"; write a blank after the colon: {key}: {number}" if key in section.keys else ""


def _several(section: Key, given: Node) -> str:
    """`; for several write a list: ...`, where a section has kinds for keys and may be a list.

    `given` is the section as written, `section` its key. "" elsewhere.
    """
    whole = section.top.follow(section.path)[0] if section.path else section
    keys = {name for kind in whole.kinds.values() for name in kind.keys}  # `file` is both
    kinds = [name for name in given.mapping if name in whole.kinds and name not in keys]
    if not kinds or not whole.item(0):
        return ""
    written = ", ".join(f"{{kind: {kind}, ...}}" for kind in kinds)
    return f"; for several kinds write a list: {whole.path[-1]}: [{written}]"


def _elsewhere(section: Key, name: str) -> str:
    """Where else a key `name` belongs, as the end of a message; "" where it is unknown everywhere.

    `; K_Pu belongs to kind pid`, or at the top `; did you mean 'controller.K_Pu'?`.
    """
    if section.path:
        same = section.top.follow(section.path)
        of_kinds = {key.kind: key for key in same} if len(same) > 1 else same[0].kinds
        return _home(name, of_kinds) or _below(name, section)
    alike = (
        key.path
        for key in section.top.all()
        if without_case(str(key.path[-1])) == without_case(name)
    )
    places = dict.fromkeys(dotted_key(path) for path in alike if {NAME, NUMBER}.isdisjoint(path))
    return f"; did you mean {either([repr(p) for p in places][:MOST_PLACES])}?" if places else ""


def _below(name: str, section: Key) -> str:
    """`; did you mean 'command.delay'?`, where a section in this one has such a key."""
    places = [f"{part}.{name}" for part, key in section.keys.items() if name in key.keys]
    return f"; did you mean {either([repr(place) for place in places])}?" if places else ""


def _home(name: str, kinds: dict[str, Key]) -> str:
    """Which kinds of a section have a key that not all of them have."""
    homes = [kind for kind, section in kinds.items() if name in section.keys]
    return f"; {name} belongs to kind {either(homes)}" if 0 < len(homes) < len(kinds) else ""


def _missing(root: Node, key: Key, complaint: Any) -> Iterator[Fault]:
    """A fault for a required key that is not there; for a missing item, of its list.

    `complaint` is the error of pydantic. No fault where an earlier one explains it.
    """
    if isinstance(key.path[-1], int):
        yield from _wrong(root, _key(key.top, complaint["loc"][:-1]), complaint)
    elif not _is_explained(root, key.path):
        mark = follow(root, key.path)[-1].mark
        yield Fault(mark, dotted_key(key.path), f"missing; must be {key.expectation}")


def _no_kind(root: Node, section: Key, complaint: Any) -> Iterator[Fault]:
    """A fault for a section without `kind`; its keys may show which kind was meant.

    No fault where an earlier one explains it.
    """
    route = (*section.path, "kind")
    if not _is_explained(root, route):
        node = follow(root, section.path)[-1]
        homes = filter(None, (_home(name, section.kinds) for name in node.mapping))
        several = _several(section, node)
        text = f"missing (allowed: {', '.join(section.kinds)}){several or next(homes, '')}"
        yield Fault(node.mark, dotted_key(route), text)


def _unknown_kind(root: Node, section: Key, complaint: Any) -> Iterator[Fault]:
    """A fault for a kind that `section` has not, with the kinds that it has."""
    route = (*section.path, "kind")
    node = follow(root, route)[-1]
    what = f"kind {describe_found(node.content, node.text)}"
    yield Fault(node.mark, dotted_key(route), unknown_word(what, str(node.content), section.kinds))


def _impossible(root: Node, key: Key, complaint: Any) -> Iterator[Fault]:
    """What a part's own check said; it wrote the sentence, so it stands as it is."""
    if not _is_explained(root, key.path):
        mark = follow(root, key.path)[-1].mark
        yield Fault(mark, dotted_key(key.path), str(complaint["ctx"]["error"]))


def _wrong(root: Node, key: Key, complaint: Any) -> Iterator[Fault]:
    """A value of the wrong type or out of range, with what is expected and what was found.

    `key` describes it; `complaint` is pydantic's.
    """
    node = follow(root, key.path)[-1]
    if (
        isinstance(node.content, dict) and key.section
    ):  # that may be a number, too: what is in it is reported
        return
    what = describe_found(node.content, node.text)
    yield Fault(
        node.mark,
        dotted_key(key.path),
        f"must be {key.expectation}, found {what}{_hint(node, key)}",
    )


def _hint(node: Node, key: Key) -> str:
    """How to write the value, if its text shows what was meant."""
    if isinstance(node.content, float) and node.content % 1 == 0 and int in key.types:
        return f"; write {int(node.content)}"
    if node.content is None and key.section:
        return "; it cannot be left out"
    # Hydrodynamic derivatives of damping are negative.
    if type(node.content) in (int, float) and limits(key.field).get("le") == 0:
        return f"; it is negative here, as it is published with the force: {-node.content:g}?"
    if node.mapping and str in key.types:
        return "; put text with braces in quotes"
    if not isinstance(node.content, str):
        return hint(node.text, (bool,) if bool in key.types else ())
    if node.content and node.content in key.kinds:
        return f"; write {{kind: {node.content}}}"
    return key.advice(node.content) or did_you_mean(node.content, key.choices)


SENTENCES = {
    "extra_forbidden": _unknown_key,
    "missing": _missing,
    "union_tag_not_found": _no_kind,
    "union_tag_invalid": _unknown_kind,
    "value_error": _impossible,
}
