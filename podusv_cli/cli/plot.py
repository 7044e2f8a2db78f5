"""`podusv plot`: draw finished runs again."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from podusv_cli.cli.completion import figures
from podusv_cli.cli.options import Plugins
from podusv_cli.cli.terminal import echo, echo_path, warn_of_differences

SOME_FAILED = 3


def plot(
    runs: Annotated[list[str], typer.Argument(metavar="RUN...", help="Finished run folders.")],
    figure: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="What to draw; repeatable.",
            show_default="all",
            autocompletion=figures,
        ),
    ] = None,
    signal: Annotated[
        list[str] | None,
        typer.Option(help="A logged or derived signal; repeatable, a panel for each."),
    ] = None,
    since: Annotated[
        float, typer.Option("--from", help="Time of the first instant [s].", show_default="start")
    ] = -math.inf,
    until: Annotated[
        float, typer.Option("--to", help="Time of the last instant [s].", show_default="end")
    ] = math.inf,
    label: Annotated[
        list[str] | None, typer.Option(help="Name of a run; repeatable, in the order of the runs.")
    ] = None,
    form: Annotated[
        str, typer.Option("--format", help="png, pdf, svg; several with commas.")
    ] = "png",
    columns: Annotated[int, typer.Option(min=1, max=2, help="Width in columns of a page.")] = 2,
    size: Annotated[
        str, typer.Option(help="WIDTH or WIDTHxHEIGHT in inches, in place of columns.")
    ] = "",
    style: Annotated[
        str, typer.Option(help="podusv, or serif type of 8 points: paper, ieee, elsevier.")
    ] = "podusv",
    animate: Annotated[
        bool,
        typer.Option("--animate", help="The chase as a film as well: MP4, GIF without ffmpeg."),
    ] = False,
    out: Annotated[
        Path, typer.Option(help="Folder for the figures; replaces those of the same name there.")
    ] = Path("figures"),
    plugin: Plugins = None,
) -> None:
    """Draw finished runs, several in one figure; needs their folders and nothing else.

    Prints every file that it wrote. Files that belong to a finished run are never replaced.
    """
    from podusv_cli.workflows import plot as workflow  # heavy imports only when needed
    from podusv_cli.workflows.request import Request

    formats = [name.strip() for name in form.split(",")]
    request = Request(out=out, plugins=plugin or (), names=figure or (), formats=formats)
    choice = workflow.PlotChoice(
        signal or (), since, until, label or (), workflow.look_of(columns, size, style), animate
    )
    drawn = workflow.plot([Path(run) for run in runs], request, choice)
    for path in drawn.files:
        echo_path(path)
    if animate and any(path.suffix == ".gif" for path in drawn.files):
        echo("there is no ffmpeg here to make an MP4; the film is a GIF", err=True)
    for part in drawn.missing:
        echo(str(part), err=True)
    for path in drawn.replaced:
        echo(f"replaced what was in {path}", err=True)
    for empty, ending in drawn.empty.items():
        echo(f"{empty}: nothing to draw: {ending}", err=True)
    warn_of_differences(drawn.differences)
    raise typer.Exit(SOME_FAILED if drawn.missing else 0)
