"""The command line: one file a command; it parses, prints and sets exit codes.

Commands import what they need when they run, so that help and mistyped options answer at once.
"""

from __future__ import annotations

import gc
import os
import sys
from importlib import import_module
from typing import Annotated, Any

import typer

from podusv_cli import __version__
from podusv_cli.cli.exit_codes import (
    flush_streams,
    replace_closed_streams,
    report_error,
    with_exit_codes,
)
from podusv_cli.cli.installed_commands import installed_commands, load_command

# What `--help` lists below each heading. NAME is the function NAME of cli/NAME.py.
GROUPS = {
    "First steps": ("demo", "init", "live", "docs", "explain", "list"),
    "One run": (
        "run",
        "validate",
        "plot",
        "verify",
        "margins",
        "capability",
        "optimum",
        "rerun",
        "diff",
        "runs",
    ),
    "Many runs": ("compare", "sweep", "tune", "bench"),
    "Papers and laws of your own": ("doubt", "new", "schema"),
    "Boats": ("start", "identify"),
    "Export": ("export", "pack", "unpack"),
}
SEVERAL = "sweep"  # a command with commands of its own
COMMANDS = tuple(name for names in GROUPS.values() for name in names if name != SEVERAL)
OTHERS = "Of installed packages"
LONGEST = 160  # characters of a command's first sentence in the list

# What others call it, and the command that does it.
MEANT = {
    "simulate": "podusv run CONFIG simulates a scenario",
    "help": "podusv docs [PAGE] shows the pages, and podusv --help all commands",
    "replay": "podusv rerun RUN repeats a finished run, and podusv compare RUN plays it on a page",
    "fit": "podusv identify CONFIG fits a hull to logs, and podusv tune CONFIG searches gains",
}
FIRST_STEPS = """\
podusv simulates and compares controllers for pod-propelled surface vessels. First steps:

  podusv demo                              see what it does: three laws, a chase, a page
  podusv start mine                        a scenario for your boat, from length, mass and thrust
  podusv init mu_2017/corrected            copy a scenario here, to edit; podusv init lists them
  podusv run corrected.yaml                simulate it: log, metrics and figures in results/
  podusv compare podusv:pod/kept.yaml      simulate and compare four laws: table and report
  podusv sweep --help                      judge laws by thousands of drawn hulls, seas, starts
  podusv docs                              the pages of podusv; podusv --help: all commands"""
OBJECTS_BETWEEN_COLLECTIONS = 500_000  # more than all imports make; see `main`


class Commands(typer.core.TyperGroup):
    """podusv's commands, those of installed packages, and what others are called here."""

    def list_commands(self, ctx: Any) -> list[str]:
        """The names of all commands; podusv's own first."""
        own = super().list_commands(ctx)
        return [*own, *(name for name in installed_commands() if name not in own)]

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands below their headings, those of installed packages last."""
        named = {name for names in GROUPS.values() for name in names}
        others = tuple(name for name in self.list_commands(ctx) if name not in named)
        for heading, names in (*GROUPS.items(), (OTHERS, others)):
            found = {name: self.get_command(ctx, name) for name in names}
            rows = [
                (name, command.get_short_help_str(LONGEST))
                for name, command in found.items()
                if command
            ]
            if rows:
                with formatter.section(heading):
                    formatter.write_dl(rows, col_max=10)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """The command of this name; one that podusv has is never that of a package."""
        own = super().get_command(ctx, cmd_name)
        return own or (load_command(cmd_name) if cmd_name in installed_commands() else None)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that the first word names; an error for an unknown one."""
        if args and args[0] in MEANT and args[0] not in installed_commands():
            ctx.fail(f"No such command {args[0]!r}: {MEANT[args[0]]}.")
        return super().resolve_command(ctx, args)


app = typer.Typer(
    name="podusv",
    cls=Commands,
    invoke_without_command=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
# Building a command's options takes 1 ms; a command that comes first needs no other's.
NAMED = [name for name in COMMANDS if sys.argv[1:2] == [name]]
for _name in NAMED or COMMANDS:
    app.command(_name)(with_exit_codes(getattr(import_module(f"podusv_cli.cli.{_name}"), _name)))
if not NAMED:
    from podusv_cli.cli.sweep import sweep

    app.add_typer(sweep, name=SEVERAL)


def _show_version(wanted: bool) -> None:
    """Print the version and end the command, where `--version` was given."""
    if wanted:
        typer.echo(f"podusv {__version__}")
        raise typer.Exit


@app.callback()
def podusv(
    context: typer.Context,
    version: Annotated[
        bool,
        typer.Option(
            "--version", help="Show the version and exit.", callback=_show_version, is_eager=True
        ),
    ] = False,
) -> None:
    """Experiments with controllers for pod-propelled surface vessels."""
    if context.invoked_subcommand is None:
        typer.echo(FIRST_STEPS)


def main() -> None:
    """Run the command line and leave with its exit code."""
    # A collection goes through all imported objects, a tenth of the time of a run or comparison,
    # and finds next to nothing.
    gc.set_threshold(OBJECTS_BETWEEN_COLLECTIONS)
    # pydantic would look through every installed package for plugins.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    # Threads in linear algebra would make the last bits of a sum depend on the number of cores,
    # and starting them takes a tenth of a run. All matrices here are small.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Figures are files. A notebook names a backend of its own to what it starts, which matplotlib
    # refuses where that module is not installed.
    os.environ["MPLBACKEND"] = "agg"
    replace_closed_streams()
    for stream in (sys.stdout, sys.stderr):
        # Characters that the terminal's encoding lacks are escaped.
        getattr(stream, "reconfigure", lambda errors: None)(errors="backslashreplace")
    try:
        app()
    except SystemExit as end:
        code = end.code
    except OSError as error:  # of help, which is printed outside of any command
        code = report_error(error)
    gc.freeze()  # skips the last collection of garbage
    sys.exit(flush_streams(code))
