"""From a tree to a scenario: pydantic's complaints as sentences at the place of the value."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any, get_origin

from pydantic import ValidationError
from pydantic.fields import FieldInfo

from podusv_cli.core.component import Component
from podusv_cli.scenario import words
from podusv_cli.scenario.annotations import (
    choices,
    inside,
    is_component,
    joined,
    members,
    noun,
    sections,
)
from podusv_cli.scenario.fields import NAME, NUMBER, keys, wanted
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.yaml_tree import Fault, Node, Route, dotted, follow, plain, route

MOST_PLACES = 4  # of a key, in a message


@dataclass(frozen=True)
class Spot:
    """Where a complaint points: the route without kinds and union members, and the type there.

    `field` is the one at the end of the route, None at the item of a list or an unknown key.
    """

    route: Route
    annotation: Any
    field: FieldInfo | None = None

    @property
    def must_be(self) -> str:
        """What is wanted there."""
        return wanted(self.field) if self.field else noun(self.annotation)


Check = Callable[[Scenario], list[tuple[str, str]]]  # keys, and what is wrong with them


def check(root: Node, faults: list[Fault], more: Sequence[Check] = ()) -> Scenario | None:
    """The scenario of a complete tree, or None with every fault appended to `faults`."""
    try:
        scenario = Scenario.model_validate(filled(Scenario, plain(root)))
    except ValidationError as error:
        faults.extend(dict.fromkeys(_faults(root, error)))
        return None
    for key, text in chain(scenario.misfits(), *(look(scenario) for look in more)):
        faults.append(Fault(follow(root, route(key))[-1].mark, key, text))
    return scenario


def filled(annotation: Any, data: Any, whole: Any = None) -> Any:
    """The data over the values of `whole`, which is what a section is when it is left out.

    Otherwise one key given under `disturbance.b_u` would silently set the others to zero.
    """
    if isinstance(data, tuple):
        return tuple(filled(inside(annotation, i), item) for i, item in enumerate(data))
    if not isinstance(data, dict):
        return data
    parts = {"": annotation} if is_component(annotation) else sections(annotation)
    part = parts.get("") or parts.get(str(data.get("kind")))
    if not part:
        return {name: filled(inside(annotation, name), entry) for name, entry in data.items()}
    under = whole if isinstance(whole, part) else None
    fields = part.model_fields
    return dict(under or {}) | {
        name: filled(
            fields[name].annotation, entry, getattr(under, name) if under else fields[name].default
        )
        if name in fields
        else entry
        for name, entry in data.items()
    }


def _faults(root: Node, error: ValidationError) -> Iterator[Fault]:
    for complaint in error.errors(include_url=False):
        spot = _spot(complaint["loc"])
        if not _copied(root, spot.route):
            yield from SENTENCES.get(complaint["type"], _wrong)(root, spot, complaint)


def _copied(root: Node, route: Route) -> bool:
    """Whether a value was taken over from another section, which is complained of already."""
    if route[:1] not in (("nominal",), ("controllers",)):
        return False
    source: Route = ("vessel", *route[1:]) if route[0] == "nominal" else ("controller", *route[2:])
    return follow(root, route)[-1] is follow(root, source)[-1]


def _model(annotation: Any, kind: object = None) -> type[Component] | None:
    """The class whose keys a mapping has; of several, the one that `kind` tells."""
    if is_component(annotation):
        return annotation
    return sections(annotation).get("" if kind is None else str(kind))


def _spot(location: tuple[int | str, ...]) -> Spot:
    """Follow pydantic's location through the models; kinds and union members do not count."""
    spot = Spot((), Scenario)
    for step in location:
        model = _model(spot.annotation)
        inner = inside(spot.annotation, step)
        if model:
            field = model.model_fields.get(str(step))
            spot = Spot((*spot.route, step), field and field.annotation, field)
        elif kind := _model(spot.annotation, step):
            spot = Spot(spot.route, kind, spot.field)
        elif inner is not None:
            spot = Spot((*spot.route, step), inner)
    return spot


def _told(root: Node, route: Route) -> bool:
    """Whether a fault that was told before explains that something is missing here."""
    return any(node.faulty for node in follow(root, route))


def _unknown_key(root: Node, spot: Spot, complaint: Any) -> Iterator[Fault]:
    *above, key = complaint["loc"]
    model = _model(_spot(tuple(above)).annotation)
    node, known = follow(root, spot.route)[-1], tuple(model.model_fields if model else ())
    hint = _elsewhere(spot.route, str(key)) or words.did_you_mean(str(key), known)
    text = f"unknown key{hint} (allowed: {', '.join(known)})"
    yield Fault(node.key_mark or node.mark, dotted(spot.route), text)


def _elsewhere(route: Route, key: str) -> str:
    """`; K_Pu belongs to kind pid`, or at the top `; did you mean 'controller.K_Pu'?`."""
    if len(route) > 1:
        above = _spot(tuple(route[:-1]))
        return _home(key, sections(above.annotation)) if above.route == route[:-1] else ""
    alike = (k.path for k in keys(Scenario) if words.folded(k.path[-1]) == words.folded(key))
    places = dict.fromkeys(".".join(path) for path in alike if {NAME, NUMBER}.isdisjoint(path))
    return f"; did you mean {joined([repr(p) for p in places][:MOST_PLACES])}?" if places else ""


def _home(key: str, parts: dict[str, type[Component]]) -> str:
    """Which kinds of a section have a key that not all of them have."""
    kinds = [kind for kind, part in parts.items() if kind and key in part.model_fields]
    return f"; {key} belongs to kind {joined(kinds)}" if 0 < len(kinds) < len(parts) else ""


def _missing(root: Node, spot: Spot, complaint: Any) -> Iterator[Fault]:
    if isinstance(spot.route[-1], int):
        yield from _wrong(root, _spot(complaint["loc"][:-1]), complaint)
    elif not _told(root, spot.route):
        mark = follow(root, spot.route)[-1].mark
        yield Fault(mark, dotted(spot.route), f"missing; must be {spot.must_be}")


def _no_kind(root: Node, spot: Spot, complaint: Any) -> Iterator[Fault]:
    route = (*spot.route, "kind")
    if not _told(root, route):
        kinds = ", ".join(sections(spot.annotation))
        node, parts = follow(root, spot.route)[-1], sections(spot.annotation)
        homes = filter(None, (_home(key, parts) for key in node.mapping))
        yield Fault(node.mark, dotted(route), f"missing (allowed: {kinds}){next(homes, '')}")


def _unknown_kind(root: Node, spot: Spot, complaint: Any) -> Iterator[Fault]:
    route = (*spot.route, "kind")
    node = follow(root, route)[-1]
    what = f"kind {words.found(node.content, node.text)}"
    text = words.unknown(what, str(node.content), sections(spot.annotation))
    yield Fault(node.mark, dotted(route), text)


def _impossible(root: Node, spot: Spot, complaint: Any) -> Iterator[Fault]:
    if not _told(root, spot.route):
        mark = follow(root, spot.route)[-1].mark
        yield Fault(mark, dotted(spot.route), str(complaint["ctx"]["error"]))


def _wrong(root: Node, spot: Spot, complaint: Any) -> Iterator[Fault]:
    node = follow(root, spot.route)[-1]
    what = words.found(node.content, node.text)
    text = f"must be {spot.must_be}, found {what}{_hint(node, spot.annotation)}"
    yield Fault(node.mark, dotted(spot.route), text)


def _hint(node: Node, annotation: Any) -> str:
    """How the value should have been written, where its looks tell."""
    types = [get_origin(member) or member for member in members(annotation)]
    if isinstance(node.content, float) and node.content % 1 == 0 and int in types:
        return f"; write {int(node.content)}"
    if not isinstance(node.content, str):
        return words.hint(node.text, words.TRUTH_HINTS) if bool in types else ""
    if node.content and node.content in sections(annotation):
        return f"; write {{kind: {node.content}}}"
    said = (words.hint(node.content, hints) for kind, hints in HINTS.items() if kind in types)
    return next(filter(None, said), "") or words.did_you_mean(node.content, choices(annotation))


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
