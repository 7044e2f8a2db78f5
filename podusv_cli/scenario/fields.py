"""What the models say about every key: limits, units, defaults, read from the fields."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from podusv_cli.core.component import Component, unit_of
from podusv_cli.scenario.annotations import inside, noun, sections

NAME, NUMBER = "NAME", "NUMBER"
MISSING = PydanticUndefined  # the default of a field that has none
BOUNDS = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}
BOUNDS_IN_WORDS = {"gt": "above", "ge": "not below", "lt": "below", "le": "not above"}
PATTERNS_IN_WORDS = {
    r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,79}$": (
        "of letters, digits, '_', '.' and '-', starting with a letter or digit, at most 80 long"
    ),
}


def limits(field: FieldInfo) -> dict[str, Any]:
    """The field's limits by pydantic's names: gt, ge, lt, le, pattern."""
    names = (*BOUNDS, "pattern")
    found = ((name, getattr(data, name, None)) for data in field.metadata for name in names)
    return {name: limit for name, limit in found if limit is not None}


def range_of(field: FieldInfo) -> str:
    """The range in symbols: `> 0, <= 1`."""
    return ", ".join(f"{BOUNDS[name]} {limit:g}" for name, limit in _bounds(field))


def _bounds(field: FieldInfo) -> list[tuple[str, float]]:
    found = limits(field)
    return [(name, found[name]) for name in BOUNDS if name in found]


def type_of(field: FieldInfo) -> str:
    """What a field's value is, in words: `a list of 3 numbers`."""
    form = PATTERNS_IN_WORDS.get(limits(field).get("pattern", ""), "")
    return f"{noun(field.annotation)} {form}".rstrip()


def wanted(field: FieldInfo) -> str:
    """What a field takes, in words with range and unit: `a number above 0 [s]`."""
    ranges = [f"{BOUNDS_IN_WORDS[name]} {limit:g}" for name, limit in _bounds(field)]
    unit = f"[{unit_of(field)}]" if unit_of(field) and not sections(field.annotation) else ""
    return " ".join(part for part in (type_of(field), " and ".join(ranges), unit) if part)


@dataclass(frozen=True)
class Key:
    """A key of a scenario: `path` as in files, `route` with the kinds of sections in between.

    `kind` is the innermost kind on the way, "" where there is none. In a mapping of names to
    sections all alike, NAME stands for the names; in a list of them, NUMBER for their places.
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
    for kind, part in sections(key.field.annotation).items():
        route = (*key.route, kind) if kind else key.route
        for name, field in part.model_fields.items():
            # A section that is left out is its default, whatever its own class would start with.
            default = getattr(key.default, name) if isinstance(key.default, part) else field.default
            inner = Key((*key.path, name), (*route, name), kind or key.kind, field, default)
            yield from _branch(inner)
    for sign, step in ((NAME, NAME), (NUMBER, 0)):
        alike = sections(inside(key.field.annotation, step)).get("")
        for name, field in alike.model_fields.items() if alike else ():
            path, route = (*key.path, sign, name), (*key.route, sign, name)
            yield from _branch(Key(path, route, key.kind, field, field.default))
