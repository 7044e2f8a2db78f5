"""Commands of installed packages, by entry points of the group `podusv.commands`."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib.metadata import EntryPoint
from types import FunctionType
from typing import Any

import typer

from podusv_cli.cli.exit_codes import with_exit_codes
from podusv_cli.core.errors import LawError, in_a_line
from podusv_cli.core.plugins import installed_points

GROUP = "podusv.commands"


@cache
def installed_commands() -> dict[str, EntryPoint]:
    """The entry points of all installed packages, by the command's name; the first one counts."""
    points: dict[str, EntryPoint] = {}
    for _, found in installed_points(GROUP):
        for point in found:
            points.setdefault(point.name, point)
    return dict(sorted(points.items()))


def load_command(name: str) -> Any:
    """The command of this name, as typer makes it of the function that the entry point names.

    What is none is a command too, whose only act is to say why; so the others stay in the help.
    """
    point = installed_commands()[name]
    try:
        function = point.load()
        if not isinstance(function, FunctionType):
            raise TypeError(f"it is a {type(function).__name__}, and a command is a function")
        return _command_of(name, function)
    # A module that ends the process as it is imported must not end the help with it.
    except (Exception, SystemExit) as error:
        why = f"podusv {name}: {point.value} is no command: {in_a_line(error)}"
        return _command_of(name, _refusing(why), takes_anything=True)


def _command_of(name: str, function: Callable[..., None], *, takes_anything: bool = False) -> Any:
    """A function of an installed package as a command of click, with podusv's exit codes.

    `takes_anything` is for one that only refuses: its sentence must come before errors on options.
    """
    app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    settings = {"ignore_unknown_options": takes_anything, "allow_extra_args": takes_anything}
    package = getattr(installed_commands()[name].dist, "name", name)
    app.command(name, context_settings=settings)(with_exit_codes(function, package))
    return typer.main.get_command(app)


def _refusing(why: str) -> Callable[[], None]:
    """A command in place of one that cannot be loaded; it raises LawError with `why`."""

    def refuse() -> None:
        raise LawError(why)

    refuse.__doc__ = why
    return refuse
