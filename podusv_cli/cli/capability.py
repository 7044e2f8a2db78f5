"""`podusv capability`: which steady loads hull and thrusters hold at rest."""

from __future__ import annotations

import math
import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from podusv_cli.cli import options
from podusv_cli.cli.terminal import Warnings, echo, echo_result, echo_table

if TYPE_CHECKING:
    from podusv_cli.workflows.capability import CapabilityOfScenario


class Load(StrEnum):
    """Loads whose largest size is sought."""

    current = "current"
    wind = "wind"
    force = "force"


def capability(
    config: options.Config,
    assign: options.Assignments = None,
    of: Annotated[
        Load,
        typer.Option(help="Speed of a current or a wind [m/s], or a force through the origin [N]."),
    ] = Load.current,
    every: Annotated[
        float, typer.Option(min=0.1, max=180.0, help="Degrees between two directions.")
    ] = 10.0,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for the results.", show_default="results/<name>/capability"),
    ] = None,
    force: options.Force = False,
    form: Annotated[
        str, typer.Option("--format", help="Of the figure: png, pdf, svg; several with commas.")
    ] = "png",
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
    trust: options.Trust = False,
    plugin: options.Plugins = None,
) -> None:
    """Find the largest steady load that the vessel holds at rest, from every direction.

    All thrusters work, then each of them is lost. The scenario's vessel and actuator count; its law
    does not, nor does its own disturbance. Writes a table, a CSV file and a polar figure.
    """
    from podusv_cli.cli.progress import progress_bars
    from podusv_cli.workflows import capability as workflow  # heavy imports only when needed
    from podusv_cli.workflows.request import Request

    request = Request(
        assign or (),
        out,
        force=force,
        argv=sys.argv,
        plugins=plugin or (),
        trust=trust,
        formats=[name.strip() for name in form.split(",")],
        warn=Warnings(quiet),
    )
    with progress_bars(wanted=not (quiet or as_json)) as bars:
        done = workflow.capability(Path(config), request, of.value, every, bars)
    echo_result(done, lambda: _report(done), as_json=as_json, quiet=quiet)


def _report(done: CapabilityOfScenario) -> None:
    """Print the table, and the least of each column."""
    head, *rows = done.table()
    echo_table([str(name) for name in head], [[f"{cell:.4g}" for cell in row] for row in rows])
    echo("the direction is where the load comes from: 0 from ahead, 90 from starboard")
    for name, (size, angle) in done.least().items():
        words = f"holds {size:.4g} {done.found.unit} from anywhere, least from {angle:.4g} deg"
        if math.isnan(size):
            words = "unknown: those left cannot make surge force and yaw moment apart"
        echo(f"{name}: {words}")
    if not done.takes_sway:
        echo("the actuator takes no sway force, so the law cannot balance one; pods that push")
        echo("every way take one with --set actuator.sway_weight=1")
    echo(f"written to {done.folder}")
