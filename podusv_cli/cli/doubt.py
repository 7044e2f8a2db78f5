"""`podusv doubt`: what the verdicts on a scenario's claims hang on."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from podusv_cli.cli import options
from podusv_cli.cli.exit_codes import INTERRUPTED
from podusv_cli.cli.terminal import Warnings, echo, echo_table, show

if TYPE_CHECKING:
    from podusv_cli.doubt.outputs import Doubted


def doubt(
    config: options.Config,
    assign: options.Assignments = None,
    out: options.Out = None,
    force: options.Force = False,
    figures: options.Figures = True,
    workers: options.Workers = 0,
    as_json: options.AsJson = False,
    allow_large: options.AllowLarge = False,
    quiet: options.Quiet = False,
    trust: options.Trust = False,
    plugin: options.Plugins = None,
) -> None:
    """Tell what would have to change for the verdicts on a scenario's claims to turn.

    Moves all that the claims' source does not print (`doubt.printed` says what it does), one value
    at a time and all at once, and judges the claims anew.
    """
    from podusv_cli.cli.progress import compiling, progress_bars
    from podusv_cli.workflows import doubt as workflow  # heavy imports only when needed
    from podusv_cli.workflows.request import Request

    warned = Warnings(quiet)
    with progress_bars(wanted=not (quiet or as_json)) as bars:
        request = Request(
            assign or (),
            out,
            force=force,
            figures=figures,
            argv=sys.argv,
            plugins=plugin or (),
            trust=trust,
            allow_large=allow_large,
            workers=workers,
            warn=warned,
            compiling=compiling(bars, wanted=not (quiet or as_json)),
        )
        done = workflow.doubt(Path(config), request, bars)
    show(done, lambda: _report(done), as_json=as_json, quiet=quiet)
    if done.status == "interrupted":
        echo("interrupted; the table is about what was tried so far", err=True)
        raise typer.Exit(INTERRUPTED)


def _report(done: Doubted) -> None:
    """Print a row for each claim, and where the report is."""
    from podusv_cli.doubt.outputs import HEAD, row

    echo_table(list(HEAD), [row(answer) for answer in done.answers])
    echo(f"report: {done.folder / 'report.html'}")
