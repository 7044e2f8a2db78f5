"""Components: frozen values whose fields are the YAML keys."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Literal,
    NamedTuple,
    Self,
    cast,
    get_args,
    get_origin,
)

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo

from podusv_cli.core.errors import SizingError
from podusv_cli.core.kernel import Vector


class Presets(NamedTuple):
    """Files of values that a component's `preset` names: YAML files in a package."""

    package: str
    noun: str  # what one of them holds
    file: str  # what messages call one


BY_RULE = "from hull, actuator and loop"  # the origin of a number in place of null
DIGITS = 3  # of a number that a rule gives, so that a scenario shows all of them


class Rule(NamedTuple):
    """How a default follows from hull, actuator and loop; see `components.rules`."""

    words: str  # with {:g} for the model ship's number
    of: Callable[[Any, float], float]  # from `components.facts` and the model ship's number
    exact: bool = False  # another key's number, not rounded to DIGITS


# From the text of another program's file, and the fields that are given beside it, to values by
# field, and remarks; raises ValueError.
ValuesOf = Callable[[str, Collection[str]], tuple[dict[str, Any], list[str]]]


class Component(BaseModel):
    """A part of a scenario. Fields carry unit, range, default and meaning (see `value`).

    `presets` are what its field `preset` chooses from. `rows_of` has the fields that may name a
    CSV file of pairs, each with the field that takes the file's rows, `texts_of` those that may
    name a file whose text another field takes, `bytes_of` those that may name a file whose bytes
    another field takes, as base64, `folders_of` those that may name a finished folder, with the
    field that takes a text of it and that text's name, `values_of` those that may name a file of
    another program, with the function that makes values of its text, and remarks. One that
    `stands_alone` takes no value of another kind whose place it takes. `noun` is what messages call
    it. `rules` has the fields that may be null, and in a scenario are by default, with the rule
    that gives the number; the field's own default is the model ship's.
    """

    presets: ClassVar[Presets | None] = None
    rows_of: ClassVar[dict[str, str]] = {}
    texts_of: ClassVar[dict[str, str]] = {}
    bytes_of: ClassVar[dict[str, str]] = {}
    folders_of: ClassVar[dict[str, tuple[str, str]]] = {}
    values_of: ClassVar[dict[str, ValuesOf]] = {}
    rules: ClassVar[dict[str, Rule]] = {}
    stands_alone: ClassVar[bool] = False
    noun: ClassVar[str] = "component"
    # Strict: true is no 1.0 and "1.5" no number. Without limits a field would take NaN
    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)

    @property
    def label(self) -> str:
        """The word that stands for it as `kind` in a scenario."""
        return str(type(self).model_fields["kind"].default)

    @property
    def by_rule(self) -> tuple[str, ...]:
        """The fields that have a rule and no number of the scenario's own."""
        given = self.model_fields_set
        return tuple(n for n in self.rules if n not in given or getattr(self, n) is None)

    def sized(self, facts: Any) -> Self:
        """With the numbers of its rules, for these facts; `by_rule` stays as it is.

        Raises SizingError where a rule gives no number above 0.
        """
        new = {name: self.by_default(name, facts) for name in self.by_rule}
        return self._with(new, self.model_fields_set - new.keys()) if new else self

    def by_default(self, name: str, facts: Any) -> float:
        """The number of the rule for the field `name`, rounded to DIGITS unless it is exact.

        `facts` are `components.facts.Facts`. Raises SizingError where there is none above 0.
        """
        rule = self.rules[name]
        try:
            number = rule.of(facts, type(self).model_fields[name].default)
        # A hull or an actuator may leave a rule without a number, which is said below
        except (ArithmeticError, ValueError):
            number = math.nan
        # So written it is true of NaN, too
        if not 0.0 < number < math.inf:
            what = f"{self.noun} {self.label}"
            raise SizingError(
                f"{name} of {what} does not follow from hull and actuator ({facts.in_words()}); "
                "give it a number, or check vessel and actuator"
            )
        return number if rule.exact else float(f"{number:.{DIGITS}g}")

    def changed(self, new: Mapping[str, Any]) -> Self:
        """With other values, checked. Raises ValidationError."""
        checked = type(self).model_validate({**vars(self), **new})
        return checked._with({}, self.model_fields_set | new.keys()) if self.rules else checked

    def _with(self, new: Mapping[str, Any], given: set[str]) -> Self:
        """A copy with new fields, not checked again; `given` are those that the user wrote."""
        made: Any = type(self).model_construct(given, **(dict(self) | dict(new)))
        return cast("Self", made)

    def constants(self) -> dict[str, float]:
        """The component's numbers by name, as its kernels read them from `k`.

        A choice of words becomes its index among the choices, an absent number becomes NaN, and a
        nested component's names get its field's name in front.
        """
        numbers: dict[str, float] = {}
        own = vars(self)
        for name, choices, may_be_absent in _fields(type(self)):
            content = own[name]
            if isinstance(content, (float, int)):
                numbers[name] = float(content)
            elif isinstance(content, Component):
                for inner, number in content.constants().items():
                    numbers[f"{name}_{inner}"] = number
            elif choices and name != "kind":
                numbers[name] = float(choices.index(content))
            elif may_be_absent:
                numbers[name] = math.nan
        return numbers

    def choices(self) -> frozenset[str]:
        """Names of those constants that are choices or whole numbers."""
        return frozenset(_choices(self))


class KernelPart(Component):
    """A component with kernels, which also read a `table` of numbers beside the constants."""

    def table(self) -> Vector:
        """Numbers whose count depends on the scenario (nodes, waypoints); one zero where none."""
        return np.zeros(1)


class _Field(NamedTuple):
    """What `constants` has to know of a field: its choices of words; whether it may be absent."""

    name: str
    choices: tuple[Any, ...]
    may_be_absent: bool


@cache
def _fields(kind: type[Component]) -> tuple[_Field, ...]:
    """The fields of a kind of component, looked up once: a run asks for constants many times."""
    return tuple(
        _Field(
            name,
            get_args(field.annotation) if get_origin(field.annotation) is Literal else (),
            bool({float, Positive} & set(get_args(field.annotation))),
        )
        for name, field in kind.model_fields.items()
    )


def _choices(component: Component) -> Iterator[str]:
    """Names of the fields that select and count; those of a part after its own name.

    As `constants` names them; True and False are numbers of Python as well.
    """
    for name, field in type(component).model_fields.items():
        content = getattr(component, name)
        if isinstance(content, Component):
            yield from (f"{name}_{inner}" for inner in content.choices())
        elif isinstance(content, (bool, int)) or get_origin(field.annotation) is Literal:
            yield name


def value(default: Any, unit: str, meaning: str, **limits: Any) -> Any:
    """A field with its unit ("" for a pure number or a choice), meaning and limits.

    `default` is `...` where the scenario must give the value. Limits are pydantic's gt, ge, lt, le.
    """
    return Field(default, description=meaning, json_schema_extra={"unit": unit}, **limits)


OF_SECTION = "unit of the section"  # stands for the unit of the field that holds the component


def unit_of(field: FieldInfo, of_section: str = OF_SECTION) -> str:
    """The unit that `value` attached to a field, "" where there is none.

    `of_section` is the unit of the field that holds the component.
    """
    extra = field.json_schema_extra
    own = str(extra.get("unit", "")) if isinstance(extra, dict) else ""
    return of_section if own == OF_SECTION else own


Positive = Annotated[float, Field(gt=0)]
if TYPE_CHECKING:
    Ruled = float  # a number once its component is `sized`
else:
    Ruled = float | None  # a number, or null for that of its rule


def wrong_default(owner: Component) -> str:
    """What is wrong with a default that its own field does not allow; else empty.

    pydantic checks given values only, so all values of `owner` are given once more.
    """
    try:
        type(owner)(**dict(owner))
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join(map(str, first["loc"]))
        return f"its default {name} = {first['input']!r}: {first['msg']}"
    return ""


def describe(owner: Component) -> str:
    """`law mine (mine.py, line 12)`: a component's kind, and where its class is written."""
    place = ""
    with suppress(OSError, TypeError):  # made where there is no source
        name = Path(inspect.getsourcefile(type(owner)) or "").name
        place = f" ({name}, line {inspect.getsourcelines(type(owner))[1]})"
    return f"{owner.noun} {owner.label}{place}"
