"""The JSON schema of a scenario file, made from the models, for editors."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from podusv_cli.core.component import Component
from podusv_cli.scenario.explain import EXTENDS
from podusv_cli.scenario.keys import SCENARIO
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.presets import preset_names, with_presets

TITLE = "podusv scenario"
DIALECT = "http://json-schema.org/draft-07/schema#"
# Words of newer dialects, of OpenAPI, and what a file that extends another one may leave out.
DROPPED = ("title", "discriminator", "required", "unit", "$defs")


def json_schema(codes: Sequence[str]) -> dict[str, Any]:
    """A draft-07 schema of what may stand in one file; `codes` are what `silence` may name.

    No key is required, since any may come from the file that this one extends, and defaults are
    given where they do not depend on anything else.
    """
    made = Scenario.model_json_schema()
    definitions = {name: _converted(part) for name, part in made["$defs"].items()}
    for name in _filled_from_outside():
        for part in definitions[name]["properties"].values():
            part.pop("default", None)
    for model, presets in with_presets().values():
        allowed = ["", *preset_names(presets)]
        definitions[model.__name__]["properties"]["preset"]["enum"] = allowed
    scenario = _converted(made)
    scenario["properties"]["silence"]["items"]["enum"] = list(codes)
    names = {"type": "array", "items": {"type": "string"}}
    either = [{"type": "string"}, names]
    extends = {"anyOf": either, "description": EXTENDS.meaning}
    plugins = scenario["properties"]["plugins"]
    meaning = plugins.pop("description")
    scenario["properties"]["plugins"] = {"anyOf": [*either, plugins], "description": meaning}
    scenario["properties"] = {"extends": extends} | scenario["properties"]
    return {"$schema": DIALECT, "title": TITLE} | scenario | {"definitions": definitions}


def schema_text(codes: Sequence[str]) -> str:
    """The schema as a file, ending with a newline; `codes` as for `json_schema`."""
    return json.dumps(json_schema(codes), indent=2) + "\n"


def _filled_from_outside() -> set[str]:
    """Classes whose fields take their values from a preset or differ with where they are used."""
    wholes = [key.default for key in SCENARIO.all() if isinstance(key.default, Component)]
    return {"Vessel"} | {type(whole).__name__ for whole in wholes if whole != type(whole)()}


def _converted(schema: dict[str, Any]) -> dict[str, Any]:
    """A schema of pydantic's dialect (2020-12) in draft-07."""
    made = {word: _inside(word, part) for word, part in schema.items() if word not in DROPPED}
    if "description" in made:
        unit = schema.get("unit")
        made["description"] = " ".join(made["description"].split()) + (f" [{unit}]" if unit else "")
    if "const" in made:
        made.pop("default", None)
    if "prefixItems" in made:
        made["items"], made["additionalItems"] = made.pop("prefixItems"), False
    if "oneOf" in made:
        # Without its kind, which the file below may give, a section fits more than one.
        made["anyOf"] = made.pop("oneOf")
    if "$ref" in made and len(made) > 1:
        # Draft-07 ignores whatever stands beside a reference.
        made["allOf"] = [{"$ref": made.pop("$ref")}]
    return made


def _inside(word: str, part: Any) -> Any:
    if word in ("properties", "patternProperties"):
        return {name: _converted(schema) for name, schema in part.items()}
    if word == "$ref":
        return part.replace("#/$defs/", "#/definitions/")
    if isinstance(part, list) and word != "enum":
        return [_converted(schema) if isinstance(schema, dict) else schema for schema in part]
    is_schema = isinstance(part, dict) and word != "default"
    return _converted(part) if is_schema else part
