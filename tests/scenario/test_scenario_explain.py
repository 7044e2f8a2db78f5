"""Explanations: of every key, generated from the models."""

import re
from collections.abc import Iterator
from typing import Any

import pytest
from annotated_types import Ge, Gt, Le, Lt
from command_samples import commanded
from conftest import kinds as components
from known_signals import ABOUT
from pydantic import Discriminator
from pydantic.types import Strict

from podusv_cli.components.measurements.sensors import Sensor, Sensors
from podusv_cli.components.vessels.vessel import VESSELS as SHIPPED
from podusv_cli.core.about import Claim
from podusv_cli.core.component import Component
from podusv_cli.findings.finding import finding_kinds
from podusv_cli.scenario.explain import ExplainRow, UnknownKeyError, explain, kinds
from podusv_cli.scenario.keys import (
    BOUNDS,
    NAME,
    NUMBER,
    PATTERNS_IN_WORDS,
    SCENARIO,
    limits,
    members,
    sections,
)
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.presets import preset_names
from podusv_cli.scenario.schema import json_schema
from podusv_cli.scenario.settings import settings
from podusv_cli.scenario.yaml_tree import dotted_key


def models(model: type[Component] = Scenario) -> Iterator[type[Component]]:
    """Every class that a scenario is made of, found without the code under test."""
    yield model
    for field in model.model_fields.values():
        for part in _classes(field.annotation):
            yield from models(part)


def _classes(annotation: object) -> Iterator[type[Component]]:
    if isinstance(annotation, type) and issubclass(annotation, Component):
        yield annotation
    for inner in getattr(annotation, "__args__", ()):
        yield from _classes(inner)


MODELS = list(dict.fromkeys(models()))
SECTIONS = {
    name: sections(field.annotation)
    for name, field in Scenario.model_fields.items()
    if sections(field.annotation)
}
KEYS = [
    (f"{section}.{kind}.{name}" if kind else f"{section}.{name}", f"{section}.{name}")
    for section, parts in SECTIONS.items()
    for kind, part in parts.items()
    for name in part.model_fields
]


def test_the_models_are_all_found():
    assert len(MODELS) > 20
    assert {"Network", "Harmonic", "Claim", "Pid"} <= {model.__name__ for model in MODELS}


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.__name__)
def test_every_field_has_a_meaning_a_unit_and_limits_that_can_be_put_in_words(model):
    for name, field in model.model_fields.items():
        assert name == "kind" or (field.description or "").strip(), name
        assert not (field.description or "").endswith("."), f"{name}: meanings are phrases"
        if {int, float} & set(members(field.annotation)):
            assert isinstance(field.json_schema_extra["unit"], str), name
        for data in field.metadata:
            known = isinstance(data, (Gt, Ge, Lt, Le, Strict, Discriminator))
            assert known or hasattr(data, "pattern"), f"{data} is in no message or explanation"
        said = limits(field)
        assert set(said) <= {*BOUNDS, "pattern"}
        assert said.get("pattern") in {None, *PATTERNS_IN_WORDS}


@pytest.mark.parametrize("section", SECTIONS)
def test_every_key_is_explained_by_its_path_and_by_its_route(section):
    for route, path in (key for key in KEYS if key[0].startswith(f"{section}.")):
        for row in (explain(route)[0], *(row for row in explain(path) if row.key == path)):
            assert row.key == path
            assert row.meaning
            assert row.type
            assert row.default or row.type in ("keys", "kinds")
        last = path.rpartition(".")[2]
        # A name that is a section, too, means the section.
        assert any(row.key in (path, last) for row in explain(last)), path


def test_without_a_key_the_sections_are_explained():
    assert [row.key for row in explain()] == ["extends", *Scenario.model_fields]
    law = next(row for row in explain() if row.key == "controller")
    assert (law.type, law.choices) == ("kinds", tuple(components("controllers")))


def test_a_section_with_kinds_is_explained_kind_by_kind():
    head, *rest = explain("controller")
    assert head.key == "controller"
    assert [row.key for row in rest] == [f"controller.{kind}" for kind in head.choices]
    laws = components("controllers").values()
    assert [row.choices for row in rest] == [tuple(law.model_fields) for law in laws]
    assert all(row.meaning for row in rest)


def test_a_kind_is_explained_key_by_key():
    head, *rest = explain("path.circle")
    assert head.meaning == "About (x, y), from `angle` on, to starboard where `turn` is starboard."
    assert [row.key for row in rest] == [
        "path.kind",
        "path.x",
        "path.y",
        "path.radius",
        "path.speed",
        "path.angle",
        "path.turn",
    ]


@pytest.mark.parametrize("asked", ["actuator.pod", "actuator.pods", "actuator.pod.pods", "pods"])
def test_keys_of_a_lists_items_are_explained_with_the_list(asked):
    rows = {row.key: row for row in explain(asked)}
    pod = sections(Scenario.model_fields["actuator"].annotation)["pod"].model_fields["pods"]
    (one,) = _classes(pod.annotation)
    found = [key.removeprefix("actuator.pods.NUMBER.") for key in rows if "NUMBER" in key]
    assert found == list(one.model_fields)
    row = rows["actuator.pods.NUMBER.angle_rate"]
    assert (row.unit, row.range, row.default) == ("rad/s", "> 0", "null")
    assert row.meaning == one.model_fields["angle_rate"].description


@pytest.mark.parametrize("place", ["claims.NAME", "claims.C1"])
def test_an_entry_of_a_mapping_is_explained_with_its_keys(place):
    head, *rest = explain(place)
    assert (head.key, head.meaning) == (place, "one of `claims`")
    assert [row.key for row in rest] == [f"{place}.{name}" for name in Claim.model_fields]


def test_a_key_of_an_item_is_found_by_the_place_that_messages_name():
    assert explain("actuator.pods[0].x") == explain("actuator.pods.NUMBER.x")
    assert explain("controllers.slow.K_Pu")[0].kinds == ("pid",)


def test_a_kind_is_explained_by_its_name_alone():
    assert explain("pid") == explain("controller.pid")
    heads = [row.key for row in explain("none") if row.type == "keys"]
    assert heads == ["disturbance.none", "estimator.none"]


def test_a_key_says_everything_that_its_field_says():
    assert explain("controller.pid.T_d") == [
        ExplainRow(
            "controller.T_d",
            "time constant of the derivative's lag",
            "a number",
            unit="s",
            range="> 0",
            default="0.1",
            others=("ms", "us", "ns", "min", "h"),
            kinds=("pid",),
        )
    ]
    (fold,) = explain("controller.fold")
    assert fold.choices == ("printed", "joint", "none")
    assert fold.type == "printed, joint or none"
    assert fold.default == "joint"
    (fraction,) = explain("metrics.steady_fraction")
    assert fraction.range == "> 0, <= 1"
    (kind,) = explain("controller.kind")
    assert (kind.default, kind.choices) == ("required", tuple(components("controllers")))
    assert fold.kinds == ("adaptive_neural", "dsc", "full_backstepping", "pid")


def test_kinds_in_which_a_key_is_the_same_share_a_row():
    rows = explain("path.speed")
    assert [row.kinds for row in rows] == [
        ("circle", "line"),
        ("legs", "legs_hold"),
        ("line_circle",),
        ("sinusoid",),
        ("waypoints",),
    ]


def test_a_default_is_what_the_section_has_when_it_is_left_out():
    assert [row.default for row in explain("disturbance.b_u.sin")] == ["0.1"]
    assert [row.default for row in explain("disturbance.b_v.sin")] == ["0.2"]
    assert [row.default for row in explain("vessel.X_uu")] == ["the preset's"]
    assert [row.default for row in explain("nominal.X_uu")] == ["the vessel's"]


def test_every_signal_is_explained():
    for name, signal in ABOUT.items():
        assert ExplainRow(name, signal.meaning, "signal", signal.unit) in explain(name)


@pytest.mark.parametrize(
    ("key", "hint"),
    [
        ("contoller", "; did you mean 'controller'?"),
        ("controller.pidd", "; did you mean 'controller.pid'?"),
        ("controller.k_z", "; did you mean 'controller.k_ze'?"),
        ("Kiu", "; did you mean 'K_Iu'?"),
        ("Z_E", "; did you mean 'z_e'?"),
        ("Oter", "; did you mean 'otter'?"),
        ("near_target", "; did you mean 'near-target'?"),
        ("qqq", ""),
        ("", ""),
    ],
)
def test_an_unknown_key_is_told_with_what_was_probably_meant(key, hint):
    with pytest.raises(UnknownKeyError) as raised:
        explain(key, ["near-target"])
    assert str(raised.value) == f"{key}: no such name{hint}"
    assert raised.value.exit_code == 2


def test_every_kind_has_a_summary():
    sections = {"path", "disturbance", "actuator", "measurement", "estimator", "controller"}
    assert set(kinds()) == sections
    for summaries in kinds().values():
        assert all(len(summary) > 8 and summary.endswith(".") for summary in summaries.values())


def test_equation_numbers_are_said_to_be_the_papers(monkeypatch, capsys):
    podusv = commanded(monkeypatch, capsys)
    note = "(n) is equation n of the paper"
    assert note in podusv("explain", "controller.k_ze").out
    assert note not in podusv("explain", "simulation.step").out


def test_the_unit_of_a_sensor_s_errors_is_that_of_what_it_measures():
    for sensor, unit in (("position", "m"), ("heading", "rad"), ("velocity", "m/s")):
        (row,) = explain(f"measurement.{sensor}.noise")
        assert row.unit == unit
    told = {one.key: one.unit for one in settings(Sensors(position=Sensor(noise=0.5)))}
    assert told["position.noise"] == "m"
    assert told["yaw_rate.bias"] == "rad/s"


# --- the JSON schema

SCHEMA = json_schema(tuple(finding_kinds()))
# Every word of draft-07 that the models need; a new one wants a look at how it is converted.
WORDS = {
    "$schema",
    "title",
    "definitions",
    "description",
    "default",
    "type",
    "properties",
    "items",
    "additionalItems",
    "additionalProperties",
    "minItems",
    "maxItems",
    "minimum",
    "exclusiveMinimum",
    "maximum",
    "exclusiveMaximum",
    "pattern",
    "enum",
    "const",
    "anyOf",
    "allOf",
    "$ref",
    "required",
}


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


def test_a_list_of_disturbances_is_not_empty_and_has_whole_parts():
    """A section may lack what the file below gives; an entry of a list has no file below."""
    (several,) = (s for s in SCHEMA["properties"]["disturbance"]["anyOf"] if "items" in s)
    assert several["minItems"] == 1
    needed = {
        target(one)["properties"]["kind"]["const"]: set(one["required"])
        for one in several["items"]["anyOf"]
    }
    assert needed["waves"] == {"kind", "height", "period"}
    assert needed["none"] == {"kind"}
    assert "required" not in SCHEMA["definitions"]["Waves"]


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


def test_every_key_of_the_models_is_there_with_its_meaning_and_unit():
    for key in (key for key in SCENARIO.all() if not key.is_kind):
        found = places(SCHEMA, key.path)
        assert found, dotted_key(key.route)
        if key.path[-1] != "kind":
            unit = (key.field.json_schema_extra or {}).get("unit")
            shown = f"{key.field.description} [{unit}]" if unit else key.field.description
            assert shown in [schema["description"] for schema in found]


def test_a_kind_is_one_word_and_a_preset_one_of_the_vessels():
    laws = sections(Scenario.model_fields["controller"].annotation)
    words = [one.get("enum", [one.get("const")]) for one in places(SCHEMA, ("controller", "kind"))]
    assert {names[0] for names in words} == set(laws)
    assert [names for names in words if len(names) > 1] == [["full_backstepping", "backstepping"]]
    (preset,) = places(SCHEMA, ("vessel", "preset"))
    named, file = preset["anyOf"]
    assert named["enum"] == ["", *preset_names(SHIPPED)]
    assert re.search(file["pattern"], "found/identified.yaml")
    assert not re.search(file["pattern"], "posterior.csv")


def test_defaults_are_there_but_where_they_depend_on_the_place():
    assert places(SCHEMA, ("simulation", "step"))[0]["default"] == 0.01
    assert "default" not in places(SCHEMA, ("vessel", "X_uu"))[0], "it is the preset's"
    assert "default" not in places(SCHEMA, ("disturbance", "b_u", "sin"))[0], "b_v has another one"
    assert places(SCHEMA, ("disturbance", "b_u"))[0]["default"]["sin"] == 0.1
