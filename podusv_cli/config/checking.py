"""From a tree to a scenario: pydantic's complaints as sentences at the place of the value."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, get_origin

from pydantic import ValidationError
from pydantic.fields import FieldInfo

from podusv_cli.config import words
from podusv_cli.config.fields import choices, is_component, item, members, noun, sections, wanted
from podusv_cli.config.scenario import Scenario
from podusv_cli.config.tree import Fault, Node, Route, dotted, find, follow, plain
from podusv_cli.registry import Component


@dataclass(frozen=True)
class Spot:
    """Where one of pydantic's complaints points: the route without kinds and union members.

    `model` is the class whose keys are at the end of the route, None at a value; `field` is the
    last field on the way, `annotation` the type wanted at the end.
    """

    route: Route
    model: type[Component] | None
    field: FieldInfo | None
    annotation: Any


def check(root: Node, faults: list[Fault]) -> Scenario | None:
    """The scenario of a complete tree, or None with every fault appended to `faults`."""
    try:
        scenario = Scenario.model_validate(with_defaults(Scenario, plain(root)))
    except ValidationError as error:
        faults.extend(dict.fromkeys(_faults(root, error)))
        return None
    for key, text in scenario.misfits():
        faults.append(Fault(follow(root, tuple(key.split(".")))[-1].mark, key, text))
    return scenario


def with_defaults(
    model: type[Component], data: dict[str, Any], whole: Component | None = None
) -> dict[str, Any]:
    """The data over the values of `whole`, which is what the section is when it is left out.

    Otherwise one key given under `disturbance.b_u` would silently set the others to zero.
    """
    filled = dict(whole or {}) | data
    for name, field in model.model_fields.items():
        given = data.get(name)
        if isinstance(given, dict):
            part = sections(field).get("") or sections(field).get(str(given.get("kind")))
            inner = getattr(whole, name) if whole else field.default
            is_whole = part is not None and isinstance(inner, part)
            filled[name] = (
                with_defaults(part, given, inner if is_whole else None) if part else given
            )
    return filled


def _faults(root: Node, error: ValidationError) -> Iterator[Fault]:
    for complaint in error.errors(include_url=False):
        spot = _spot(complaint["loc"])
        is_copy = spot.route[:1] == ("nominal",) and _copied(root, spot.route)
        if not is_copy:
            yield from SENTENCES.get(complaint["type"], _wrong)(root, spot, complaint)


def _copied(root: Node, route: Route) -> bool:
    """Whether a value of the nominal vessel is the true vessel's, which is complained of already."""
    original = follow(root, ("vessel", *route[1:]))
    return follow(root, route)[-1] is original[-1] and len(original) == len(follow(root, route))


def _spot(location: tuple[int | str, ...]) -> Spot:
    """Follow pydantic's location through the models, dropping its tags."""
    spot = Spot((), Scenario, None, Scenario)
    steps = list(location)
    while steps:
        step = steps.pop(0)
        if spot.model and step in spot.model.model_fields:
            spot = _entered(spot, str(step), steps)
        elif spot.model:
            return Spot((*spot.route, step), None, None, None)
        elif isinstance(step, int):
            inner = item(spot.annotation, step)
            spot = Spot((*spot.route, step), None, spot.field, inner)
    return spot


def _entered(spot: Spot, name: str, steps: list[int | str]) -> Spot:
    """The spot one field further; a kind that comes next in `steps` is taken off."""
    assert spot.model
    field = spot.model.model_fields[name]
    parts = sections(field)
    model = parts.get("")
    if not model and steps and steps[0] in parts:
        model = parts[str(steps.pop(0))]
    return Spot((*spot.route, name), model, field, field.annotation)


def _told(root: Node, route: Route) -> bool:
    """Whether a fault that was told before explains that something is missing here."""
    return any(node.faulty for node in follow(root, route))


def _unknown_key(root: Node, spot: Spot, complaint: Any) -> Iterator[Fault]:
    *above, key = complaint["loc"]
    model = _spot(tuple(above)).model
    node = find(root, spot.route)
    assert node and model
    text = words.unknown("key", str(key), model.model_fields)
    yield Fault(node.key_mark or node.mark, dotted(spot.route), text)


def _missing(root: Node, spot: Spot, complaint: Any) -> Iterator[Fault]:
    if isinstance(spot.route[-1], int):
        yield from _wrong(root, _spot(complaint["loc"][:-1]), complaint)
    elif not _told(root, spot.route):
        assert spot.field
        mark = follow(root, spot.route[:-1])[-1].mark
        yield Fault(mark, dotted(spot.route), f"missing; must be {wanted(spot.field)}")


def _no_kind(root: Node, spot: Spot, complaint: Any) -> Iterator[Fault]:
    route = (*spot.route, "kind")
    if not _told(root, route):
        assert spot.field
        kinds = ", ".join(sections(spot.field))
        mark = follow(root, spot.route)[-1].mark
        yield Fault(mark, dotted(route), f"missing (allowed: {kinds})")


def _unknown_kind(root: Node, spot: Spot, complaint: Any) -> Iterator[Fault]:
    route = (*spot.route, "kind")
    node = find(root, route)
    assert node and spot.field
    what = f"kind {words.found(node.content, node.text)}"
    text = words.unknown(what, str(node.content), sections(spot.field))
    yield Fault(node.mark, dotted(route), text)


def _impossible(root: Node, spot: Spot, complaint: Any) -> Iterator[Fault]:
    if not _told(root, spot.route):
        mark = follow(root, spot.route)[-1].mark
        yield Fault(mark, dotted(spot.route), str(complaint["ctx"]["error"]))


def _wrong(root: Node, spot: Spot, complaint: Any) -> Iterator[Fault]:
    node = find(root, spot.route)
    if node is None or spot.field is None:
        raise AssertionError(f"unexpected complaint {complaint}")
    at_item = bool(spot.route) and isinstance(spot.route[-1], int)
    must_be = noun(spot.annotation) if at_item else wanted(spot.field)
    annotation = spot.annotation if at_item else spot.field.annotation
    text = f"must be {must_be}, found {words.found(node.content, node.text)}"
    yield Fault(node.mark, dotted(spot.route), text + _hint(node, annotation, spot.field))


def _hint(node: Node, annotation: Any, field: FieldInfo) -> str:
    """How the value should have been written, where its looks tell."""
    types = members(annotation)
    if isinstance(node.content, float) and node.content % 1 == 0 and int in types:
        return f"; write {int(node.content)}"
    text = node.content if isinstance(node.content, str) else node.text
    if any(is_component(part) for part in types):
        return f"; write {{kind: {text}}}" if text and text in sections(field) else ""
    if not isinstance(node.content, str):
        return words.hint(text, words.TRUTH_HINTS) if bool in types else ""
    fitting = [
        hints for kind, hints in HINTS.items() if kind in [get_origin(t) or t for t in types]
    ]
    said = next((s for s in (words.hint(text, hints) for hints in fitting) if s), "")
    return said or words.did_you_mean(text, choices(annotation))


HINTS = {
    float: words.NUMBER_HINTS,
    int: words.NUMBER_HINTS,
    bool: words.TRUTH_HINTS,
    tuple: words.LIST_HINTS,
}
SENTENCES = {
    "extra_forbidden": _unknown_key,
    "missing": _missing,
    "union_tag_not_found": _no_kind,
    "union_tag_invalid": _unknown_kind,
    "value_error": _impossible,
}
