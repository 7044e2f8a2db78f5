"""`podusv run`: simulate one scenario."""

from __future__ import annotations

import math
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from podusv_cli.cli import options
from podusv_cli.cli.terminal import Warnings, echo, echo_how_to_draw, echo_result

if TYPE_CHECKING:
    from podusv_cli.workflows.execute import Finished

# Widths of what a metric is called and of its number; the narrow ones are for terminals.
WHOLE, BRIEF = (46, 20), (38, 17)
EXIT_CODES = {"finished": 0, "diverged": 4, "interrupted": 130}


def run(
    config: options.Config,
    assign: options.Assignments = None,
    out: options.Out = None,
    force: options.Force = False,
    figures: options.Figures = True,
    figure: options.Figure = None,
    as_json: options.AsJson = False,
    allow_large: options.AllowLarge = False,
    quiet: options.Quiet = False,
    verbose: options.Verbose = False,
    trust: options.Trust = False,
    plugin: options.Plugins = None,
    controller: Annotated[
        str, typer.Option(metavar="NAME", help="Which of `controllers` to run.", show_default=False)
    ] = "",
) -> None:
    """Simulate a scenario and write a run folder: log, metrics, figures.

    Draws trajectory and errors; `--figure all` and `podusv plot RUN` draw every figure that it has
    signals for.
    """
    from podusv_cli.cli.progress import compiling, progress_bars
    from podusv_cli.workflows import run as workflow  # heavy imports only when they are needed
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
            controller=controller,
            names=figure or (),
            say=lambda line: warned(f"{config}: {line}"),
            warn=warned,
            compiling=compiling(bars, wanted=not (quiet or as_json)),
        )
        done = workflow.run(Path(config), request, partial(bars, str(config)) if bars else None)
    echo_result(done, lambda: _report(done, verbose), as_json=as_json, quiet=quiet)
    for finding in done.warnings:
        warned(finding)
    if done.message:
        echo(f"{config}: {done.message}", err=True)
    for part in done.missing:
        echo(f"{config}: {part.sentence_with_trace}", err=True)
    if not (figure or quiet or as_json):
        echo_how_to_draw(done.folder, [done.folder])
    raise typer.Exit(EXIT_CODES[done.status])


def _report(done: Finished, verbose: bool) -> None:
    """Print all metrics in a pipe and with `verbose`; on a terminal the headlines."""
    from podusv_cli.comparison.table import table, window

    brief = sys.stdout.isatty() and not verbose
    words, numbers = BRIEF if brief else WHOLE
    rows = {n: m for n, m in done.rows.items() if n in done.metrics and (m.headline or not brief)}
    # Of a run that did not finish, numbers say little.
    for name, metric in rows.items() if done.status == "finished" else ():
        number = done.metrics[name]
        shown = f"{number:>12.6g} {metric.unit if metric.unit != '1' else ''}"
        if math.isnan(number):
            shown = f"{metric.undefined_word:>12}"
        echo(f"{metric.row:<{words}} {shown:<{numbers}}  {name}")
    if counted := window(table({done.controller: done.metrics}, done.rows)):
        echo(counted)
    if verbose:
        for name, seconds in done.timing.items():
            echo(f"{name:<46} {seconds:>12.4f} s")
    echo(f"{done.controller} {done.status}: {done.folder}")
