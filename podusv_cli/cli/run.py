"""`podusv run`: simulate one scenario."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from podusv_cli.workflows import Finished

EXIT_CODES = {"finished": 0, "diverged": 4, "interrupted": 130}


def run(
    config: Annotated[Path, typer.Argument(help="The scenario, a YAML file.", show_default=False)],
    assign: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY=VALUE", help="Replace a value of the scenario; repeatable."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Run folder; by default results/<name>/<time>-<digest>.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a finished run folder.")] = False,
    figures: Annotated[bool, typer.Option(help="Draw the run.")] = True,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="Print the run folder only.")
    ] = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print timing as well.")] = False,
) -> None:
    """Simulate a scenario and write a run folder: log, metrics, figures."""
    from podusv_cli import workflows  # heavy imports only when they are needed
    from podusv_cli.cli.progress import progress_bar

    request = workflows.Request(
        config, tuple(assign or ()), out, force=force, figures=figures, argv=tuple(sys.argv)
    )
    with progress_bar(str(config), wanted=not (quiet or as_json)) as progress:
        done = workflows.run(request, progress)
    if as_json:
        typer.echo(json.dumps(_finite(workflows.as_json(done)), indent=2, ensure_ascii=False))
    elif quiet:
        typer.echo(done.folder)
    else:
        _report(done, verbose)
    if done.recording.message:
        typer.echo(f"{config}: {done.recording.message}", err=True)
    raise typer.Exit(EXIT_CODES[done.recording.status])


def _report(done: Finished, verbose: bool) -> None:
    from podusv_cli.metrics.table import METRICS

    for name, metric in METRICS.items():
        if name in done.metrics:
            number = done.metrics[name]
            shown = "never" if name == "settling_time" and math.isnan(number) else f"{number:.6g}"
            typer.echo(f"{name:<18} {shown:>12} {metric.unit if shown != 'never' else ''}".rstrip())
    if verbose:
        for name, seconds in done.timing.items():
            typer.echo(f"{name:<18} {seconds:>12.4f} s")
    typer.echo(f"{done.recording.controller} {done.recording.status}: {done.folder}")


def _finite(content: object) -> object:
    """The same with null for what JSON has no number for."""
    if isinstance(content, dict):
        return {key: _finite(value) for key, value in content.items()}
    return None if isinstance(content, float) and not math.isfinite(content) else content
