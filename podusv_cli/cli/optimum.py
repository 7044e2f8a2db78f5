"""`podusv optimum`: the best that any law could do in a scenario."""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from podusv_cli.cli import options
from podusv_cli.cli.run import EXIT_CODES
from podusv_cli.cli.terminal import Warnings, echo, echo_result, echo_table

if TYPE_CHECKING:
    from podusv_cli.workflows.optimum import Optimum


class Minimise(StrEnum):
    """The integrals that can be minimised."""

    iae = "iae"
    ise = "ise"


def optimum(
    config: options.Config,
    assign: options.Assignments = None,
    minimise: Annotated[
        Minimise, typer.Option(help="Integral of the distance to the target, or of its square.")
    ] = Minimise.iae,
    step: Annotated[
        float, typer.Option(min=1e-3, help="Step of the finest of three grids [s].")
    ] = 0.1,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for the results.", show_default="results/<name>/optimum"),
    ] = None,
    force: options.Force = False,
    figures: options.Figures = True,
    as_json: options.AsJson = False,
    allow_large: options.AllowLarge = False,
    quiet: options.Quiet = False,
    trust: options.Trust = False,
    plugin: options.Plugins = None,
    controller: Annotated[
        str,
        typer.Option(
            metavar="NAME", help="Which of `controllers` to begin from.", show_default=False
        ),
    ] = "",
) -> None:
    """Find the motion of least error, knowing everything beforehand, and repeat it as a run.

    Uses the scenario's vessel, actuator limits, disturbance, path and start. The search begins from
    runs of its laws and of velocity_vector, which have no further part in it. The result can be
    compared and plotted like any other run. Needs CasADi (podusv[optimum]).
    """
    from podusv_cli.cli.progress import progress_bars
    from podusv_cli.workflows import optimum as workflow  # heavy imports only when they are needed
    from podusv_cli.workflows.request import Request

    warned = Warnings(quiet)
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
        warn=warned,
    )
    try:
        with progress_bars(wanted=not (quiet or as_json)) as bars:
            done = workflow.optimum(Path(config), request, minimise.value, step, bars)
    except KeyboardInterrupt:
        text = f"{config}: interrupted before the optimum was found; nothing was written"
        raise KeyboardInterrupt(text) from None
    echo_result(done, lambda: _report(done), as_json=as_json, quiet=quiet)
    for finding in done.run.warnings:
        warned(finding)
    for text in (done.run.message, *(part.sentence_with_trace for part in done.run.missing)):
        if text:
            echo(f"{config}: {text}", err=True)
    raise typer.Exit(EXIT_CODES[done.run.status])


def _report(done: Optimum) -> None:
    """Print the stages of the search, and how far podusv's own run departs from the optimum."""
    name = done.minimised
    unit = done.run.rows[name].unit
    rows = [
        [s.start, f"{s.step:.4g} s", f"{s.integral:.7g}", str(s.iterations), f"{s.seconds:.1f} s"]
        for s in done.stages
    ]
    echo_table(["from a run of", "step", f"{name} [{unit}]", "iterations", "time"], rows)
    echo(f"a local optimum, to IPOPT's tolerance of {done.tolerance:g}; a search from the run of")
    echo("another law in `controllers` may lead to a lower one")
    # An interrupted run lacks them.
    if name in done.run.metrics and done.departures:
        away = done.departures
        added = [
            f"{away[f'feedback_{axis}']:.2g} {unit}"
            for axis, unit in (("u", "N"), ("v", "N"), ("r", "N m"))
            if f"feedback_{axis}" in away
        ]
        echo(
            f"repeated by podusv: {name} {done.run.metrics[name]:.7g} {unit}; at most "
            f"{away['position']:.2g} m from the optimum, where the feedback that holds it there "
            f"added at most {', '.join(added[:-1])} and {added[-1]}"
        )
    echo(f"{done.run.status}: {done.run.folder}")
