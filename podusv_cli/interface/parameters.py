"""The scenarios of many runs, from one value a run for each of some keys."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from podusv_cli.core.component import Component
from podusv_cli.core.errors import PodusvError
from podusv_cli.core.phrases import as_yaml, unknown_word
from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.check import check_law
from podusv_cli.interface.border import ParameterError
from podusv_cli.scenario.address import (
    ValueRefused,
    content,
    describe_key,
    has,
    is_whole,
    no_entry,
    with_values,
)
from podusv_cli.scenario.load import values
from podusv_cli.scenario.model import PER_RUN, Scenario
from podusv_cli.scenario.yaml_tree import Route, bracketed_key, route

Columns = dict[str, list[Any]]  # by key, with one value a run


def columns(parameters: Mapping[str, Any]) -> Columns:
    """The values as Python's own, by key, each list with one value a run.

    `parameters` are lists or arrays by key. Raises ParameterError (a ValueError) unless every key
    has as many values.
    """
    by_key = {key: _column(key, given) for key, given in parameters.items()}
    lengths = {key: len(column) for key, column in by_key.items()}
    if not by_key:
        raise ParameterError(
            "no parameters: give a key and its values, as {'vessel.m': [20.0, 25.0]}"
        )
    if len(set(lengths.values())) > 1:
        raise ParameterError(f"all parameters need one value a run; their lengths are {lengths}")
    return by_key


def _column(key: str, given: Any) -> list[Any]:
    """The values of one key as Python's own, one a run, from a list or array (runs,).

    Raises ParameterError for anything else.
    """
    # As objects: numpy would give numbers and words of one list the same type.
    array = np.asarray(given, object)
    if array.ndim != 1:
        what = f"an array of shape {array.shape}" if array.ndim else f"{given!r:.60}"
        raise ParameterError(f"{key}: must be a list or array with one value a run, found {what}")
    return [value.item() if isinstance(value, np.generic) else value for value in array.tolist()]


def in_si(scenario: Scenario, given: Columns) -> Columns:
    """The values with numbers in place of texts such as "45 deg". Raises ValueError as below."""
    keys = {name: describe_key(scenario, _steps(scenario, name)) for name in given}
    return {name: [keys[name].number(value) for value in column] for name, column in given.items()}


def scenarios(scenario: Scenario, given: Columns) -> list[Scenario]:
    """The scenario of every run; `given` are the values of its keys, one a run.

    Raises ParameterError for unknown keys and values out of range.
    """
    steps = {key: _steps(scenario, key) for key in given}
    whole = {key for key, at in steps.items() if is_whole(describe_key(scenario, at))}
    made = []
    for row, new in enumerate(zip(*given.values(), strict=True)):
        numbers = {
            # Arrays of numpy have floats where a whole number is meant.
            steps[key]: int(value) if key in whole and _is_integer(value) else value
            for key, value in zip(given, new, strict=True)
        }
        try:
            made.append(with_values(scenario, numbers))
        except ValueRefused as error:
            raise ParameterError(f"row {row}: {error}") from error
    return made


def _steps(scenario: Scenario, name: str) -> Route:
    """The steps of a key that may differ between runs of a batch.

    Raises ParameterError for others.
    """
    key = bracketed_key(name)
    steps = route(key)
    section = str(steps[0]) if steps else ""
    if section not in PER_RUN and section in Scenario.model_fields:
        raise ParameterError(
            f"{name}: {section} is the same in all runs of a batch (allowed: keys of "
            f"{', '.join(PER_RUN)}); to change it: podusv.load(source, {{{name!r}: ...}})"
        )
    if not steps or not has(scenario, key):
        known = [key for key in values(scenario) if has(scenario, key)]
        beyond = no_entry(scenario, steps)
        raise ParameterError(
            f"{name}: {beyond or unknown_word('key', key, known, 'podusv explain')}"
        )
    if isinstance(content(scenario, steps), Component):
        raise ParameterError(f"{name}: is a section; name one of the keys in it")
    if steps[-1] in ("kind", "preset"):
        raise ParameterError(f"{name}: is the same in all runs of a batch; make a batch for each")
    return steps


def check_words(scenario: Scenario, loops: Sequence[ClosedLoop], given: Columns) -> None:
    """Check the law with every combination of words that the runs have.

    `loops` are those of the runs, `given` the values by key. Raises LawError, and ParameterError
    where words, or the least or largest of numbers, change how the loop is put together.
    """
    _check_ends(scenario, loops, given)
    words = {key: column for key, column in given.items() if any(map(_is_word, column))}
    rows = list(enumerate(zip(*words.values(), strict=True)))
    # Reversed, so that the first row of each combination is the one that stays.
    first_rows = {combination: row for row, combination in reversed(rows)}
    grid = scenario.time_grid()
    first = Plan(loops[0], grid)
    for own, row in first_rows.items():
        plan = Plan(loops[row], grid)
        check_law(plan)
        if plan.structure != first.structure:
            raise ParameterError(
                f"row {row}: {_describe_columns(words, own)} changes how the loop is put together, "
                f"and row 0 has {_describe_columns(words, rows[0][1])}; make a batch for each"
            )


def _check_ends(scenario: Scenario, loops: Sequence[ClosedLoop], given: Columns) -> None:
    """Raise ParameterError where the ends of numbers differ in structure from the first run.

    `loops` are those of the runs, `given` the values by key. A loop that cannot be made at all is
    left to the batch, which says so in its row.
    """
    numbers = {key: column for key, column in given.items() if not any(map(_is_word, column))}
    grid = scenario.time_grid()
    for key, column in numbers.items() if loops else ():
        first = Plan(loops[0], grid).structure
        # Only the ends: a plan for each of thousands of values would take longer than some batches.
        for row in sorted({int(np.argmin(column)), int(np.argmax(column))} - {0}):
            other = first
            with suppress(PodusvError):
                other = Plan(loops[row], grid).structure
            if other != first:
                raise ParameterError(
                    f"row {row}: {key} = {column[row]:g} changes how the loop is put together, and "
                    f"row 0 has {column[0]:g}; make a batch for each"
                )


def _describe_columns(words: Columns, own: Iterable[Any]) -> str:
    return ", ".join(f"{key} = {as_yaml(value)}" for key, value in zip(words, own, strict=True))


def _is_word(value: Any) -> bool:
    return isinstance(value, (str, bool))


def _is_integer(value: Any) -> bool:
    return isinstance(value, float) and value.is_integer()
