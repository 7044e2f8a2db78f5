"""What a scenario's parts set otherwise than by default, or than their preset does."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import Any

from podusv_cli.components.facts import Facts
from podusv_cli.core.about import PROSE, SettingAbout
from podusv_cli.core.component import Component, unit_of
from podusv_cli.core.errors import SizingError
from podusv_cli.core.phrases import value_text
from podusv_cli.scenario.explain import summary
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.presets import preset_names, preset_values
from podusv_cli.scenario.yaml_tree import plain

SECTIONS = (
    "vessel",
    "nominal",
    "start",
    "path",
    "disturbance",
    "actuator",
    "measurement",
    "estimator",
    "simulation",
    "control",
    "metrics",
)
WHICH = ("kind", "preset")  # are listed although they equal the default or preset


def settings(part: Component, facts: Facts | None = None) -> list[SettingAbout]:
    """Every key of a part, compared with its preset where it has one, else with its defaults.

    With the facts of hull and actuator also with defaults that follow from these.
    """
    return list(_settings(part, _preset(part) or _with_defaults(part, facts)))


def changed_settings(scenario: Scenario) -> list[SettingAbout]:
    """What the scenario says itself, controllers apart."""
    facts = scenario.facts
    return [
        setting.model_copy(update={"key": f"{name}.{setting.key}"})
        for name, part in parts(scenario).items()
        for setting in settings(part, facts)
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


def _preset(part: Component) -> Component | None:
    """The part as its preset alone would make it.

    None without a preset, and also for a preset that is a file or a plug-in's: only podusv's own
    names are known here.
    """
    name, presets = getattr(part, "preset", ""), type(part).presets
    if not presets or name not in preset_names(presets):
        return None
    # Faults are thrown away: presets of podusv have none, as tests check.
    node = preset_values(presets, name, [])
    return type(part)(**{**plain(node), "preset": name}) if node else None


def _with_defaults(part: Component, facts: Facts | None) -> Component | None:
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
) -> Iterator[SettingAbout]:
    """Each value of a part and of the parts in it, beside the value of `base` or its default.

    `prefix` is the key of the part with a dot, `unit` that of the field it lies in.
    """
    for name, field in type(part).model_fields.items():
        content = getattr(part, name)
        default = getattr(base, name) if base else field.get_default(call_default_factory=True)
        inner, others = _inside(content), _inside(default)
        for step, one in inner.items():
            yield from _settings(one, others.get(step), f"{prefix}{name}.{step}", unit_of(field))
        if not inner:
            meaning = summary(type(part)) if name == "kind" else field.description or ""
            other = content != default and f".{name}" not in PROSE
            yield SettingAbout(
                key=f"{prefix}{name}",
                value=value_text(content),
                unit=unit_of(field, unit),
                default=value_text(None if field.is_required() and not base else default),
                meaning=meaning,
                changed=other or (name in WHICH and bool(content)),
            )


def _inside(content: Any) -> dict[str, Component]:
    """The parts that a value consists of, by what leads to them: "" for itself, "0." in a list."""
    if isinstance(content, Component):
        return {"": content}
    several = content if isinstance(content, tuple) else ()
    return {f"{i}.": item for i, item in enumerate(several) if isinstance(item, Component)}
