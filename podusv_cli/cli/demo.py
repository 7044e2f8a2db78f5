"""`podusv demo`: a chase with three laws, and the page about it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from podusv_cli.cli import options
from podusv_cli.cli.compare import SOME_FAILED, echo_comparison
from podusv_cli.cli.exit_codes import INTERRUPTED
from podusv_cli.cli.terminal import echo
from podusv_cli.core.system import has_display

SCENARIO = "podusv:demo.yaml"
HEADER = 2  # its lines for editors and maintainers
METRICS = ("settling_time", "e_steady", "energy")
BEFORE = """\
A vessel of 1.3 m starts 12 m away from a target that it is to follow. Wind, waves and current push
it, and its propellers give no more than 8 N and 2.5 N m. This file has all of it, and three laws:
"""
MEANWHILE = """\
Simulating, which takes some seconds, and a few more where numba has to compile a kernel.
Watch pid_winds_up on the page: while the limit holds the vessel back, the law's integral grows."""


def demo(
    out: options.Out = None,
    force: options.Force = False,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in a browser.")
    ] = True,
) -> None:
    """Compare three laws in a chase, and open the page with animation, claims and figures.

    Some seconds. Without a display the page is named.
    """
    from podusv_cli.scenario.shipped import file_of

    echo(*BEFORE.splitlines())
    text = Path(file_of(SCENARIO)).read_text("utf-8")
    echo(*(f"    {line}".rstrip() for line in text.splitlines()[HEADER:]))
    echo("", *MEANWHILE.splitlines(), "")

    from podusv_cli.cli.progress import compiling, progress_bars
    from podusv_cli.workflows import compare as workflow  # heavy: after there is something to read
    from podusv_cli.workflows.request import Request

    with progress_bars(wanted=True) as progress:
        request = Request(out=out, force=force, argv=sys.argv, compiling=compiling(progress))
        done = workflow.compare([Path(SCENARIO)], request, progress)
    if done.status == "interrupted":
        echo(f"interrupted; the runs made so far are kept: {done.folder}", err=True)
        raise typer.Exit(INTERRUPTED)
    echo_comparison(done, METRICS)
    for part in done.missing:
        echo(part.sentence_with_trace, err=True)
    _open(done.folder / "report.html", browser)
    echo(
        "",
        "Three commands to try next:",
        "  podusv init demo        copy the scenario; change it, then: podusv compare demo.yaml",
        "  podusv list laws        which other laws there are",
        "  podusv docs tutorial    from an empty folder to a comparison of your own",
    )
    raise typer.Exit(SOME_FAILED if any(done.result.endings.values()) else 0)


def _open(page: Path, wanted: bool) -> None:
    """Open a page where there is a display, and name it."""
    import webbrowser

    opened = wanted and has_display() and webbrowser.open(page.resolve().as_uri())
    echo(f"{'opened' if opened else 'open this page in a browser:'} {page}")
