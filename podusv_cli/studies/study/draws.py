"""Draws: the numbers of a study's runs, and a scenario with one draw's numbers in it.

Every quantity has a stream of its own (`core.random_words`). So a draw depends on the study's seed,
the stream, the quantity's name and i, and on nothing else: not on other quantities, on how many
draws there are, or on who asks for which of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache, reduce
from typing import Any, NamedTuple
from warnings import catch_warnings

import numpy as np
import numpy.typing as npt
from pydantic import ValidationError

from podusv_cli.core import random_words
from podusv_cli.core.component import Component
from podusv_cli.core.errors import PodusvError, SizingError
from podusv_cli.core.escaping import visible
from podusv_cli.core.kernel import Vector
from podusv_cli.core.random_words import Words, in_unit_interval
from podusv_cli.scenario.conflicts import of_numbers
from podusv_cli.scenario.keys import Key, keys_of
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.phrases import hint
from podusv_cli.scenario.sweep import Quantity, Sweep
from podusv_cli.scenario.yaml_tree import Route, dotted, route

Draw = Mapping[str, float | int | str]  # by quantity
SEED_BITS = 53  # so that a seed is exact as a float, too
SOBOL_BITS = 32  # of a point, the most that scipy goes forward by; the shift has more
SWEEP = "sweep"  # the stream of a sweep's own draws


class Number(NamedTuple):
    """What a key becomes, and what a message about it starts with: who says so, if anybody."""

    source: str
    value: Any

    def __str__(self) -> str:
        """The value, on one line."""
        return f"{self.value:.6g}" if isinstance(self.value, float) else visible(self.value)


class DrawError(PodusvError):
    """A draw that the scenario cannot take."""

    exit_code = 2


def words(seed: int, quantity: str, first: int, count: int, stream: str = SWEEP) -> Words:
    """The random words of draws first, first + 1, ... of a quantity."""
    return random_words.words((seed, stream, quantity), first, count)


def uniforms(seed: int, quantity: str, first: int, count: int, stream: str = SWEEP) -> Vector:
    """Draws of a quantity, uniform in (0, 1) without the ends."""
    return in_unit_interval(words(seed, quantity, first, count, stream))


def seeds(seed: int, quantity: str, first: int, count: int, stream: str = SWEEP) -> Words:
    """Draws of a seed: whole numbers."""
    return words(seed, quantity, first, count, stream) >> np.uint64(64 - SEED_BITS)


def table(sweep: Sweep, first: int, count: int, stream: str = SWEEP) -> dict[str, npt.NDArray[Any]]:
    """Draws first, first + 1, ... of every quantity, by its name."""
    shares = _sobol if sweep.design == "sobol" else _random
    found = shares(sweep, first, count, stream)
    with np.errstate(over="ignore"):  # the scenario's ranges tell
        return {
            name: seeds(sweep.seed, name, first, count, stream)
            if quantity.seed
            else quantity.distribution.at(found[name])
            for name, quantity in sweep.vary.items()
        }


def draws(sweep: Sweep, first: int, count: int, stream: str = SWEEP) -> Iterator[Draw]:
    """Draws first, first + 1, ... one by one, as Python's own numbers and words."""
    columns = {name: c.tolist() for name, c in table(sweep, first, count, stream).items()}
    return ({name: column[i] for name, column in columns.items()} for i in range(count))


def _random(sweep: Sweep, first: int, count: int, stream: str) -> dict[str, Vector]:
    return {name: uniforms(sweep.seed, name, first, count, stream) for name in sweep.vary}


def _sobol(sweep: Sweep, first: int, count: int, stream: str) -> dict[str, Vector]:
    """Sobol' points, each dimension shifted by the quantity's own digits."""
    from scipy.stats import qmc  # takes 60 MB

    if not sweep.vary:
        return {}
    sequence = qmc.Sobol(len(sweep.vary), scramble=False, bits=SOBOL_BITS)
    if first:  # scipy cannot go forward by nothing
        sequence.fast_forward(first)
    with catch_warnings(category=UserWarning, action="ignore"):  # of counts but powers of 2
        points = (sequence.random(count) * 2.0**SOBOL_BITS).astype(np.uint64)
    shifts = [words(sweep.seed, name, 0, 1, f"{stream} shift") for name in sweep.vary]
    return {
        name: in_unit_interval((points[:, i] << np.uint64(64 - SOBOL_BITS)) ^ shift)
        for i, (name, shift) in enumerate(zip(sweep.vary, shifts, strict=True))
    }


def drawn(scenario: Scenario, vary: Mapping[str, Quantity], draw: Draw) -> Scenario:
    """The scenario of one law with the numbers of a draw.

    `vessel.m` does not change `nominal`, which the law is told. Raises DrawError where a number is
    out of range.
    """
    new: dict[Route, Number] = {}
    for name, number in draw.items():
        for key in vary[name].targets(name):
            steps = _steps(key)
            own = content(scenario, steps) if vary[name].relative else None
            new[steps] = Number(f"sweep.vary.{name}: ", vary[name].value(own, number))
    return with_values(scenario, new)


def with_values(scenario: Scenario, new: Mapping[Route, Number]) -> Scenario:
    """The scenario with new values at these places.

    Null defaults follow what they are sized by, as they do when a scenario is loaded. Raises
    DrawError for a value that is out of range, or that contradicts another.
    """
    given: dict[str, dict[Route, Number]] = {}
    for (section, *rest), number in new.items():
        given.setdefault(str(section), {})[tuple(rest)] = number
    made = scenario.model_copy(
        update={section: _section(scenario, section, new) for section, new in given.items()}
    )
    try:
        made = made.in_numbers()
    except SizingError as error:
        raise DrawError(str(error)) from error
    for key, told in of_numbers(made):
        raise DrawError(
            f"{new[steps].source if (steps := _steps(key)) in new else ''}{key}: {told}"
        )
    return made


@lru_cache(maxsize=1024)
def _steps(key: str) -> Route:
    return route(key)


def content(scenario: Scenario, steps: Route) -> Any:
    """What a scenario has at a key. Raises LookupError where it has no such key."""
    return reduce(_inside, steps, scenario)


@lru_cache
def _fields(kind: type[Component]) -> frozenset[str]:
    return frozenset(kind.model_fields)


def _inside(whole: Any, step: str | int) -> Any:
    if isinstance(whole, Component) and step in _fields(type(whole)):
        return getattr(whole, str(step))
    if isinstance(whole, tuple) and isinstance(step, int):
        return whole[step]
    raise LookupError(step)


def described(scenario: Scenario, steps: Route) -> Key:
    """What the models say of a key that the scenario has."""
    way: list[str | int] = []
    for end, step in enumerate(steps, 1):
        kind = getattr(content(scenario, steps[:end]), "kind", None)
        way += [step, kind] if kind else [step]
    return keys_of(type(scenario)).follow(tuple(way))[0]


def _section(scenario: Scenario, section: str, new: Mapping[Route, Number]) -> Any:
    """A section with new values at these places, checked by its own model."""
    old = getattr(scenario, section)
    if not isinstance(old, tuple):
        return _part(scenario, (section,), old, new)
    each = [{steps[1:]: n for steps, n in new.items() if steps[0] == i} for i in range(len(old))]
    return tuple(
        _part(scenario, (section, i), part, own) if own else part
        for i, (part, own) in enumerate(zip(old, each, strict=True))
    )


def _part(scenario: Scenario, at: Route, old: Component, new: Mapping[Route, Number]) -> Component:
    data: Any = old.model_dump()
    for place, number in new.items():
        data = _with(data, place, number.value)
    try:
        return old.changed({str(place[0]): data[place[0]] for place in new})
    except ValidationError as error:
        raise DrawError(_sentence(scenario, at, new, error)) from error


def _with(whole: Any, steps: Route, new: Any) -> Any:
    """Plain data with another value at a place."""
    if not steps:
        return new
    step, *rest = steps
    inner = _with(whole[step], tuple(rest), new)
    if isinstance(step, int):
        return (*whole[:step], inner, *whole[step + 1 :])
    return {**whole, step: inner}


def _sentence(
    scenario: Scenario, at: Route, new: Mapping[Route, Number], error: ValidationError
) -> str:
    """The first complaint, as a sentence with source, key, value and range."""
    complaint = error.errors(include_url=False)[0]
    place = next((steps for steps in new if complaint["loc"][: len(steps)] == steps), None)
    if place is None:
        reason = complaint.get("ctx", {}).get("error", complaint["msg"])
        numbers = ", ".join(f"{dotted((*at, *s))} = {x}" for s, x in new.items())
        return f"{dotted(at)}: {reason}, with {numbers}"
    key = described(scenario, (*at, *place))
    number = new[place]
    advice = hint(number.value, key.types) if isinstance(number.value, str) else ""
    return f"{number.source}{dotted(key.path)} = {number}; must be {key.wanted}{advice}"
