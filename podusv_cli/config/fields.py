"""What the models say about every key: kinds, limits, choices and units, read from the fields."""

from __future__ import annotations

import types
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal, Union, get_args, get_origin

from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from podusv_cli.registry import Component, unit_of

MISSING = PydanticUndefined  # the default of a field that has none
BOUNDS = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}
BOUNDS_IN_WORDS = {"gt": "above", "ge": "not below", "lt": "below", "le": "not above"}
PATTERNS_IN_WORDS = {
    r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,79}$": (
        "of letters, digits, '_', '.' and '-', starting with a letter or digit, at most 80 long"
    ),
}
NOUNS: dict[Any, tuple[str, str]] = {
    float: ("a number", "numbers"),
    int: ("a whole number", "whole numbers"),
    bool: ("true or false", "true or false"),
    str: ("text", "texts"),
    type(None): ("null", "null"),
}


def members(annotation: Any) -> tuple[Any, ...]:
    """The members of a union; the annotation itself where it is none."""
    is_union = get_origin(annotation) in (Union, types.UnionType)
    return get_args(annotation) if is_union else (annotation,)


def is_component(annotation: Any) -> bool:
    """Whether the annotation is a component's class."""
    return isinstance(annotation, type) and issubclass(annotation, Component)


def sections(field: FieldInfo) -> dict[str, type[Component]]:
    """The component classes that a field takes, by kind; "" where there is only one without kind."""
    classes = [member for member in members(field.annotation) if is_component(member)]
    return {kind_of(model): model for model in classes}


def kind_of(model: type[Component]) -> str:
    """The kind that a component's class stands for, "" where it has none."""
    return str(model.model_fields["kind"].default) if "kind" in model.model_fields else ""


def choices(annotation: Any) -> tuple[str, ...]:
    """The words that a value may be."""
    literals = [member for member in members(annotation) if get_origin(member) is Literal]
    return tuple(str(word) for literal in literals for word in get_args(literal))


def item(annotation: Any, index: int) -> Any:
    """The type of the item at an index of a list type."""
    for member in members(annotation):
        parts = get_args(member) if get_origin(member) is tuple else ()
        if len(parts) == 2 and parts[1] is Ellipsis:
            return parts[0]
        if index < len(parts):
            return parts[index]
    return annotation


def limits(field: FieldInfo) -> dict[str, Any]:
    """The field's limits by pydantic's names: gt, ge, lt, le, pattern."""
    names = (*BOUNDS, "pattern")
    found = ((name, getattr(data, name, None)) for data in field.metadata for name in names)
    return {name: limit for name, limit in found if limit is not None}


def range_of(field: FieldInfo) -> str:
    """The range in symbols: `> 0, <= 1`."""
    set_limits = limits(field)
    return ", ".join(
        f"{sign} {set_limits[name]:g}" for name, sign in BOUNDS.items() if name in set_limits
    )


def joined(words: tuple[str, ...] | list[str]) -> str:
    """`a, b or c`."""
    return " or ".join(part for part in (", ".join(words[:-1]), words[-1]) if part)


def noun(annotation: Any, *, plural: bool = False) -> str:
    """`a list of 3 numbers` for a type."""
    if annotation in NOUNS:
        return NOUNS[annotation][plural]
    if get_origin(annotation) is Literal:
        return joined([str(word) for word in get_args(annotation)])
    if get_origin(annotation) is tuple:
        parts = get_args(annotation)
        count = "" if parts[-1] is Ellipsis else f"{len(parts)} "
        return f"{'lists' if plural else 'a list'} of {count}{noun(parts[0], plural=True)}"
    if is_component(annotation):
        names = list(annotation.model_fields)
        return "a mapping of keys: " + ", ".join(names[:6] + ["..."] * (len(names) > 6))
    return joined([noun(member) for member in members(annotation)])


def wanted(field: FieldInfo) -> str:
    """What a field takes, in words with range and unit: `a number above 0 [s]`."""
    kinds = sections(field)
    if "" not in kinds and kinds:
        return f"a mapping of keys with kind {joined(list(kinds))}"
    bounds = limits(field)
    ranges = [f"{BOUNDS_IN_WORDS[name]} {bounds[name]:g}" for name in BOUNDS if name in bounds]
    unit = f"[{unit_of(field)}]" if unit_of(field) and not kinds else ""
    return " ".join(
        part for part in (noun(field.annotation), form, " and ".join(ranges), unit) if part
    )


@dataclass(frozen=True)
class Key:
    """A key of a scenario: `path` as in files, `route` with the kinds of sections in between.

    `kind` is the innermost kind on the way, "" where there is none.
    """

    path: tuple[str, ...]
    route: tuple[str, ...]
    kind: str
    field: FieldInfo
    default: Any


def keys(model: type[Component]) -> Iterator[Key]:
    """Every key of a model, sections before what is in them, kind after kind."""
    for name, field in model.model_fields.items():
        yield from _branch(Key((name,), (name,), "", field, field.default))


def _branch(key: Key) -> Iterator[Key]:
    yield key
    for kind, part in sections(key.field).items():
        route = (*key.route, kind) if kind else key.route
        for name, field in part.model_fields.items():
            # A section that is left out is its default, whatever its own class would start with.
            default = getattr(key.default, name) if isinstance(key.default, part) else field.default
            inner = Key((*key.path, name), (*route, name), kind or key.kind, field, default)
            yield from _branch(inner)
