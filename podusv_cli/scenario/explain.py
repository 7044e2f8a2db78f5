"""What every key of a scenario means, read from the models, and what every signal means."""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache

from podusv_cli.core import registry
from podusv_cli.core.component import Component, unit_of
from podusv_cli.core.errors import PodusvError
from podusv_cli.core.signal import Signal
from podusv_cli.scenario.annotations import choices, joined, sections
from podusv_cli.scenario.fields import MISSING, NAME, NUMBER, Key, keys, range_of, type_of
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.presets import preset_names, preset_text, with_presets
from podusv_cli.scenario.words import as_written, did_you_mean

# What a file may leave out although the model has no default for it, and where it comes from.
FILLED_IN = {("name",): "the file's name", ("nominal",): "the vessel"}
FROM_PRESET = {"vessel": "the preset's", "nominal": "the vessel's"}


class UnknownKeyError(PodusvError):
    """Nothing that podusv knows has that name."""

    exit_code = 2


@dataclass(frozen=True)
class Row:
    """A key, kind or signal in words; empty where there is nothing to say.

    `type` is what a value may be, or says what `choices` are: the "kinds" of a section or the
    "keys" in it. `kinds` are those of a section in which the key is the same.
    """

    key: str
    meaning: str
    type: str = ""
    unit: str = ""
    range: str = ""
    default: str = ""
    choices: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()


EXTENDS = Row(
    "extends", "scenario that this one changes, a file name relative to it, or a list", "text"
)


def explain(key: str | None = None, others: Iterable[str] = ()) -> list[Row]:
    """Rows for a key, a kind, a section, a signal, a preset or, with None, all sections.

    `controller` gives its kinds, `controller.pid` that kind's keys, `controller.k_ze` or just
    `k_ze` one key, and `pid` alone the kind. Raises UnknownKeyError, with what was probably meant;
    `others` are names that are explained elsewhere.
    """
    if key is None:
        return [EXTENDS, *_together(entry for entry in _keys() if len(entry.path) == 1)]
    if key == EXTENDS.key:
        return [EXTENDS]
    place = tuple(NUMBER if step.isdecimal() else step for step in key.split("."))
    parts = (_signal, _named, _kinds_named, _presets)
    found = _at(place) or [row for look in parts for row in look(key)]
    if not found:
        raise UnknownKeyError(f"{key}: no such name{did_you_mean(key, [*_names(), *others])}")
    return found


def kinds() -> dict[str, dict[str, str]]:
    """For every section that has kinds, what each kind is, in a sentence."""
    parts = {name: sections(field.annotation) for name, field in Scenario.model_fields.items()}
    return {
        name: {kind: summary(model) for kind, model in found.items()}
        for name, found in parts.items()
        if found and "" not in found
    }


def summary(model: type[Component]) -> str:
    """The first sentence of a component's documentation."""
    return first_sentence(inspect.getdoc(model) or "")


def first_sentence(text: str) -> str:
    """The first paragraph's first sentence, on one line."""
    paragraph = " ".join(text.split("\n\n")[0].split())
    return paragraph.partition(". ")[0].removesuffix(".") + "."


@cache
def _keys() -> tuple[Key, ...]:
    return tuple(keys(Scenario))


def _names() -> list[str]:
    """Everything that can be asked for."""
    asked = [
        (e.path, e.route, e.path[-1:], (*e.path[:1], e.kind)[: 1 + bool(e.kind)]) for e in _keys()
    ]
    keyed = [".".join(name) for names in asked for name in names]
    presets = [name for _, given in with_presets().values() for name in preset_names(given)]
    return list(dict.fromkeys([*keyed, *(signal.name for signal in signals()), *presets]))


def _at(place: tuple[str, ...]) -> list[Row]:
    """The section, kind or key at a place, and what is in it."""
    entries = [entry for entry in _keys() if place in (entry.path, entry.route)]
    kinds = [
        (kind, part) for e in entries for kind, part in sections(e.field.annotation).items() if kind
    ]
    if kinds:
        rows = {kind: _kind_row((*place, kind), part) for kind, part in kinds}
        return [*_together(entries), *rows.values()]
    if not entries:
        return _of_kind(place)
    inside = [e for e in _keys() if {e.path[:-1], e.route[:-1]} & {place, *_items(place)}]
    heads = (replace(row, choices=() if inside else row.choices) for row in _together(entries))
    return [*heads, *_together(inside)]


def _of_kind(place: tuple[str, ...]) -> list[Row]:
    """One kind of a section and its keys."""
    own = [entry.route for entry in _keys() if place == entry.route[:-1]]
    places = {place, *(item for route in own for item in _items(route))}
    inside = [entry for entry in _keys() if entry.route[:-1] in places]
    above = [entry for entry in _keys() if place[:-1] in (entry.path, entry.route)]
    heads = [
        _kind_row(place, sections(entry.field.annotation)[place[-1]]) for entry in above if inside
    ]
    return [
        *(replace(head, choices=()) for head in heads),
        *(replace(row, kinds=()) for row in _together(inside)),
    ]


def _named(name: str) -> list[Row]:
    """Every key whose last word this is, and what is in the items of one that has several."""
    own = {entry.route for entry in _keys() if entry.path[-1] == name}
    items = {item for route in own for item in _items(route)}
    return _together(e for e in _keys() if e.route in own or e.route[:-1] in items)


def _kinds_named(name: str) -> list[Row]:
    """Every kind of this name, and its keys."""
    parts = {entry.path: sections(entry.field.annotation) for entry in _keys()}
    return [row for path, kinds in parts.items() if name in kinds for row in _at((*path, name))]


def _items(place: tuple[str, ...]) -> tuple[tuple[str, ...], ...]:
    """Where the keys of a mapping's or a list's items are."""
    return (*place, NAME), (*place, NUMBER)


@cache
def signals() -> tuple[Signal, ...]:
    """Every signal that a run of podusv can log or give; a name may have several meanings."""
    rooms = ("core", "controllers", "actuators", "theory")
    return tuple(registry.signals(*(f"podusv_cli.{room}" for room in rooms)))


def _signal(name: str) -> list[Row]:
    found = [signal for signal in signals() if signal.name == name]
    return [Row(name, signal.meaning, "signal", signal.unit) for signal in found]


def _presets(name: str) -> list[Row]:
    """Every preset of this name: where its numbers come from, and what they hold for."""
    return [
        Row(
            name,
            f"{preset_text(presets, name, 'source')} "
            f"Validity: {preset_text(presets, name, 'validity')}",
            f"{presets.noun} ({key}.preset)",
        )
        for key, (_, presets) in with_presets().items()
        if name in preset_names(presets)
    ]


def _together(entries: Iterable[Key]) -> list[Row]:
    """A row for each key, one for all kinds in which it is the same."""
    kinds: dict[Row, list[str]] = {}
    for entry in entries:
        kinds.setdefault(_row(entry), []).append(entry.kind)
    return [replace(row, kinds=tuple(filter(None, found))) for row, found in kinds.items()]


def _kind_row(place: tuple[str, ...], model: type[Component]) -> Row:
    return Row(".".join(place), summary(model), "keys", choices=tuple(model.model_fields))


def _row(entry: Key) -> Row:
    field, name = entry.field, entry.path[-1]
    key, meaning = ".".join(entry.path), field.description or f"which {entry.path[-2]} it is"
    parts = sections(field.annotation)
    if parts:
        inside = tuple(parts[""].model_fields) if "" in parts else tuple(parts)
        return Row(key, meaning, "keys" if "" in parts else "kinds", choices=inside)
    words = _choices(entry)
    kind = joined(words) if name in ("preset", "kind") else type_of(field)
    return Row(key, meaning, kind, unit_of(field), range_of(field), _default(entry), words)


def _choices(entry: Key) -> tuple[str, ...]:
    """The words that a value may be; of a kind, all that its section has."""
    if entry.path[-1] == "preset":
        section = entry.path[0].replace("nominal", "vessel")
        _, presets = with_presets()[".".join(filter(None, (section, entry.kind)))]
        return preset_names(presets)
    if entry.path[-1] == "kind":
        above = (other for other in _keys() if other.path == entry.path[:-1])
        return tuple(kind for other in above for kind in sections(other.field.annotation))
    return choices(entry.field.annotation)


def _default(entry: Key) -> str:
    """What the value is when it is left out, as it would be written."""
    if entry.path in FILLED_IN:
        return FILLED_IN[entry.path]
    if entry.path[0] in FROM_PRESET and entry.path != ("vessel", "preset"):
        return FROM_PRESET[entry.path[0]]
    if entry.default is MISSING or entry.path[-1] == "kind":
        return "required"
    return as_written(entry.default)
