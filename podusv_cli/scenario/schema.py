"""The JSON schema of a scenario file, made from the models, for editors."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import OF_SECTION, Component, unit_of
from podusv_cli.core.plugins import Plugins
from podusv_cli.core.units import NUMBER, pattern
from podusv_cli.scenario.explain import EXTENDS
from podusv_cli.scenario.keys import Key, keys_of
from podusv_cli.scenario.model import scenario_class
from podusv_cli.scenario.named_files import YAML
from podusv_cli.scenario.presets import preset_names, with_presets

TITLE = "podusv scenario"
DIALECT = "http://json-schema.org/draft-07/schema#"
# Words of newer dialects, of OpenAPI, and what a file that extends another one may leave out.
DROPPED = ("title", "discriminator", "required", "unit", "$defs")


def json_schema(codes: Sequence[str], plugins: Plugins = ()) -> dict[str, Any]:
    """A draft-07 schema of what may stand in one file; `codes` are what `silence` may name.

    Kinds and presets of these plug-ins are among podusv's own.

    No key is required but in a list of disturbances, since any may come from the file that this one
    extends, and defaults are given where they do not depend on anything else.
    """
    top = keys_of(scenario_class(plugins))
    made = top.scenario.model_json_schema()
    definitions = {name: _convert_schema(part) for name, part in made["$defs"].items()}
    # What the models have as default is not what a file gets that leaves the key out.
    for model in _filled_from_outside(top):
        for part in definitions[_name(model, definitions)]["properties"].values():
            part.pop("default", None)
    for key in top.all():
        if key.field and key.name in key.model.rules:
            definitions[_name(key.model, definitions)]["properties"][key.name]["default"] = None
    # A preset is a known name or a YAML file.
    for model, presets in with_presets(top).values():
        properties = definitions[_name(model, definitions)]["properties"]
        named = {"enum": ["", *preset_names(presets, plugins)]}
        file = {"pattern": rf"({'|'.join(map(re.escape, YAML))})$"}
        properties["preset"]["anyOf"] = [named, file]
    scenario = _convert_schema(made)
    scenario["properties"]["silence"]["items"]["enum"] = list(codes)
    for part in scenario["properties"]["disturbance"]["anyOf"]:
        if part.get("type") == "array":
            part |= {"minItems": 1, "items": _whole(part["items"], made["$defs"])}
    names = {"type": "array", "items": {"type": "string"}}
    either = [{"type": "string"}, names]
    extends = {"anyOf": either, "description": EXTENDS.meaning}
    named = scenario["properties"]["plugins"]
    meaning = named.pop("description")
    scenario["properties"]["plugins"] = {"anyOf": [*either, named], "description": meaning}
    scenario["properties"] = {"extends": extends} | scenario["properties"]
    units = dict.fromkeys(unit_of(key.field) for key in top.all() if key.field)
    definitions |= {_in(unit): _number_in(unit) for unit in units}
    return {"$schema": DIALECT, "title": TITLE} | scenario | {"definitions": definitions}


@cache  # it is made of all models
def schema_text(codes: tuple[str, ...], plugins: Plugins = ()) -> str:
    """The schema as a file, ending with a newline; arguments as for `json_schema`."""
    return json.dumps(json_schema(codes, plugins), indent=2) + "\n"


def _whole(items: dict[str, Any], definitions: Mapping[str, Any]) -> dict[str, Any]:
    """Items of a list with all keys that they need, as no other file can complete an item.

    `items` is their schema (`anyOf` with references), `definitions` are the schemas referred to.
    """
    choices = []
    for choice in items["anyOf"]:
        needed = definitions[choice["$ref"].rpartition("/")[2]].get("required", [])
        choices.append({"allOf": [choice], "required": ["kind", *needed]})
    return {"anyOf": choices}


def _name(model: type[Component], definitions: Mapping[str, Any]) -> str:
    """What pydantic calls a class: in full where a plug-in has one of the same name."""
    whole = f"{model.__module__}.{model.__qualname__}".replace(".", "__")
    return whole if whole in definitions else model.__name__


def _filled_from_outside(top: Key) -> set[type[Component]]:
    """Classes whose fields take their values from a preset or differ with where they are used."""
    wholes = [key.default for key in top.all() if isinstance(key.default, Component)]
    return {Vessel} | {type(whole) for whole in wholes if whole != type(whole)()}


def _convert_schema(schema: dict[str, Any]) -> dict[str, Any]:
    """A schema of pydantic's dialect (2020-12) in draft-07, with units in the descriptions."""
    made = {word: _inside(word, part) for word, part in schema.items() if word not in DROPPED}
    if "description" in made:
        unit = schema.get("unit")
        made["description"] = " ".join(made["description"].split()) + (f" [{unit}]" if unit else "")
    if "const" in made:
        made.pop("default", None)
    if "unit" in schema:
        made = _or_with_unit(made, schema["unit"])
    if "prefixItems" in made:
        made["items"], made["additionalItems"] = made.pop("prefixItems"), False
    if "oneOf" in made:
        # Without its kind, which the file below may give, a section fits more than one.
        made["anyOf"] = made.pop("oneOf")
    if "anyOf" in made:
        made["anyOf"] = [choice for part in made["anyOf"] for choice in _choices(part)]
    if "$ref" in made and len(made) > 1:
        # Draft-07 ignores whatever stands beside a reference.
        made["allOf"] = [{"$ref": made.pop("$ref")}]
    return made


def _in(unit: str) -> str:
    """The name of the definition of a number with a unit."""
    return "number_in_" + re.sub(r"\W+", "_", unit.replace("/", " per ") or "per cent")


def _number_in(unit: str) -> dict[str, Any]:
    """A number with a unit that may stand in place of one in podusv's `unit`."""
    of_another = unit == OF_SECTION  # which fields of several sections have
    fits = rf"^\s*{NUMBER.pattern}\s*\D" if of_another else pattern(unit.replace(", ", " or "))
    return {"type": "string", "pattern": fits}


def _or_with_unit(schema: dict[str, Any], unit: str) -> dict[str, Any]:
    """The schema whose numbers may also be written with a unit of the quantity `unit`.

    Items, entries and alternatives are rewritten, too; `schema` itself stays as it is.
    """
    made = dict(schema)
    if made.get("type") == "number":
        # An editor looks for these beside `anyOf`, not within it.
        outside = {word: made.pop(word) for word in ("default", "description") if word in made}
        return outside | {"anyOf": [made, {"$ref": f"#/definitions/{_in(unit)}"}]}
    for word in ("items", "anyOf"):
        if isinstance(made.get(word), list):
            parts = [_or_with_unit(part, unit) for part in made[word]]
            made[word] = parts if word == "items" else [c for part in parts for c in _choices(part)]
    for word in ("items", "additionalProperties"):
        if isinstance(made.get(word), dict):
            made[word] = _or_with_unit(made[word], unit)
    return made


def _choices(part: dict[str, Any]) -> list[dict[str, Any]]:
    """What a choice consists of, where it is only a choice again; else itself."""
    return part["anyOf"] if list(part) == ["anyOf"] else [part]


def _inside(word: str, part: Any) -> Any:
    """The content `part` of a schema's keyword `word`, rewritten from pydantic's dialect."""
    if word in ("properties", "patternProperties"):
        return {name: _convert_schema(schema) for name, schema in part.items()}
    if word == "$ref":
        return part.replace("#/$defs/", "#/definitions/")
    if isinstance(part, list) and word != "enum":
        return [_convert_schema(schema) if isinstance(schema, dict) else schema for schema in part]
    # Defaults and enums are data, which may look like schemas.
    is_schema = isinstance(part, dict) and word != "default"
    return _convert_schema(part) if is_schema else part
