"""The keys of a scenario as its models describe them: type, unit, range, default, meaning.

Messages, `explain`, the JSON schema and the filling of presets all read the models here.
"""

from __future__ import annotations

import types
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Annotated, Any, Literal, TypeGuard, Union, get_args, get_origin

from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from podusv_cli.core import units
from podusv_cli.core.component import Component, unit_of
from podusv_cli.core.phrases import hint
from podusv_cli.core.units import PURE
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.sections import NAME as PATTERN
from podusv_cli.scenario.sections import NAME_IN_WORDS
from podusv_cli.scenario.yaml_tree import Route, route

NAME, NUMBER = "NAME", "NUMBER"  # stand for the names in a mapping, the positions in a list
NO_DEFAULT = PydanticUndefined  # the default of a field that has none
BOUNDS = {
    "gt": (">", "above"),
    "ge": (">=", "not below"),
    "lt": ("<", "below"),
    "le": ("<=", "not above"),
}
PATTERNS_IN_WORDS = {PATTERN: NAME_IN_WORDS}
NOUNS: dict[Any, tuple[str, str]] = {
    float: ("a number", "numbers"),
    int: ("a whole number", "whole numbers"),
    bool: ("true or false", "true or false"),
    str: ("text", "texts"),
    type(None): ("null", "null"),
    Any: ("any value", "any values"),
}
SHOWN_KEYS = 6
# Sections whose entries are about the keys that they are named after, and where these keys are.
OF_KEYS: dict[Route, Route] = {
    ("sweep", "vary"): (),
    ("sweep", "grid"): (),
    ("doubt", "vary"): (),
    ("tune", "space"): ("controller",),
    ("identify", "noise"): ("estimator",),
}
OF_KEY = "unit of the key"


@dataclass(frozen=True)
class Key:
    """A key of a scenario, a kind of a section, an item of a list or an entry of a mapping.

    `path` is written as in files; `route` also has the kinds of the sections on the way, the
    innermost of which is `kind`. A kind, an item and an entry have no `field`. `default` is that
    of the section in which the key stands. `model` is the class that has the key, `scenario` that
    of the whole.
    """

    path: Route
    annotation: Any
    field: FieldInfo | None = None
    default: Any = NO_DEFAULT
    route: Route = ()
    kind: str = ""
    model: type[Component] = Scenario
    scenario: type[Scenario] = Scenario
    unit_of_section: str = ""

    @property
    def top(self) -> Key:
        """The whole scenario in which this key is."""
        return keys_of(self.scenario)

    @property
    def name(self) -> str:
        """The last word of the route."""
        return str(self.route[-1])

    @property
    def is_kind(self) -> bool:
        """Whether this is a kind of a section, and no key."""
        return self.field is None and bool(self.kind) and self.name == self.kind

    @property
    def unit(self) -> str:
        """The unit of the value, "" where it has none."""
        return "" if self.keys else self._inner_unit

    @property
    def _inner_unit(self) -> str:
        """The unit of the value, or that of which parts in it are."""
        return unit_of(self.field, self.unit_of_section) if self.field else self.unit_of_section

    @property
    def range(self) -> str:
        """The range in symbols: `> 0, <= 1`."""
        return ", ".join(f"{symbol} {limit:g}" for symbol, _, limit in self._bounds)

    @property
    def type_in_words(self) -> str:
        """What the value is: `a list of 3 numbers`."""
        pattern = PATTERNS_IN_WORDS.get(limits(self.field).get("pattern", ""), "")
        return f"{noun(self.annotation)} {pattern}".rstrip()

    @property
    def expectation(self) -> str:
        """What the value must be, with range and unit: `a number above 0 [s]`."""
        ranges = " and ".join(f"{words} {limit:g}" for _, words, limit in self._bounds)
        unit = f"[{self.unit}]" if self.unit else ""
        return " ".join(filter(None, (self.type_in_words, ranges, unit)))

    @property
    def _bounds(self) -> list[tuple[str, str, float]]:
        """For each bound of the key its sign, its words and the number."""
        given = limits(self.field)
        return [(*BOUNDS[name], given[name]) for name in BOUNDS if name in given]

    @property
    def types(self) -> tuple[Any, ...]:
        """The types that the value may have: float, tuple, ..."""
        return tuple(get_origin(member) or member for member in members(self.annotation))

    @property
    def choices(self) -> tuple[str, ...]:
        """The words that the value may be."""
        literals = [member for member in members(self.annotation) if get_origin(member) is Literal]
        return tuple(str(word) for literal in literals for word in get_args(literal))

    @property
    def section(self) -> type[Component] | None:
        """The class of this section; None where its kind is open, and for a plain value."""
        parts = sections(self.annotation)
        return parts.get("") or (self.annotation if _is_component(self.annotation) else None)

    @cached_property
    def kinds(self) -> dict[str, Key]:
        """The kinds of this section as keys, by name; none where it has no kinds."""
        parts = {} if self.section else sections(self.annotation)
        return {
            kind: replace(
                self,
                annotation=part,
                field=None,
                route=(*self.route, kind),
                kind=kind,
                model=part,
                unit_of_section=self._inner_unit,
            )
            for kind, part in parts.items()
        }

    @cached_property
    def keys(self) -> dict[str, Key]:
        """What is in this section: its keys, or its kinds."""
        fields = self.section.model_fields.items() if self.section else ()
        return {name: self._key(name, field) for name, field in fields} or self.kinds

    def _within(self, name: str) -> Key | None:
        """One of `keys`, without the others being made."""
        if not self.section:
            return self.kinds.get(name)
        field = self.section.model_fields.get(name)
        return self._key(name, field) if field else None

    def _key(self, name: str, field: FieldInfo) -> Key:
        """The key of the field `name` in this section, with the section's default for it."""
        model = self.section or self.model
        # A section that is left out is its default, whatever its own class would start with.
        given = isinstance(self.default, model)
        default = getattr(self.default, name) if given else field.default
        # A rule gives its number when the scenario is known; until then it is null.
        if name in model.rules:
            default = None
        return Key(
            (*self.path, name),
            field.annotation,
            field,
            default,
            (*self.route, name),
            self.kind,
            model,
            self.scenario,
            self._inner_unit,
        )

    def item(self, step: str | int) -> Key | None:
        """The item of a list at position `step`, or the entry of a mapping of that name.

        None if the key is neither. NUMBER and NAME stand for any position and any name.
        """
        is_position = isinstance(step, int) or step == NUMBER
        for member in members(self.annotation):
            parts, types = get_args(member), None
            if get_origin(member) is tuple and is_position:
                # A list of fixed length has a type for each place, an open one a single type.
                types = parts[:1] if parts[-1] is Ellipsis or step == NUMBER else parts[int(step) :]
            if get_origin(member) is dict and not is_position:
                types = parts[1:]
            if types:
                inner = replace(
                    self,
                    path=(*self.path, step),
                    route=(*self.route, step),
                    annotation=types[0],
                    field=None,
                    default=NO_DEFAULT,
                    unit_of_section=self._unit_of(types[0], step),
                )
                return inner.of_keys(str(step)) if self.path in OF_KEYS else inner
        return None

    def _unit_of(self, inner: Any, step: str | int) -> str:
        """The unit of an item at `step`, of type `inner`.

        A unit as "m/s, m/s, rad/s" has one for each position in the innermost list.
        """
        each = self._inner_unit.split(", ")
        innermost = isinstance(step, int) and get_origin(inner) is not tuple
        return each[int(step) % len(each)] if innermost else self._inner_unit

    def of_keys(self, *names: str) -> Key:
        """This entry of `sweep.vary` (see OF_KEYS), whose numbers are those of the keys `names`.

        Its unit is one that all these keys have; a key may belong to several kinds with several
        units.
        """
        home = OF_KEYS[self.path[:-1]]
        places = [(*home, name.rpartition(".")[2]) if home else route(name) for name in names]
        each = [[*self.top.follow(place)] for place in places]
        targets = [key for keys in each for key in keys]
        known = [dict.fromkeys(key.unit or PURE for key in keys) for keys in each]
        units = [unit for unit in known[0] if all(unit in others for others in known)]
        # Of an open list, items have the type of the key itself.
        several = bool(targets) and get_args(self.annotation)[1:] == (Ellipsis,)
        inner = (targets[0].annotation, Ellipsis) if several else ()
        return replace(
            self,
            unit_of_section=" or ".join(units) or OF_KEY,
            annotation=types.GenericAlias(tuple, inner) if several else self.annotation,
        )

    @cached_property
    def _numeric(self) -> bool:
        """Whether the value may be a number, or a list of some."""
        return not {*_scalars(self.annotation)}.isdisjoint((int, float))

    @property
    def other_units(self) -> list[str]:
        """The units that its numbers may be written with, beside its own."""
        return [*units.units_allowed_for(self.unit)][1:] if self.unit and self._numeric else []

    def number(self, content: Any) -> Any:
        """What a number with a unit is in podusv's, where the key takes it; else the content."""
        if not (isinstance(content, str) and self._numeric):
            return content
        made = units.number(content, self.unit)
        return content if made is None else made

    def advice(self, text: str) -> str:
        """How to write a text that the key does not take, if it shows what was meant."""
        return hint(text, self.types) or (units.misfit(text, self.unit) if self._numeric else "")

    @cached_property
    def item_keys(self) -> list[Key]:
        """The keys that all items of a list, or all entries of a mapping, have in common."""
        items = [self.item(step) for step in (NAME, NUMBER)]
        return [key for item in items if item and item.section for key in item.keys.values()]

    def follow(self, steps: Route) -> list[Key]:
        """Where the steps lead; a kind may be left out, and then all that fit are found."""
        keys = [self]
        for step in steps:
            keys = [inner for key in keys for inner in key.inside(step)]
        return keys

    def inside(self, step: str | int) -> list[Key]:
        """The kind, the item, or the keys (of several kinds) that a step leads to."""
        inner = (self, *self.kinds.values())
        led_to = [key._within(str(step)) or key.item(step) for key in inner]
        return [key for key in led_to if key]

    def all(self) -> Iterator[Key]:
        """Every key and kind below this one, sections before what is in them."""
        for key in (*self.keys.values(), *self.item_keys):
            yield key
            yield from key.all()


def _scalars(annotation: Any) -> Iterator[Any]:
    """The types of single values in a type `annotation`; those within tuples one by one."""
    for member in members(annotation):
        if get_origin(member) is tuple:
            yield from (scalar for part in get_args(member) for scalar in _scalars(part))
        else:
            yield member


@cache
def members(annotation: Any) -> tuple[Any, ...]:
    """The members of a union; of any other type, itself."""
    if get_origin(annotation) is Annotated:
        return members(get_args(annotation)[0])
    if get_origin(annotation) in (Union, types.UnionType):
        return tuple(member for part in get_args(annotation) for member in members(part))
    return (annotation,)


def limits(field: FieldInfo | None) -> dict[str, Any]:
    """The field's limits by pydantic's names: gt, ge, lt, le, pattern."""
    names, metadata = (*BOUNDS, "pattern"), [*_metadata(field)] if field else ()
    declared = ((name, getattr(data, name, None)) for data in metadata for name in names)
    return {name: limit for name, limit in declared if limit is not None}


def _metadata(field: FieldInfo) -> Iterator[Any]:
    """The constraints of a field, also of a number that the field may be beside a word."""
    yield from field.metadata
    for member in get_args(field.annotation):
        if get_origin(member) is Annotated:
            yield from (
                limit for info in member.__metadata__ for limit in getattr(info, "metadata", ())
            )


@cache
def sections(annotation: Any) -> dict[str, type[Component]]:
    """The component classes that a value may be of, by kind; "" is a class without kinds."""
    return {_kind(member): member for member in members(annotation) if _is_component(member)}


def _is_component(annotation: Any) -> TypeGuard[type[Component]]:
    return isinstance(annotation, type) and issubclass(annotation, Component)


def _kind(model: type[Component]) -> str:
    return str(model.model_fields["kind"].default) if "kind" in model.model_fields else ""


def either(words: tuple[str, ...] | list[str]) -> str:
    """`a, b or c`."""
    return " or ".join(part for part in (", ".join(words[:-1]), words[-1]) if part)


def noun(annotation: Any, *, plural: bool = False) -> str:
    """What a value of this type is, in words: `a list of 3 numbers`."""
    parts = sections(annotation)
    others = [
        "a list of these" if parts and _is_list_of(parts, member) else _one(member, plural)
        for member in members(annotation)
        if not _is_component(member)
    ]
    return either([*([_mapping(parts, plural)] if parts else []), *others])


def _is_list_of(parts: dict[str, type[Component]], annotation: Any) -> bool:
    """Whether this is a list of the components that a value may also be itself."""
    return get_origin(annotation) is tuple and sections(get_args(annotation)[0]) == parts


def _mapping(parts: dict[str, type[Component]], plural: bool) -> str:
    """How a mapping is described: with its kinds by name, or with the first of its keys.

    `parts` are its classes by kind, "" for one without kinds; `plural` for several mappings.
    """
    mapping = "mappings of keys" if plural else "a mapping of keys"
    if "" not in parts:
        return f"{mapping} with kind {either(list(parts))}"
    names = list(parts[""].model_fields)
    return f"{mapping}: " + ", ".join(names[:SHOWN_KEYS] + ["..."] * (len(names) > SHOWN_KEYS))


def _one(annotation: Any, plural: bool) -> str:
    """How one member of a union is described to a user: `a list of 2 numbers`."""
    parts = get_args(annotation)
    if get_origin(annotation) is Literal:
        return either([str(word) for word in parts])
    if get_origin(annotation) is tuple:
        count = "" if parts[-1] is Ellipsis else f"{len(parts)} "
        return f"{'lists' if plural else 'a list'} of {count}{noun(parts[0], plural=True)}"
    if get_origin(annotation) is dict:
        return f"a mapping of names to {noun(parts[1], plural=True)}"
    return NOUNS[annotation][plural]


@cache
def keys_of(scenario: type[Scenario]) -> Key:
    """The keys of a scenario of this class."""
    return Key((), scenario, model=scenario, scenario=scenario)


SCENARIO = keys_of(Scenario)
