"""What every key, kind, signal and preset means, in words."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache

from podusv_cli.core import registry
from podusv_cli.core.component import BY_RULE, Component
from podusv_cli.core.errors import PodusvError
from podusv_cli.core.phrases import as_yaml, did_you_mean
from podusv_cli.core.plugins import Plugins
from podusv_cli.core.signal import Signal
from podusv_cli.scenario.keys import NAME, NO_DEFAULT, NUMBER, Key, either, keys_of
from podusv_cli.scenario.model import BASES, Scenario, scenario_class
from podusv_cli.scenario.named_files import ANY_FILE
from podusv_cli.scenario.presets import preset_names, preset_text, with_presets
from podusv_cli.scenario.yaml_tree import dotted_key, route, with_dotted_key

ALONE = ("path", "actuator", "measurement", "estimator")  # sections with kinds that are no list
BOOLEANS = {"true or false": ("true", "false")}
# What a file may leave out although the model has no default for it, and where it comes from.
FILLED_IN = {("name",): "the file's name", ("nominal",): "the vessel"}
FROM_PRESET = {"vessel": "the preset's", "nominal": "the vessel's"}


class UnknownKeyError(PodusvError):
    """Nothing that podusv knows has that name."""

    exit_code = 2


@dataclass(frozen=True)
class ExplainRow:
    """A key, kind or signal in words; empty where there is nothing to say.

    `type` is what a value may be, or says what `choices` are: the "kinds" of a section or the
    "keys" in it. `kinds` are those of a section in which the key is the same. `others` are units
    that a number may be written with in place of `unit`.
    """

    key: str
    meaning: str
    type: str = ""
    unit: str = ""
    range: str = ""
    default: str = ""
    choices: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    others: tuple[str, ...] = ()

    @property
    def value(self) -> str:
        """Type, range and units: `a number > 0 [m/s, or with km/h, kn]`."""
        others = f", or with {', '.join(self.others)}" if self.others else ""
        unit = f"[{self.unit}{others}]" if self.unit else ""
        return " ".join(filter(None, (self.type, self.range, unit)))


EXTENDS = ExplainRow(
    "extends",
    "scenario that this one changes: a file name relative to it, podusv:NAME.yaml for one "
    "that comes with podusv (`podusv init` lists them), or a list of these: a later one, "
    "with all that it extends, overrides the earlier",
    "text",
)


def explain(
    name: str | None = None, others: Iterable[str] = (), plugins: Plugins = ()
) -> list[ExplainRow]:
    """Rows for a key, a kind, a section, a signal, a preset or, with None, all sections.

    `controller` gives its kinds, `controller.pid` that kind's keys, `controller.k_ze` or just
    `k_ze` one key, and `pid` alone the kind. Raises UnknownKeyError, with what was probably meant;
    `others` are names that are explained elsewhere.
    """
    top = keys_of(scenario_class(plugins))
    if name is None:
        return [EXTENDS, *_rows(top.keys.values())]
    if name == EXTENDS.key:
        return [EXTENDS]
    # Entries of a list are described once, whatever their position.
    place = tuple(
        NUMBER if str(step).isdecimal() else step for step in with_dotted_key(route(name))
    )
    keys = top.follow(place) if place else []
    rows = _with_contents(keys) or _rows_named(name, top, plugins)
    if not rows:
        known = [*names(plugins), *others]
        raise UnknownKeyError(f"{name}: no such name{did_you_mean(name, known)}")
    return rows


def kinds(plugins: Plugins = ()) -> dict[str, dict[str, str]]:
    """For every section that has kinds, what each kind is, in a sentence."""
    top = keys_of(scenario_class(plugins))
    return {
        name: {kind: summary(inner.model) for kind, inner in key.kinds.items()}
        for name, key in top.keys.items()
        if key.kinds
    }


def summary(model: type[Component]) -> str:
    """The first sentence of a component's documentation."""
    return first_sentence(inspect.getdoc(model) or "")


def first_sentence(text: str) -> str:
    """The first paragraph's first sentence, on one line."""
    paragraph = " ".join(text.split("\n\n")[0].split())
    return paragraph.partition(". ")[0].removesuffix(".") + "."


def names(plugins: Plugins = ()) -> list[str]:
    """Every name that can be explained, some of them twice: keys, kinds, signals, presets."""
    top = keys_of(scenario_class(plugins))
    places = [place for key in top.all() for place in (key.path, key.route, key.route[-1:])]
    presets = [n for _, given in with_presets(top).values() for n in preset_names(given, plugins)]
    return [*map(dotted_key, places), *(signal.name for signal in signals(plugins)), *presets]


def assignments(plugins: Plugins = ()) -> dict[str, str]:
    """What `--set` takes, and the key's meaning: `control.period=`, `path.kind=line`, ..."""
    return dict(_assignments_below("", keys_of(scenario_class(plugins))))


def assignments_in(scenario: Scenario) -> dict[str, str]:
    """As `assignments`, for this scenario: keys of the kinds that it has, at their places in it."""
    top = keys_of(type(scenario))
    parts = {name: getattr(scenario, name) for name in ALONE}
    parts |= {**scenario.disturbances(), **scenario.laws()}
    plain = dict(_assignments_below("", top, of_kinds=False))
    for place, part in parts.items():
        kinds = top.follow(route(place))[0].kinds
        plain |= _assignments_below(place, kinds[part.kind])
    return plain


def _assignments_below(place: str, of: Key, *, of_kinds: bool = True) -> Iterator[tuple[str, str]]:
    """What `--set` takes below the key `of`, and its meaning: `place.key=`, or `place.key=word`.

    `of_kinds` says whether keys of kinds are among them.
    """
    for key in of.all():
        given = key.path[len(of.path) :]
        if key.keys or not key.field or not {NAME, NUMBER}.isdisjoint(given):
            continue
        if of_kinds or not key.kind:
            name = f"{place}.{dotted_key(given)}".removeprefix(".")
            for word in choices_of(key) or BOOLEANS.get(key.type_in_words, ("",)):
                yield f"{name}={word}", _meaning(key)


def _with_contents(keys: list[Key]) -> list[ExplainRow]:
    """Rows for `keys`, which may be kinds, then for the keys in them."""
    inside = [inner for key in keys for inner in (*key.keys.values(), *key.item_keys)]
    rows = _rows(row for key in inside for row in (key, *key.item_keys))
    # The head says the kind already.
    if any(key.is_kind for key in keys):
        rows = [replace(row, kinds=()) for row in rows]
    heads = _rows(keys)
    if rows:  # they follow, so that the heads need not list them
        heads = [head if head.type == "kinds" else replace(head, choices=()) for head in heads]
    return [*heads, *rows]


@cache
def signals(plugins: Plugins = ()) -> tuple[Signal, ...]:
    """Every signal that a run of podusv can log or give; a name may have several meanings."""
    packages = ("core", *(f"components.{section}s" for section in BASES), "theory")
    rooms = (f"podusv_cli.{package}" for package in packages)
    return tuple(registry.signals(*rooms, plugins=plugins))


def _signals(name: str, plugins: Plugins) -> list[ExplainRow]:
    named = [signal for signal in signals(plugins) if signal.name == name]
    return [ExplainRow(name, signal.meaning, "signal", signal.unit) for signal in named]


def _rows_named(name: str, top: Key, plugins: Plugins) -> list[ExplainRow]:
    """Whatever has this name, wherever it is: signals, keys, kinds, presets."""
    keys = [key for key in top.all() if key.name == name]
    return [*_signals(name, plugins), *_with_contents(keys), *_presets(name, top)]


def _presets(name: str, top: Key) -> list[ExplainRow]:
    """Every preset of this name: where its numbers come from, and what they hold for.

    `top` is the scenario's key, with all sections below it.
    """
    plugins = top.scenario.plugged
    return [
        ExplainRow(
            name,
            f"{preset_text(presets, name, 'source', plugins)} "
            f"Validity: {preset_text(presets, name, 'validity', plugins)}",
            f"{presets.noun} ({key}.preset)",
        )
        for key, (_, presets) in with_presets(top).items()
        if name in preset_names(presets, plugins)
    ]


def _rows(keys: Iterable[Key]) -> list[ExplainRow]:
    """A row for each key, one for all kinds in which it is the same."""
    kinds: dict[ExplainRow, list[str]] = {}
    for key in keys:
        kinds.setdefault(_row(key), []).append("" if key.is_kind else key.kind)
    return [replace(row, kinds=tuple(filter(None, of_kinds))) for row, of_kinds in kinds.items()]


def _row(key: Key) -> ExplainRow:
    """What `podusv explain` shows of one key: a kind, a section of keys, or a value."""
    if key.is_kind:
        return ExplainRow(
            dotted_key(key.route), summary(key.model), "keys", choices=tuple(key.keys)
        )
    path, meaning = dotted_key(key.path), _meaning(key)
    if key.keys:
        return ExplainRow(path, meaning, "kinds" if key.kinds else "keys", choices=tuple(key.keys))
    choices = choices_of(key)
    named = key.name in ("preset", "kind")
    words = [*choices, *([ANY_FILE] if key.name == "preset" else [])]
    kind = either(words) if named else key.type_in_words
    others = tuple(key.other_units)
    return ExplainRow(
        path, meaning, kind, key.unit, key.range, _default(key), choices, others=others
    )


def _meaning(key: Key) -> str:
    """What a key means: its field's description, or what it is one of."""
    if key.field is None:
        return f"one of `{dotted_key(key.path[:-1])}`"
    return key.field.description or f"which {key.path[-2]} it is"


def choices_of(key: Key) -> tuple[str, ...]:
    """The words that a value may be: presets, kinds of the section, or those of its type."""
    if key.name == "preset" and key.model.presets:
        return preset_names(key.model.presets, key.scenario.plugged)
    if key.name == "kind":
        return tuple(key.top.follow(key.path[:-1])[0].kinds)
    return key.choices


def _default(key: Key) -> str:
    """What the value is when it is left out, as YAML or in words; "required" where it cannot be."""
    if key.path in FILLED_IN:
        return FILLED_IN[key.path]
    if key.path[0] in FROM_PRESET and key.path != ("vessel", "preset"):
        return FROM_PRESET[str(key.path[0])]
    if key.default is NO_DEFAULT or key.name == "kind":
        return "required"
    if key.name in key.model.rules and key.field:
        number, rule = key.field.default, key.model.rules[key.name]
        return f"null, {BY_RULE}: {rule.words.format(number)}"
    return as_yaml(key.default)
