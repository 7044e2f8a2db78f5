"""The choices of a comparison that its source leaves open, and the values that they may have.

A choice is a value of the scenario: a number, or a word. Numbers have a range for the search one at
a time, and a narrower one for draws of all at once. What may move by default is everything that
`doubt.printed` does not name.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from podusv_cli.components.disturbances.calm import Calm
from podusv_cli.components.disturbances.step import Step
from podusv_cli.core.component import Component
from podusv_cli.doubt.ranges import RANGES, TRIED, DoubtRange
from podusv_cli.scenario.address import ValueRefused, content, describe_key, with_values
from podusv_cli.scenario.doubt import Doubt
from podusv_cli.scenario.keys import Key
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.sweep import Quantity
from podusv_cli.scenario.yaml_tree import Route, bracketed_key, dotted_key

HULL: Route = ("vessel",)  # where the name of a preset stands for the whole hull
Singles = Mapping[str, Scenario]  # the scenario of each law, by its label
Place = tuple[str, Route]  # a law's label, and where the value stands in the scenario of its run
ITS_OWN = "the scenario's own"
BESIDE = 1.0123456789  # a factor on a time: whether it may be any, or whole steps only


@dataclass(frozen=True)
class Choice:
    """A value that may be another, at all places that have it together.

    A number has a `range`, all else `values` to be tried in its place. Several numbers that move
    together, as those of a hull, have `rows` of which draws take one, and stay where others are
    tried.
    """

    name: str  # the key that readers see
    places: tuple[Place, ...]
    own: Any
    unit: str = ""
    range: DoubtRange | None = None
    values: tuple[Any, ...] = ()
    task: bool = False  # whether another value is another task
    beside: frozenset[str] = frozenset()  # laws of the same kind that differ in it
    named: bool = False  # whether it is what distinguishes its law from those
    rows: Quantity | None = None

    @property
    def labels(self) -> frozenset[str]:
        """The laws whose runs it moves."""
        return frozenset(label for label, _ in self.places)

    def at(self, value: Any) -> dict[Place, Any]:
        """What every place has for a value of the choice.

        For rows, a value is the number of a row.
        """
        if not self.rows:
            return dict.fromkeys(self.places, value)
        row = dict(zip(self.rows.lines.names, self.rows.lines.rows[value].tolist(), strict=True))
        keys = {place: f".{dotted_key(place[1])}" for place in self.places}
        return {
            # The longest column whose name ends the key: `a.m` is not meant by `m` where both are
            # there.
            place: row[max((name for name in row if key.endswith(f".{name}")), key=len)]
            for place, key in keys.items()
        }

    def is_contrast(self, labels: frozenset[str]) -> bool:
        """Whether it is what a claim about these laws compares, and so has to stay."""
        return self.named or (bool(self.labels & labels) and bool(self.beside & labels))


OTHERS = ("simulation.step", "simulation.duration", "control.period", "control.update")
# What another value of makes another task: where the target goes, a hull that laws know wrongly,
# and whether the hull has Coriolis terms
TASK = ("path.", "nominal.", "vessel.coriolis")
WAYS_OF_LAW = ("path.switch", "path.fillet")  # but these, which are part of a law's way
# Fields that are no part of the motion
FIXED = ("kind", "preset", "source", "validity", "length", "beam", "envelope")


def choices(singles: Singles, doubt: Doubt | None = None) -> list[Choice]:
    """All choices of a comparison but those at keys that the source prints.

    `singles` are the laws' scenarios by label. A value that several laws share is one choice; the
    source prints it if it does for one of them.
    """
    doubt = doubt or Doubt()
    groups: dict[tuple[str, str], list[Place]] = defaultdict(list)
    for label, scenario in singles.items():
        for route, own in _leaves(scenario):
            # By the value's text, as 1 and True are equal.
            groups[dotted_key(route), repr(own)].append((label, route))
    unprinted = [g for g in groups.values() if not any(_is_printed(public(p), doubt) for p in g)]
    of_values = [choice for places in unprinted for choice in _of_places(places, singles)]
    own = [_choice_from_vary(name, quantity, singles) for name, quantity in doubt.vary.items()]
    taken = {place for choice in own for place in choice.places}
    return [
        *hulls(singles, doubt),
        *own,
        *(choice for choice in of_values if not taken & {*choice.places}),
    ]


def hulls(singles: Singles, doubt: Doubt) -> Iterator[Choice]:
    """The choice of a whole hull, by the presets that `doubt.hulls` names.

    There is none where it names no other than the scenario's own. `singles` are the laws' scenarios
    by label; all have the vessel of the comparison, so the first one tells its preset.
    """
    first = next(iter(singles.values())).vessel.preset
    others = tuple(hull for hull in doubt.hulls if hull != first)
    if others:
        yield Choice(
            "vessel.preset", tuple((label, HULL) for label in singles), first, values=others
        )


def public(place: Place) -> str:
    """The key as the comparison's scenario has it."""
    label, route = place
    return dotted_key(("controllers", label, *route[1:]) if route[0] == "controller" else route)


def by_key(singles: Singles) -> dict[str, list[Place]]:
    """Where each key of the comparison's scenario stands in the runs of its laws.

    `singles` are the laws' scenarios by label.
    """
    known = defaultdict[str, list[Place]](list)
    for label, scenario in singles.items():
        for route, _ in _leaves(scenario):
            known[public((label, route))].append((label, route))
    return dict(known)


def _is_printed(key: str, doubt: Doubt) -> bool:
    """Whether the source prints a key, or the section or law that it is in."""
    return any(key == one or key.startswith((f"{one}.", f"{one}[")) for one in doubt.printed)


def _leaves(scenario: Scenario) -> Iterator[tuple[Route, Any]]:
    """Every number and word that may move, with its place."""
    for section in RANGES:
        yield from _within(getattr(scenario, section), (section,))
    for key in OTHERS:
        section, name = key.split(".")
        yield (section, name), getattr(getattr(scenario, section), name)


def _within(part: Any, at: Route) -> Iterator[tuple[Route, Any]]:
    """Route and content of each single value in a part; `at` is the part's own route."""
    if isinstance(part, Component):
        for name in type(part).model_fields:
            if name not in FIXED:
                yield from _within(getattr(part, name), (*at, name))
    elif isinstance(part, tuple):
        for place, value in enumerate(part):
            if isinstance(value, Component):
                yield from _within(value, (*at, place))
    elif isinstance(part, (bool, int, float, str)):
        yield at, part


def _of_places(places: Sequence[Place], singles: Singles) -> Iterator[Choice]:
    """The choice of a value that several laws share, if there is one.

    What laws know of a hull's number moves with it where both are the same. Moving the `nominal`
    number alone is another choice, and another task.
    """
    base, key = _base(places, singles)
    tried = TRIED.get(base.name, lambda own: _values(key, own))(base.own)
    tried = tried or _in_whole_steps(base, singles[places[0][0]], places[0][1])
    # Ranges depend on the section, then on the unit.
    way = RANGES.get(str(places[0][1][0]), {})
    known = (*places, *_places_laws_know(places, singles))
    if tried:
        yield replace(base, places=known, values=tried)
    elif (
        isinstance(base.own, float)
        and (moves := way.get(base.unit, way.get("")))
        and (found := moves(base.own, singles[places[0][0]], key))
    ):
        yield replace(base, places=known, range=found)


def _in_whole_steps(base: Choice, scenario: Scenario, route: Route) -> tuple[float, ...]:
    """Half and twice a time that has to be whole steps, as a sensor's period; nothing for others.

    `base` is the choice of that time so far, `route` leads to the time in `scenario`.
    """
    if base.unit != "s" or not isinstance(base.own, float) or not base.own:
        return ()

    def is_taken(value: float) -> bool:
        """Whether the scenario takes this value at the route."""
        with suppress(ValueRefused):
            return bool(with_values(scenario, {route: value}))
        return False

    # A time that may be anything gets a range instead.
    if is_taken(base.own * BESIDE):
        return ()
    return tuple(filter(is_taken, (base.own / 2.0, base.own * 2.0)))


def _base(places: Sequence[Place], singles: Singles) -> tuple[Choice, Key]:
    """A choice at `places` without other values, and what the models say of its key."""
    (label, route), name = places[0], public(places[0])
    key, own = describe_key(singles[label], route), content(singles[label], route)
    task = (name.startswith(TASK) and not name.startswith(WAYS_OF_LAW)) or _adds_load(route, own)
    beside = _beside(places, singles)
    named = bool(beside) and own != key.default
    return Choice(name, tuple(places), own, key.unit, task=task, beside=beside, named=named), key


def _adds_load(route: Route, own: Any) -> bool:
    return route[0] == "disturbance" and own == 0.0


def with_loads(singles: Singles) -> Singles:
    """The same scenarios with calm water as a steady load of 0, which may then be moved."""
    calm, steady = Calm(), Step()
    return {
        label: single.model_copy(update={"disturbance": steady})
        if single.disturbance == calm
        else single
        for label, single in singles.items()
    }


def _choice_from_vary(name: str, quantity: Quantity, singles: Singles) -> Choice:
    """The choice that `doubt.vary` has for a key; `doubt_faults` has refused what cannot be one."""
    known = by_key(singles)
    own = [place for key in quantity.targets(name) for place in known[bracketed_key(key)]]
    base, key = _base(own, singles)
    moving = (*own, *_places_laws_know(own, singles))
    if quantity.rows:
        return replace(base, name=name, own=ITS_OWN, unit="", places=moving, rows=quantity)
    if quantity.seed or quantity.distribution.choice:
        values = quantity.distribution.choice or _values(key, base.own)
        return replace(base, places=moving, values=values)
    # Of a number that is 0, a summand's size, or 1 in its unit.
    scale = abs(base.own) or max(abs(quantity.value(base.own, 1.0)), 1.0)
    return replace(base, places=moving, range=DoubtRange(quantity, quantity, scale))


def _places_laws_know(places: Sequence[Place], singles: Singles) -> list[Place]:
    """The places where laws know the same numbers of the hull as it has at `places`."""
    hull = [(label, at, ("nominal", *at[1:])) for label, at in places if at[0] == "vessel"]
    return [
        (label, known)
        for label, at, known in hull
        if content(singles[label], at) == content(singles[label], known)
    ]


def _values(key: Key, own: Any) -> tuple[Any, ...]:
    """The values to try of a word, switch or count: other words, the next seeds, half and twice.

    `own` is the scenario's value. A real number has a range, and thus no values.
    """
    if isinstance(own, bool):
        return (not own,)
    if isinstance(own, int):
        return (own + 1, own + 2) if key.name == "seed" else (max(own // 2, 1), own * 2)
    return tuple(word for word in key.choices if word != own) if isinstance(own, str) else ()


def _beside(places: Sequence[Place], singles: Singles) -> frozenset[str]:
    """The laws of the same kind that have another value at these places of a law.

    Empty where the places are those of another section.
    """
    own = {label for label, _ in places}
    if places[0][1][0] != "controller":
        return frozenset()
    kinds = {type(singles[law].controller) for law in own}
    return frozenset(
        other
        for other, single in singles.items()
        if other not in own and type(single.controller) in kinds
    )
