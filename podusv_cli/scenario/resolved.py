"""Scenarios as YAML text: resolved.yaml, and plain data that reads back to the same values."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import yaml

from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.yaml_text import resolve

HEADING = "# A complete scenario, every value written out; it runs again to the same log.\n"


def plain_data(scenario: Scenario) -> dict[str, Any]:
    """The scenario as plain data, without the sections that it does not have."""
    return {key: content for key, content in scenario.model_dump().items() if content is not None}


def resolved_yaml(scenario: Scenario) -> str:
    """The scenario as a file with every value in it; loading it gives an equal scenario."""
    return HEADING + yaml_text(plain_data(scenario))


def yaml_text(data: Mapping[str, Any]) -> str:
    """Plain data as YAML that podusv reads back to the same values."""
    with suppress(UnicodeEncodeError):  # libyaml has no lone surrogates
        return _dump_yaml(data, _Fast)
    return _dump_yaml(data, _Dumper)


def _dump_yaml(data: Mapping[str, Any], dumper: Any) -> str:
    # Never folded: a long text in one line reads back as it is.
    text = yaml.dump(data, Dumper=dumper, sort_keys=False, allow_unicode=True, width=1 << 30)
    return str(text)


class _Dumper(yaml.SafeDumper):
    """Blocks for mappings, brackets for lists of scalars, quotes around all text but words."""

    # What stands twice is written twice, since podusv reads no aliases.
    def ignore_aliases(self, data: Any) -> bool:
        return True


class _Fast(getattr(yaml, "CSafeDumper", yaml.SafeDumper)):  # type: ignore[misc]
    """The same text by libyaml, which PyYAML can lack."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    """A word plain, any other text in double quotes, so that it is read back as text."""
    is_word = text.replace("_", "").isalnum() and isinstance(resolve(text), str) and text.isascii()
    style = None if is_word else '"'
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


def _list(dumper: yaml.SafeDumper, items: tuple[Any, ...]) -> yaml.SequenceNode:
    """A list in one line, unless it holds lists."""
    flat = not any(isinstance(part, tuple) for part in items)
    return dumper.represent_sequence("tag:yaml.org,2002:seq", items, flow_style=flat)


def _kind_first(dumper: yaml.SafeDumper, data: dict[str, Any]) -> yaml.MappingNode:
    """A mapping with `kind` on top; the other keys keep their order."""
    ordered = sorted(data.items(), key=lambda entry: entry[0] != "kind")
    return dumper.represent_mapping("tag:yaml.org,2002:map", ordered, flow_style=False)


for _dumper in (_Dumper, _Fast):
    _dumper.add_representer(str, _text)
    _dumper.add_representer(tuple, _list)
    _dumper.add_representer(dict, _kind_first)
