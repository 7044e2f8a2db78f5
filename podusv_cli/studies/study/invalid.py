"""Draws that a scenario cannot take, found before anything is simulated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, reduce
from typing import Any, get_args

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel

from podusv_cli.core.component import Component
from podusv_cli.core.recording import blocks
from podusv_cli.scenario.keys import BOUNDS, Key, limits
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.sweep import Quantity, Sweep
from podusv_cli.scenario.yaml_tree import route
from podusv_cli.studies.study.check import singles
from podusv_cli.studies.study.draws import Draw, DrawError, content, described, drawn, table
from podusv_cli.studies.study.plan import Plan

COMPARED = {"gt": np.greater, "ge": np.greater_equal, "lt": np.less, "le": np.less_equal}
# The kinds of numpy's types that a field of this type takes.
TAKEN: dict[Any, str] = {float: "fiu", int: "iu"}
MOST_CHECKED = 100_000  # draws, some seconds
Mask = npt.NDArray[np.bool_]
Table = Mapping[str, npt.NDArray[Any]]
Vary = Mapping[str, Quantity]


@dataclass(frozen=True)
class Invalid:
    """How many draws cannot be taken, the first of them, and why it cannot."""

    count: int = 0
    first: int = 0
    reason: str = ""
    checked: int = 0
    wanted: int = 0

    def in_words(self) -> str:
        """How many draws are invalid, of those that were checked, and the first."""
        share = self.count / max(1, self.checked)
        more = "" if self.checked == self.wanted else "; the others were not checked"
        first = f"; draw {self.first}: {self.reason}" if self.count else ""
        return f"invalid draws: {self.count:,} of {self.checked:,} ({share:.2%}){more}{first}"


def check_draws(made: Plan) -> Invalid:
    """The draws of a study, or the first of very many, checked before any is simulated."""
    runs = [one for cell in made.cells for one in singles(cell.scenario).values()]
    checked = min(made.sweep.draws, MOST_CHECKED)
    found = invalid_draws(runs, made.sweep, checked)
    return replace(found, checked=checked, wanted=made.sweep.draws)


def invalid_draws(scenarios: Sequence[Scenario], sweep: Sweep, count: int) -> Invalid:
    """The first draws, checked against the ranges of every scenario: one for each law and cell."""
    parts = list(_different(scenarios, sweep.vary))
    found = Invalid()
    for rows in blocks(count):
        given = table(sweep, rows.start, rows.stop - rows.start)
        bad = np.zeros(rows.stop - rows.start, bool)
        for part in parts:
            bad |= part.bad(given, ~bad)
        places = np.flatnonzero(bad)
        if places.size and not found.count:
            found = Invalid(0, rows.start + int(places[0]), _reason(parts, _row(given, places[0])))
        found = Invalid(found.count + places.size, found.first, found.reason)
    return found


@dataclass(frozen=True)
class Section:
    """A section of a scenario, and those quantities that change it."""

    scenario: Scenario
    section: str
    vary: Vary

    def bad(self, given: Table, asked: Mask) -> Mask:
        """Which of the draws asked for the section cannot take."""
        open_: Mask = np.logical_and(asked, np.logical_not(self._surely_taken(given)))
        found = np.zeros_like(open_)
        for place in np.flatnonzero(open_):
            found[place] = bool(self.refusal(_row(given, place)))
        return found

    def refusal(self, draw: Draw) -> str:
        """Why the section cannot take a draw; "" where it can."""
        try:
            drawn(self.scenario, self.vary, {name: draw[name] for name in self.vary})
        except DrawError as error:
            return str(error)
        return ""

    def _surely_taken(self, given: Table) -> Any:
        """A mask of draws within all ranges; False where the section checks more than ranges."""
        own = getattr(self.scenario, self.section)
        parts = own if isinstance(own, tuple) else (own,)
        if not all(map(_has_ranges_only, map(type, parts))):
            return np.bool_(False)
        masks = [
            _in_range(
                described(self.scenario, route(key)), self._numbers(key, quantity, given[name])
            )
            for name, quantity in self.vary.items()
            for key in quantity.targets(name)
        ]
        return reduce(np.logical_and, masks)

    def _numbers(self, key: str, quantity: Quantity, column: npt.NDArray[Any]) -> npt.NDArray[Any]:
        if not quantity.relative:
            return column
        with np.errstate(over="ignore"):
            return np.asarray(quantity.value(content(self.scenario, route(key)), column))


def _different(scenarios: Sequence[Scenario], vary: Vary) -> Iterator[Section]:
    """The sections that are drawn in, each once if it is the same in several scenarios."""
    sections: dict[str, dict[str, list[str]]] = {}
    for name, quantity in vary.items():
        for key in quantity.targets(name):
            sections.setdefault(str(route(key)[0]), {}).setdefault(name, []).append(key)
    for section, names in sections.items():
        own = {n: vary[n].model_copy(update={"keys": tuple(keys)}) for n, keys in names.items()}
        seen: list[Component] = []
        for scenario in scenarios:
            if getattr(scenario, section) not in seen:
                seen.append(getattr(scenario, section))
                yield Section(scenario, section, own)


def _row(given: Table, place: int | np.intp) -> Draw:
    return {name: column[place : place + 1].tolist()[0] for name, column in given.items()}


def _reason(parts: Sequence[Section], draw: Draw) -> str:
    return next(filter(None, (part.refusal(draw) for part in parts)))


def _in_range(key: Key, numbers: npt.NDArray[Any]) -> Any:
    """A mask of the numbers that the field takes; False where more than ranges is checked."""
    metadata = key.field.metadata if key.field else [None]
    says_all = all(any(hasattr(one, name) for name in BOUNDS) for one in metadata)
    if not says_all or numbers.dtype.kind not in TAKEN.get(key.annotation, ""):
        return np.bool_(False)
    masks = [COMPARED[name](numbers, bound) for name, bound in limits(key.field).items()]
    return reduce(np.logical_and, [np.isfinite(numbers), *masks])


@cache
def _has_ranges_only(model: Any) -> bool:
    """Whether nothing but its fields' types and ranges is checked when a component is made."""
    decorated = model.__pydantic_decorators__
    checks = (decorated.model_validators, decorated.field_validators, decorated.validators)
    plain = not any(checks) and not model.__pydantic_custom_init__
    return (
        plain
        and model.model_post_init is BaseModel.model_post_init
        and all(
            map(
                _has_ranges_only,
                _components(field.annotation for field in model.model_fields.values()),
            )
        )
    )


def _components(annotations: Any) -> Iterator[type[Component]]:
    for annotation in annotations:
        if isinstance(annotation, type) and issubclass(annotation, Component):
            yield annotation
        yield from _components(get_args(annotation))
