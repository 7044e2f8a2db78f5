"""The JSON schema: draft-07, and complete."""

from collections.abc import Iterator
from typing import Any

import pytest

from podusv_cli.components.vessels.vessel import VESSELS as SHIPPED
from podusv_cli.findings.finding import finding_kinds
from podusv_cli.scenario.keys import NAME, NUMBER, SCENARIO, sections
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.presets import preset_names
from podusv_cli.scenario.schema import json_schema
from podusv_cli.scenario.yaml_tree import dotted

SCHEMA = json_schema(tuple(finding_kinds()))
KEYS = [key for key in SCENARIO.all() if not key.is_kind]
# Every word of draft-07 that the models need; a new one wants a look at how it is converted.
WORDS = {
    "$schema", "title", "definitions", "description", "default", "type", "properties", "items",
    "additionalItems", "additionalProperties", "minItems", "maxItems", "minimum",
    "exclusiveMinimum", "maximum", "exclusiveMaximum", "pattern", "enum", "const", "anyOf",
    "allOf", "$ref",
}  # fmt: skip


def schemas(schema: Any) -> Iterator[dict[str, Any]]:
    """The schema and all that are in it."""
    if not isinstance(schema, dict):
        return
    yield schema
    for word in ("properties", "definitions"):
        for part in schema.get(word, {}).values():
            yield from schemas(part)
    for word in ("anyOf", "allOf", "items"):
        parts = schema.get(word, [])
        for part in parts if isinstance(parts, list) else [parts]:
            yield from schemas(part)
    yield from schemas(schema.get("additionalProperties"))


def target(schema: dict[str, Any]) -> dict[str, Any]:
    """The schema, or what it refers to."""
    reference = next(
        (part["$ref"] for part in [schema, *schema.get("allOf", [])] if "$ref" in part), ""
    )
    return SCHEMA["definitions"][reference.rpartition("/")[2]] if reference else schema


def places(schema: dict[str, Any], path: tuple[str, ...]) -> list[dict[str, Any]]:
    """Every schema for the key at a path, whatever the kind."""
    found = [target(schema)]
    for step in path:
        inside = [target(part) for one in found for part in one.get("anyOf", [one])]
        if step == NAME:
            found = [
                target(one["additionalProperties"])
                for one in inside
                if "additionalProperties" in one
            ]
            continue
        if step == NUMBER:
            found = [target(one["items"]) for one in inside if "items" in one]
            continue
        found = [one["properties"][step] for one in inside if step in one.get("properties", {})]
    return found


def test_the_schema_uses_the_words_of_draft_07_only():
    assert SCHEMA["$schema"] == "http://json-schema.org/draft-07/schema#"
    assert {word for schema in schemas(SCHEMA) for word in schema} <= WORDS


def test_every_reference_leads_somewhere_and_stands_alone():
    references = [schema for schema in schemas(SCHEMA) if "$ref" in schema]
    assert references
    for schema in references:
        assert list(schema) == ["$ref"], "draft-07 ignores what stands beside a reference"
        assert schema["$ref"].removeprefix("#/definitions/") in SCHEMA["definitions"]


def test_lists_of_fixed_length_are_closed():
    lists = [schema for schema in schemas(SCHEMA) if isinstance(schema.get("items"), list)]
    assert lists
    for schema in lists:
        assert schema["additionalItems"] is False
        assert len(schema["items"]) == schema["minItems"] == schema["maxItems"]


def test_no_key_is_required_and_no_unknown_one_allowed():
    sections_of_keys = [schema for schema in schemas(SCHEMA) if "properties" in schema]
    assert len(sections_of_keys) > 10
    for schema in sections_of_keys:
        assert schema["additionalProperties"] is False
        assert "required" not in schema


def test_a_file_can_extend_another():
    one, several = SCHEMA["properties"]["extends"]["anyOf"]
    assert (one["type"], several["type"], several["items"]["type"]) == ("string", "array", "string")
    assert set(SCHEMA["properties"]) == {"extends", *Scenario.model_fields}


@pytest.mark.parametrize("key", KEYS, ids=lambda key: dotted(key.route))
def test_every_key_of_the_models_is_there_with_its_meaning_and_unit(key):
    found = places(SCHEMA, key.path)
    assert found
    if key.path[-1] != "kind":
        unit = (key.field.json_schema_extra or {}).get("unit")
        shown = f"{key.field.description} [{unit}]" if unit else key.field.description
        assert shown in [schema["description"] for schema in found]


def test_a_kind_is_one_word_and_a_preset_one_of_the_vessels():
    laws = sections(Scenario.model_fields["controller"].annotation)
    assert {schema["const"] for schema in places(SCHEMA, ("controller", "kind"))} == set(laws)
    (preset,) = places(SCHEMA, ("vessel", "preset"))
    assert preset["enum"] == ["", *preset_names(SHIPPED)]


def test_defaults_are_there_but_where_they_depend_on_the_place():
    assert places(SCHEMA, ("simulation", "step"))[0]["default"] == 0.01
    assert "default" not in places(SCHEMA, ("vessel", "X_uu"))[0], "it is the preset's"
    assert "default" not in places(SCHEMA, ("disturbance", "b_u", "sin"))[0], "b_v has another one"
    assert places(SCHEMA, ("disturbance", "b_u"))[0]["default"]["sin"] == 0.1
