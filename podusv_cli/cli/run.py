"""`podusv run`: simulate one scenario."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from podusv_cli.cli.options import (
    AllowLarge,
    AsJson,
    Assignments,
    Config,
    Figures,
    Force,
    Out,
    Quiet,
    Verbose,
)

if TYPE_CHECKING:
    from podusv_cli.running import Finished

TRACED = "missing.json in the folder has the traceback"
EXIT_CODES = {"finished": 0, "diverged": 4, "interrupted": 130}


def run(
    config: Config,
    assign: Assignments = None,
    out: Out = None,
    force: Force = False,
    figures: Figures = True,
    as_json: AsJson = False,
    allow_large: AllowLarge = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Simulate a scenario and write a run folder: log, metrics, figures.

    Draws trajectory, errors and controls; `podusv plot RUN` draws all that the run has signals for.
    """
    from podusv_cli import workflows  # heavy imports only when they are needed
    from podusv_cli.cli.layout import Warned
    from podusv_cli.cli.progress import progress_bar

    warned = Warned(quiet)
    request = workflows.Request(
        tuple(assign or ()), out, force, figures, tuple(sys.argv), warned, allow_large
    )
    with progress_bar(str(config), wanted=not (quiet or as_json)) as progress:
        done = workflows.run(Path(config), request, progress)
    if as_json:
        typer.echo(json.dumps(_finite(done.as_json()), indent=2, ensure_ascii=False))
    elif quiet:
        typer.echo(done.folder)
    else:
        _report(done, verbose)
    for finding in done.warnings:
        warned(finding)
    if done.message:
        typer.echo(f"{config}: {done.message}", err=True)
    for part in done.missing:
        typer.echo(f"{config}: {part}; {TRACED}", err=True)
    if done.others:
        names = ", ".join(done.others)
        typer.echo(f"{config}: ran `controller` only; `podusv compare` runs {names}", err=True)
    raise typer.Exit(EXIT_CODES[done.status])


def _report(done: Finished, verbose: bool) -> None:
    from podusv_cli.metrics.table import METRICS

    for name, metric in METRICS.items():
        if name in done.metrics and done.status == "finished":
            number = done.metrics[name]
            shown = "never" if name == "settling_time" and math.isnan(number) else f"{number:.6g}"
            typer.echo(f"{name:<18} {shown:>12} {metric.unit if shown != 'never' else ''}".rstrip())
    if verbose:
        for name, seconds in done.timing.items():
            typer.echo(f"{name:<18} {seconds:>12.4f} s")
    typer.echo(f"{done.controller} {done.status}: {done.folder}")


def _finite(content: object) -> object:
    """The same with null for what JSON has no number for."""
    if isinstance(content, dict):
        return {key: _finite(value) for key, value in content.items()}
    return None if isinstance(content, float) and not math.isfinite(content) else content
