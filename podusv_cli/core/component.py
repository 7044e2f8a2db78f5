"""Components: frozen values whose fields are the YAML keys, found by being in their folder."""

from __future__ import annotations

import math
from collections.abc import Iterator
from importlib import import_module
from pkgutil import iter_modules
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from pydantic.fields import FieldInfo

from podusv_cli.core.errors import LawError, in_a_line
from podusv_cli.core.kernel import Vector


class Component(BaseModel):
    """A part of a scenario. Fields carry unit, range, default and meaning (see `value`)."""

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)

    def constants(self) -> dict[str, float]:
        """The component's numbers by name, as its kernels read them from `k`.

        A choice of words becomes its index among the choices, an absent number becomes NaN, and a
        nested component's names get its field's name in front.
        """
        return dict(_numbers(self))

    def table(self) -> Vector:
        """Numbers whose count depends on the scenario (nodes, waypoints); one zero where none."""
        return np.zeros(1)


def _numbers(component: Component) -> Iterator[tuple[str, float]]:
    for name, field in type(component).model_fields.items():
        content = getattr(component, name)
        if isinstance(content, Component):
            yield from (
                (f"{name}_{inner}", number) for inner, number in content.constants().items()
            )
        elif isinstance(content, (bool, int, float)):
            yield name, float(content)
        elif get_origin(field.annotation) is Literal and name != "kind":
            yield name, float(get_args(field.annotation).index(content))
        elif {float, Positive} & set(get_args(field.annotation)):
            yield name, math.nan


def value(default: Any, unit: str, meaning: str, **limits: Any) -> Any:
    """A field with its unit ("" for a pure number or a choice), meaning and limits.

    `default` is `...` where the scenario must give the value. Limits are pydantic's gt, ge, lt, le.
    """
    return Field(default, description=meaning, json_schema_extra={"unit": unit}, **limits)


def unit_of(field: FieldInfo) -> str:
    """The unit that `value` attached to a field, "" where there is none."""
    extra = field.json_schema_extra
    return str(extra.get("unit", "")) if isinstance(extra, dict) else ""


Positive = Annotated[float, Field(gt=0)]

Kind = TypeVar("Kind", bound=Component)


def catalogue(package: str, base: type[Kind]) -> dict[str, type[Kind]]:
    """Every component of `package` that derives from `base`, by its `kind`, sorted."""
    found: dict[str, type[Kind]] = {}
    for module in iter_modules(import_module(package).__path__, f"{package}."):
        for thing in vars(_imported(module.name)).values():
            if isinstance(thing, type) and issubclass(thing, base) and "kind" in thing.model_fields:
                kind = _kind(thing)
                if found.setdefault(kind, thing) is not thing:
                    raise LawError(
                        f"{thing.__module__}.{thing.__name__}: its kind {kind} is that of "
                        f"{found[kind].__module__}, too; take another name"
                    )
    return dict(sorted(found.items()))


def _imported(module: str) -> Any:
    try:
        return import_module(module)
    except SyntaxError as error:  # which names its place
        raise LawError(f"{module} cannot be imported: {type(error).__name__}: {error}") from error
    except Exception as error:
        raise LawError(f"{module} cannot be imported: {in_a_line(error)}") from error


def _kind(component: type[Component]) -> str:
    field = component.model_fields["kind"]
    if get_origin(field.annotation) is not Literal:
        raise LawError(
            f"{component.__module__}.{component.__name__}: its kind is no fixed word; write "
            'kind: Literal["mine"] = "mine"'
        )
    return str(field.default)


def any_of(package: str, base: type[Kind]) -> Any:
    """The type of a field that takes any component of `package`, told apart by `kind`."""
    choices = tuple(catalogue(package, base).values())
    union = Union.__getitem__(choices)  # a union whose members are known at run time only
    return Annotated[union, Field(discriminator="kind")]
