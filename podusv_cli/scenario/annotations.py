"""Types of fields, taken apart and put in words."""

from __future__ import annotations

import types
from typing import Annotated, Any, Literal, TypeGuard, Union, get_args, get_origin

from podusv_cli.core.component import Component

NOUNS: dict[Any, tuple[str, str]] = {
    float: ("a number", "numbers"),
    int: ("a whole number", "whole numbers"),
    bool: ("true or false", "true or false"),
    str: ("text", "texts"),
    type(None): ("null", "null"),
}
SHOWN_KEYS = 6


def members(annotation: Any) -> tuple[Any, ...]:
    """The members of a union; of any other type, itself."""
    if get_origin(annotation) is Annotated:
        return members(get_args(annotation)[0])
    if get_origin(annotation) in (Union, types.UnionType):
        return tuple(member for part in get_args(annotation) for member in members(part))
    return (annotation,)


def is_component(annotation: Any) -> TypeGuard[type[Component]]:
    """Whether the type is a component's class."""
    return isinstance(annotation, type) and issubclass(annotation, Component)


def sections(annotation: Any) -> dict[str, type[Component]]:
    """The component classes that a value may be of, by kind; "" is a class without kinds."""
    return {kind_of(member): member for member in members(annotation) if is_component(member)}


def kind_of(model: type[Component]) -> str:
    """The kind that a component's class stands for, "" where it has none."""
    return str(model.model_fields["kind"].default) if "kind" in model.model_fields else ""


def inside(annotation: Any, step: int | str) -> Any:
    """The type of a list's item or a mapping's value; None where there is nothing inside."""
    for member in members(annotation):
        parts = get_args(member)
        if get_origin(member) is tuple and isinstance(step, int):
            endless = parts[-1] is Ellipsis
            return parts[0] if endless else parts[step] if step < len(parts) else None
        if get_origin(member) is dict and isinstance(step, str) and step != "[key]":
            return parts[1]
    return None


def choices(annotation: Any) -> tuple[str, ...]:
    """The words that a value may be."""
    literals = [member for member in members(annotation) if get_origin(member) is Literal]
    return tuple(str(word) for literal in literals for word in get_args(literal))


def joined(words: tuple[str, ...] | list[str]) -> str:
    """`a, b or c`."""
    return " or ".join(part for part in (", ".join(words[:-1]), words[-1]) if part)


def noun(annotation: Any, *, plural: bool = False) -> str:
    """What a value is: `a list of 3 numbers`."""
    parts = sections(annotation)
    others = [_one(member, plural) for member in members(annotation) if not is_component(member)]
    return joined([*([_mapping(parts, plural)] if parts else []), *others])


def _mapping(parts: dict[str, type[Component]], plural: bool) -> str:
    mapping = "mappings of keys" if plural else "a mapping of keys"
    if "" not in parts:
        return f"{mapping} with kind {joined(list(parts))}"
    names = list(parts[""].model_fields)
    return f"{mapping}: " + ", ".join(names[:SHOWN_KEYS] + ["..."] * (len(names) > SHOWN_KEYS))


def _one(annotation: Any, plural: bool) -> str:
    parts = get_args(annotation)
    if get_origin(annotation) is Literal:
        return joined([str(word) for word in parts])
    if get_origin(annotation) is tuple:
        count = "" if parts[-1] is Ellipsis else f"{len(parts)} "
        return f"{'lists' if plural else 'a list'} of {count}{noun(parts[0], plural=True)}"
    if get_origin(annotation) is dict:
        return f"a mapping of names to {noun(parts[1], plural=True)}"
    return NOUNS[annotation][plural]
