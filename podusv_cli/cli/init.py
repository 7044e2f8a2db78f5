"""`podusv init`: a scenario to start from."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from podusv_cli.cli.completion import starting_points
from podusv_cli.cli.terminal import echo, echo_entry


def init(
    name: Annotated[
        str | None,
        typer.Argument(
            help="The starting point to copy; without it, all are listed.",
            show_default=False,
            autocompletion=starting_points,
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="File to write.", show_default="NAME.yaml in this folder")
    ] = None,
) -> None:
    """List the scenarios that come with podusv, or copy one of them here to edit.

    The copy extends the same scenarios of podusv. Beside it is the JSON schema, from which editors
    complete and check keys. Files that exist are not replaced.
    """
    from podusv_cli.workflows import init as workflow  # heavy imports only when needed

    if name is None:
        first = ", ".join(f"{point} ({shown})" for point, shown in workflow.FIRST.items())
        echo(f"to begin with: {first}")
        for point, description in workflow.starting_points().items():
            echo_entry(point, description)
        echo("copy one to edit: podusv init NAME")
        return
    begun = workflow.init(name, out)
    echo(f"wrote {begun.config}, and {begun.schema} for editors")
    for log in begun.logs:
        echo(f"wrote {log}")
    echo(f"next: {shlex.join(['podusv', *begun.command, str(begun.config)])}")
