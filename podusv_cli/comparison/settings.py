"""What a scenario's parts set otherwise than by default, or than their preset does."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any, NamedTuple

from podusv_cli.comparison.differences import PROSE
from podusv_cli.components.facts import Facts
from podusv_cli.core.component import Component, unit_of
from podusv_cli.core.errors import SizingError
from podusv_cli.pages.page import value_text
from podusv_cli.scenario.explain import summary
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.presets import preset_file, preset_names
from podusv_cli.scenario.yaml_tree import plain

SECTIONS = (
    "vessel", "nominal", "start", "path", "disturbance", "actuator", "measurement", "estimator",
    "simulation", "control", "metrics",
)  # fmt: skip
WHICH = ("kind", "preset")  # are told although they equal the default or preset


class Setting(NamedTuple):
    """A key with its value and what this would be without it, as they are shown."""

    key: str
    value: str
    unit: str
    default: str
    meaning: str
    changed: bool


def settings(part: Component, facts: Facts | None = None) -> list[Setting]:
    """Every key of a part, compared with its preset where it has one, else with its defaults.

    With the facts of hull and actuator also with defaults that follow from these.
    """
    return list(_settings(part, _preset(part) or _sized(part, facts)))


def changed(scenario: Scenario) -> list[Setting]:
    """What the scenario says itself, controllers apart."""
    return [
        setting._replace(key=f"{name}.{setting.key}")
        for name, part in parts(scenario).items()
        for setting in settings(part, _facts(scenario))
        if setting.changed
    ]


def parts(scenario: Scenario) -> dict[str, Component]:
    """The sections that a run depends on, controllers apart; `nominal` if it is not the vessel."""
    sections = {
        f"{name}{step and f'.{step[:-1]}'}": part
        for name in SECTIONS
        for step, part in _inside(getattr(scenario, name)).items()
    }
    if scenario.nominal == scenario.vessel:
        del sections["nominal"]
    return sections


def laws(
    controllers: Mapping[str, Component], scenario: Scenario | None = None
) -> list[tuple[Setting, list[Setting | None]]]:
    """Every key that a law sets otherwise than by default: what it is, and what each law has."""
    facts = _facts(scenario) if scenario else None
    tables = [{one.key: one for one in settings(law, facts)} for law in controllers.values()]
    about = {key: one for table in reversed(tables) for key, one in table.items()}
    keys = dict.fromkeys(one.key for table in tables for one in table.values() if one.changed)
    ordered = sorted(keys, key=lambda key: key != "kind")
    return [(about[key], [table.get(key) for table in tables]) for key in ordered]


def _preset(part: Component) -> Component | None:
    """The part as its preset alone would make it; None without a preset."""
    name, presets = getattr(part, "preset", ""), type(part).presets
    if not presets or name not in preset_names(presets):
        return None
    node = preset_file(presets, name, [])
    return type(part)(**{**plain(node), "preset": name}) if node else None


def _facts(scenario: Scenario) -> Facts | None:
    return None if scenario.recorded else scenario.facts


def _sized(part: Component, facts: Facts | None) -> Component | None:
    """The part with every default, those that follow from the facts too; None without any.

    It is read only, and not checked: legs have no points by default.
    """
    if facts is None or not part.rules:
        return None
    own = {name: field for name, field in type(part).model_fields.items() if field.is_required()}
    values = {name: getattr(part, name) for name in own}
    with suppress(SizingError):  # the scenario has numbers where nothing follows
        values |= {name: part.by_default(name, facts) for name in part.rules}
    return type(part).model_construct(None, **values)


def _settings(
    part: Component, base: Component | None, prefix: str = "", unit: str = ""
) -> Iterator[Setting]:
    for name, field in type(part).model_fields.items():
        content = getattr(part, name)
        default = getattr(base, name) if base else field.get_default(call_default_factory=True)
        inner, others = _inside(content), _inside(default)
        for step, one in inner.items():
            yield from _settings(one, others.get(step), f"{prefix}{name}.{step}", unit_of(field))
        if not inner:
            meaning = summary(type(part)) if name == "kind" else field.description or ""
            other = content != default and f".{name}" not in PROSE
            yield Setting(
                f"{prefix}{name}", value_text(content), unit_of(field, unit),
                value_text(None if field.is_required() and not base else default), meaning,
                other or (name in WHICH and bool(content)),
            )  # fmt: skip


def _inside(content: Any) -> dict[str, Component]:
    """The parts that a value consists of, by what leads to them."""
    if isinstance(content, Component):
        return {"": content}
    several = content if isinstance(content, tuple) else ()
    return {f"{i}.": one for i, one in enumerate(several) if isinstance(one, Component)}
