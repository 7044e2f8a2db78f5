"""The one registry: whatever a package offers is found by being in one of its modules.

Laws, paths, disturbances and actuators are classes with a `kind`; metrics, figures and findings are
objects with a `name`. A new one is a new file in its package and nothing else.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pkgutil import iter_modules
from typing import Annotated, Any, Literal, TypeVar, Union, get_origin

from pydantic import Field

from podusv_cli.core.component import Component
from podusv_cli.core.errors import LawError, in_a_line
from podusv_cli.core.signal import Signal

Kind = TypeVar("Kind", bound=Component)
Named = TypeVar("Named")


def kinds(package: str, base: type[Kind]) -> dict[str, type[Kind]]:
    """Every component class of `package` that derives from `base`, by its `kind`, sorted.

    Raises LawError for a module that cannot be imported and for a kind that is not unique.
    """
    found: dict[str, type[Kind]] = {}
    for thing in _members(package):
        if isinstance(thing, type) and issubclass(thing, base) and "kind" in thing.model_fields:
            kind = _kind(thing)
            if found.setdefault(kind, thing) is not thing:
                raise LawError(
                    f"{thing.__module__}.{thing.__name__}: its kind {kind} is that of "
                    f"{found[kind].__module__}, too; take another name"
                )
    return dict(sorted(found.items()))


def _kind(component: type[Component]) -> str:
    field = component.model_fields["kind"]
    if get_origin(field.annotation) is not Literal:
        raise LawError(
            f"{component.__module__}.{component.__name__}: its kind is no fixed word; write "
            'kind: Literal["mine"] = "mine"'
        )
    return str(field.default)


def any_of(package: str, base: type[Kind]) -> Any:
    """The type of a scenario's field that takes any component of `package`, chosen by `kind`."""
    choices = tuple(kinds(package, base).values())
    union = Union.__getitem__(choices)  # the members are known at run time only
    return Annotated[union, Field(discriminator="kind")]


def named(package: str, kind: type[Named]) -> dict[str, Named]:
    """Every object of class `kind` in the modules of `package`, by its `name`.

    Modules come in alphabetical order, objects in the order of their definition. Raises LawError
    for two objects of one name.
    """
    found: dict[str, Named] = {}
    for thing in _members(package):
        if isinstance(thing, kind):
            name = thing.name  # type: ignore[attr-defined]
            if found.setdefault(name, thing) is not thing:
                raise LawError(f"{package} has two of the name {name!r}; take another name")
    return found


def signals(*packages: str) -> list[Signal]:
    """Every signal that is a constant of these packages' modules or in the `signals` of a class.

    One that several modules have comes once; a name may come with several meanings.
    """
    found = (
        part for package in packages for thing in _members(package) for part in _signals(thing)
    )
    return list(dict.fromkeys(found))


def _signals(thing: Any) -> Iterator[Signal]:
    inside = getattr(thing, "signal", None)
    if isinstance(thing, Signal):
        yield thing
    elif isinstance(inside, Signal):
        yield inside
    elif isinstance(thing, type):
        yield from _signals(vars(thing).get("signals"))
    elif isinstance(thing, (tuple, dict)):
        parts = thing.values() if isinstance(thing, dict) else thing
        yield from (signal for part in parts for signal in _signals(part))


def _members(package: str) -> Iterator[Any]:
    for module in iter_modules(import_module(package).__path__, f"{package}."):
        members = vars(_imported(module.name)).items()
        yield from (thing for name, thing in members if not name.startswith("__"))


def _imported(module: str) -> Any:
    try:
        return import_module(module)
    except SyntaxError as error:  # which names its place
        raise LawError(f"{module} cannot be imported: {type(error).__name__}: {error}") from error
    except Exception as error:
        raise LawError(f"{module} cannot be imported: {in_a_line(error)}") from error
