"""`podusv validate`: check a scenario, estimate its run, show where its values come from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from podusv_cli.cli.options import AllowLarge, Assignments, Config, Plugins, Trust
from podusv_cli.cli.terminal import echo


def validate(
    config: Config,
    assign: Assignments = None,
    verbose: Annotated[
        bool,
        typer.Option(
            "--verbose",
            "-v",
            help="Show the rank argument, the proof's gain conditions, every value and its origin.",
        ),
    ] = False,
    allow_large: AllowLarge = False,
    trust: Trust = False,
    plugin: Plugins = None,
) -> None:
    """Check a scenario as a run does before its first step; if all is valid, print findings.

    Exit code 0, with a line for each finding; 2 with a line for each fault; or 5 for a study that
    fits neither on the disk nor into memory.
    """
    from podusv_cli.workflows import validate as workflow  # heavy imports only when needed
    from podusv_cli.workflows.request import Request

    request = Request(
        assign or (), allow_large=allow_large, plugins=plugin or (), trust=trust, warn=echo
    )
    done = workflow.validate(Path(config), request)
    first, *others = done.lines()
    echo(f"{config}: {first}", *others, *(done.explain_lines() if verbose else ()))
