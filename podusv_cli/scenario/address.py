"""The value at a key of a scenario: what it is, what the models say of it, and another one there.

A key is written as in YAML with dots, `disturbance[1].seed`; `yaml_tree.route` gives its steps.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache, reduce
from typing import Any

from pydantic import ValidationError

from podusv_cli.core.component import Component
from podusv_cli.core.errors import PodusvError, SizingError
from podusv_cli.core.escaping import visible
from podusv_cli.scenario.conflicts import of_numbers
from podusv_cli.scenario.keys import Key, keys_of
from podusv_cli.scenario.model import PER_RUN, Scenario
from podusv_cli.scenario.yaml_tree import Route, dotted_key, entries_of, route


class ValueRefused(PodusvError):
    """A value that the scenario cannot take; `steps` lead to it where it is a single one."""

    exit_code = 2

    def __init__(self, text: str, steps: Route = ()) -> None:
        """With a sentence for the reader."""
        super().__init__(text)
        self.steps = steps


@lru_cache(maxsize=1024)
def steps_at(key: str) -> Route:
    """The steps of a key as `route` gives them.

    They are remembered, as every draw asks for the same keys.
    """
    return route(key)


def content(scenario: Scenario, steps: Route) -> Any:
    """What a scenario has at a key. Raises LookupError where it has no such key."""
    return reduce(_inside, steps, scenario)


@lru_cache
def _fields(kind: type[Component]) -> frozenset[str]:
    return frozenset(kind.model_fields)


def _inside(whole: Any, step: str | int) -> Any:
    """What is one step down in `whole`: a field by name, an item of a list by index.

    Raises LookupError where there is nothing.
    """
    if isinstance(whole, Component) and step in _fields(type(whole)):
        return getattr(whole, str(step))
    if isinstance(whole, tuple) and isinstance(step, int):
        return whole[step]
    raise LookupError(step)


def describe_key(scenario: Scenario, steps: Route) -> Key:
    """What the models say of the key at `steps`, which the scenario has: unit, range, meaning."""
    way: list[str | int] = []
    for end, step in enumerate(steps, 1):
        # Keys of a section depend on its kind, so each kind is a step of the way, too.
        kind = getattr(content(scenario, steps[:end]), "kind", None)
        way += [step, kind] if kind else [step]
    return keys_of(type(scenario)).follow(tuple(way))[0]


def has(scenario: Scenario, key: str) -> bool:
    """Whether the scenario has this key, in a section that may differ between runs."""
    steps = route(key)
    try:
        content(scenario, steps)
    except LookupError:
        return False
    return bool(steps) and dotted_key(steps) == key and steps[0] in PER_RUN


def no_entry(scenario: Scenario, steps: Route) -> str:
    """The entries of a list on the way to a key, in words, where `steps` has none of its places.

    Empty where that is not what is wrong.
    """
    for end in range(1, len(steps)):
        if not has(scenario, dotted_key(steps[:end])):
            return ""
        whole, step = content(scenario, steps[:end]), steps[end]
        if isinstance(whole, tuple) and not (isinstance(step, int) and step < len(whole)):
            kinds = [getattr(part, "kind", None) for part in whole]
            return entries_of(dotted_key(steps[:end]), kinds)
    return ""


def is_whole(key: Key) -> bool:
    """Whether the value is a whole number, and no other."""
    return int in key.types and float not in key.types


def with_values(scenario: Scenario, new: Mapping[Route, Any]) -> Scenario:
    """The scenario with new values at these places (`new`, by their steps).

    Null defaults follow what they are sized by, as they do when a scenario is loaded. Raises
    ValueRefused for a value that is out of range, or that contradicts another.
    """
    given: dict[str, dict[Route, Any]] = {}
    for steps, number in new.items():
        given.setdefault(str(steps[0]), {})[steps[1:]] = number
    made = scenario.model_copy(
        update={section: _section(scenario, section, new) for section, new in given.items()}
    )
    try:
        made = made.in_numbers()
    except SizingError as error:
        raise ValueRefused(str(error)) from error
    for key, fault in of_numbers(made, scenario):
        raise ValueRefused(f"{key}: {fault}", steps_at(key))
    return made


def _section(scenario: Scenario, section: str, new: Mapping[Route, Any]) -> Any:
    """A section with new values, checked by its own model.

    `new` has their steps below the section.
    """
    old = getattr(scenario, section)
    if not isinstance(old, tuple):
        return _part(scenario, (section,), old, new)
    each = [{steps[1:]: n for steps, n in new.items() if steps[0] == i} for i in range(len(old))]
    return tuple(
        _part(scenario, (section, i), part, own) if own else part
        for i, (part, own) in enumerate(zip(old, each, strict=True))
    )


def _part(scenario: Scenario, at: Route, old: Component, new: Mapping[Route, Any]) -> Component:
    """`old`, the part at route `at`, with new values; `new` has their routes below it.

    Raises ValueRefused with the sentence of the key that cannot take its value.
    """
    data: dict[str, Any] = {}
    for steps, number in new.items():
        name, inside = str(steps[0]), steps[1:]
        if inside and name not in data:
            data[name] = old.model_dump(include={name})[name]
        data[name] = _with(data[name], inside, number) if inside else number
    try:
        return old.changed(data)
    except ValidationError as error:
        raise _refusal(scenario, at, new, error) from error


def _with(whole: Any, steps: Route, new: Any) -> Any:
    """A copy of plain data (dicts and tuples) with `new` at the place that `steps` lead to.

    `whole` is the data; only what lies on the way to the place is copied.
    """
    if not steps:
        return new
    step = steps[0]
    if isinstance(step, int):
        return (*whole[:step], _with(whole[step], steps[1:], new), *whole[step + 1 :])
    # A key that is written only where it has a value may not be there.
    return {**whole, step: _with(whole.get(step), steps[1:], new)}


def _refusal(
    scenario: Scenario, at: Route, new: Mapping[Route, Any], error: ValidationError
) -> ValueRefused:
    """The first complaint of pydantic, as a sentence with key, value and range.

    `at` leads to the part that refused, `new` has the values by their steps below it. A complaint
    about no single value, such as of two that contradict, names all of them.
    """
    complaint = error.errors(include_url=False)[0]
    place = next((steps for steps in new if complaint["loc"][: len(steps)] == steps), None)
    if place is None:
        reason = complaint.get("ctx", {}).get("error", complaint["msg"])
        numbers = ", ".join(f"{dotted_key((*at, *s))} = {_on_a_line(x)}" for s, x in new.items())
        return ValueRefused(f"{dotted_key(at)}: {reason}, with {numbers}")
    key = describe_key(scenario, (*at, *place))
    number = new[place]
    advice = key.advice(number) if isinstance(number, str) else ""
    text = f"{dotted_key(key.path)} = {_on_a_line(number)}; must be {key.expectation}{advice}"
    return ValueRefused(text, (*at, *place))


def _on_a_line(number: Any) -> str:
    return f"{number:.6g}" if isinstance(number, float) else visible(number)
