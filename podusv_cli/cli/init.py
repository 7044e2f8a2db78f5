"""`podusv init`: a scenario or example to start from."""

from __future__ import annotations

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
        Path | None,
        typer.Option(help="File or folder to write.", show_default="named as it is, here"),
    ] = None,
) -> None:
    """List what comes with podusv to start from, or copy a scenario or example here to edit.

    A scenario's copy extends the same scenarios of podusv. Beside it is the JSON schema, from which
    editors complete and check keys. An example is a notebook, or a folder with a README. Files that
    exist are not replaced.
    """
    from podusv_cli.workflows import init as workflow  # heavy imports only when needed
    from podusv_cli.workflows.examples import examples

    if name is None:
        first = ", ".join(f"{point} ({shown})" for point, shown in workflow.FIRST.items())
        echo(f"to begin with: {first}")
        for point, description in (workflow.starting_points() | examples()).items():
            echo_entry(point, description)
        echo("copy one to edit: podusv init NAME")
        return
    begun = workflow.init(name, out)
    echo(f"wrote {begun.first}" + (f", and {begun.schema} for editors" if begun.schema else ""))
    for other in begun.others:
        echo(f"wrote {other}")
    echo(f"next: {begun.next}")
