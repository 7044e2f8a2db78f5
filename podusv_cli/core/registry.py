"""The one registry: whatever a package offers is found by being in one of its modules.

Laws, paths, disturbances and actuators are classes with a `kind`; metrics, figures and findings are
objects with a `name`. A new one is a new file in its package and nothing else. Those of plug-ins
are found where the plug-ins are passed on.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterator
from functools import cache, reduce
from importlib import import_module
from operator import or_
from pathlib import Path
from pkgutil import iter_modules
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin

from pydantic import Field

from podusv_cli.core.component import Component
from podusv_cli.core.errors import LawError, in_a_line
from podusv_cli.core.plugins import MODULES, Plugins
from podusv_cli.core.signal import Signal

Kind = TypeVar("Kind", bound=Component)
Named = TypeVar("Named")


def kinds(package: str, base: type[Kind], plugins: Plugins = ()) -> dict[str, type[Kind]]:
    """Every component class of `package` and the plug-ins that derives from `base`, by its `kind`.

    Sorted by kind, so that schemas and pages do not depend on the order of files. Raises LawError
    for a module that cannot be imported and for a kind that is not unique.
    """
    by_kind: dict[str, type[Kind]] = {}
    for thing in _members(package, plugins):
        if isinstance(thing, type) and issubclass(thing, base) and "kind" in thing.model_fields:
            kind = _kind(thing)
            # A class is met again in every module that imports it, which is no clash
            if by_kind.setdefault(kind, thing) is not thing:
                raise LawError(
                    f"{_place(thing)}: its kind {kind} is that of "
                    f"{_place(by_kind[kind]).removesuffix('.' + by_kind[kind].__name__)}, too; "
                    "take another name"
                )
    return dict(sorted(by_kind.items()))


def _kind(component: type[Component]) -> str:
    """The first word of `kind`; further ones are earlier names, which a validator translates.

    Raises LawError for a class whose `kind` is no fixed word.
    """
    field = component.model_fields["kind"]
    words = get_args(field.annotation) if get_origin(field.annotation) is Literal else ()
    if not words or words[0] != field.default:
        raise LawError(
            f'{_place(component)}: its kind is no fixed word; write kind: Literal["mine"] = "mine"'
        )
    return str(field.default)


def _place(component: type[Component]) -> str:
    """Where a class is: its module and name, or `my_law.py, line 12, class Mine`."""
    module = component.__module__
    if not module.startswith(f"{MODULES}."):
        return f"{module}.{component.__name__}"
    file = Path(str(sys.modules[module].__file__))
    line = inspect.getsourcelines(component)[1]
    return f"{file.name}, line {line}, class {component.__name__}"


def any_of(package: str, base: type[Kind], plugins: Plugins = ()) -> Any:
    """The type of a scenario's field that takes any component of `package`, chosen by `kind`."""
    choices = tuple(kinds(package, base, plugins).values())
    # The members are known at run time only.
    return Annotated[reduce(or_, choices), Field(discriminator="kind")]


def find_by_name(package: str, kind: type[Named], plugins: Plugins = ()) -> dict[str, Named]:
    """Every object of class `kind` in the modules of `package` and in the plug-ins, by its `name`.

    Modules come in alphabetical order, objects in the order of their definition. Raises LawError
    for two objects of one name.
    """
    by_name: dict[str, tuple[str, Named]] = {}
    for origin, thing in _places_of_objects(package, plugins):
        if isinstance(thing, kind):
            name = thing.name  # type: ignore[attr-defined]
            first, other = by_name.setdefault(name, (origin, thing))
            if other is not thing:
                raise LawError(f"{origin}: {first} has the name {name!r} already; take another")
    return {name: thing for name, (_, thing) in by_name.items()}


def signals(*packages: str, plugins: Plugins = ()) -> list[Signal]:
    """Every signal that is a constant of these modules or in the `signals` of a class.

    One that several modules have comes once; a name may come with several meanings.
    """
    declared = (
        part
        for package in packages
        for thing in _members(package, plugins)
        for part in _signals(thing)
    )
    return list(dict.fromkeys(declared))


def _signals(thing: Any) -> Iterator[Signal]:
    """The signals in a thing: itself, its `signal`, those of its class, tuple or dict."""
    inside = getattr(thing, "signal", None)
    if isinstance(thing, Signal):
        yield thing
    elif isinstance(inside, Signal):
        yield inside
    elif isinstance(thing, type):
        # Its own alone: those that it inherits come with the class that declares them
        yield from _signals(vars(thing).get("signals"))
    elif isinstance(thing, (tuple, dict)):
        parts = thing.values() if isinstance(thing, dict) else thing
        yield from (signal for part in parts for signal in _signals(part))


def _members(package: str, plugins: Plugins) -> Iterator[Any]:
    """Everything in the modules of a package and in the plug-ins."""
    yield from (thing for _, thing in _places_of_objects(package, plugins))


def _places_of_objects(package: str, plugins: Plugins) -> Iterator[tuple[str, Any]]:
    """Everything in the modules of a package and in the plug-ins, and which of them it is in."""
    yield from scan_package(package)
    for plugin in plugins:
        yield from ((str(plugin), thing) for thing in plugin.members(package.rpartition(".")[2]))


@cache
def scan_package(package: str) -> tuple[tuple[str, Any], ...]:
    """What podusv's own modules of a package define: names of modules, with each thing in them.

    Looked up once. Things that a module imports are among them.
    """
    return tuple(
        (module.name, thing)
        for module in iter_modules(import_module(package).__path__, f"{package}.")
        for name, thing in vars(_import_module(module.name)).items()
        if not name.startswith("__")
    )


def _import_module(module: str) -> Any:
    """The module of this name. Raises LawError where it cannot be imported."""
    try:
        return import_module(module)
    except SyntaxError as error:  # which names its place
        raise LawError(f"{module} cannot be imported: {type(error).__name__}: {error}") from error
    except Exception as error:
        raise LawError(f"{module} cannot be imported: {in_a_line(error)}") from error
