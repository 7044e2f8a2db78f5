"""`podusv bench`: all laws over standard tasks."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from podusv_cli.cli import options
from podusv_cli.cli.terminal import echo, echo_table, show

if TYPE_CHECKING:
    from podusv_cli.workflows.bench import Benched

SOME_CRASHED = 3
Names = Annotated[list[str] | None, typer.Option(metavar="NAME", help="Only this; repeatable.")]


def bench(
    folder: Annotated[
        Path | None,
        typer.Argument(
            help="Folder with laws, tasks, vessels, conditions.", show_default="podusv's"
        ),
    ] = None,
    laws: Annotated[
        list[Path] | None,
        typer.Option(help="Scenario with further `controllers`; repeatable.", show_default=False),
    ] = None,
    task: Names = None,
    vessel: Names = None,
    condition: Names = None,
    assign: options.Assignments = None,
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("results/bench"),
    force: options.Force = False,
    workers: options.Workers = 0,
    figures: options.Figures = True,
    optimum: Annotated[
        bool, typer.Option("--optimum", help="Find the optimum of each case; a minute or two each.")
    ] = False,
    trust: options.Trust = False,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Run every law over every task, vessel and condition, and write a leaderboard.

    A law of your own takes part by --laws FILE, a scenario with `controllers` (and `plugins`).
    Exit code 3 where a law crashed; laws that diverge or miss their target are results.
    """
    from podusv_cli.cli.progress import progress_bars
    from podusv_cli.studies.bench.cases import (  # heavy imports only when needed
        Selection,
        shipped_bench,
    )
    from podusv_cli.workflows import bench as workflow
    from podusv_cli.workflows.request import Request

    chosen = {"tasks": task or (), "vessels": vessel or (), "conditions": condition or ()}
    wanted = Selection(folder or shipped_bench(), laws or (), assign or (), chosen, trust)
    request = Request(out=out, force=force, figures=figures, argv=sys.argv, workers=workers)
    with progress_bars(wanted=not (quiet or as_json)) as bars:
        done = workflow.bench(wanted, request, bars, optimum=optimum)
    show(done, lambda: _report(done), as_json=as_json, quiet=quiet)
    raise typer.Exit(SOME_CRASHED if done.crashed_count else 0)


def _report(done: Benched) -> None:
    """Print a leaderboard for each vessel, and where the report is."""
    from podusv_cli.studies.bench.standing import by_vessel, leaderboard_rows

    for vessel, runs in by_vessel(done.runs).items():
        echo(vessel)
        head, *rows = leaderboard_rows(runs)
        echo_table(head, rows)
    echo(f"{len(done.runs)} runs: {done.folder / 'report.html'}")
