"""`podusv tune`: the same search for gains for every law."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from podusv_cli.cli import options
from podusv_cli.cli.progress import StudyLine
from podusv_cli.cli.terminal import echo, echo_table, show

if TYPE_CHECKING:
    from podusv_cli.workflows.tune import Tuned


def tune(
    config: options.Config,
    assign: options.Assignments = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of the search.", show_default="results/<name>-tune")
    ] = None,
    workers: options.Workers = 0,
    scheduler: options.Scheduler = "",
    trust: options.Trust = False,
    force: Annotated[
        bool, typer.Option("--force", help="Remove the search that is there, and begin anew.")
    ] = False,
    figures: options.Figures = True,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
    plugin: options.Plugins = None,
) -> None:
    """Search gains for every law with the same number of runs, and compare before and after.

    The key `tune` of the scenario describes the search. What is reported comes from draws that no
    search has seen. Run it again to continue after an interrupt or with a larger budget. Needs
    Optuna (podusv[tune]).
    """
    from podusv_cli.workflows import tune as workflow  # heavy imports only when needed
    from podusv_cli.workflows.request import Request, silent

    with StudyLine(wanted=not (quiet or as_json)) as line:
        request = Request(
            assign or (),
            out,
            force=force,
            figures=figures,
            argv=sys.argv,
            plugins=plugin or (),
            trust=trust,
            workers=workers,
            scheduler=scheduler,
            say=line.say,
            warn=line.warn,
            begin=silent if quiet or as_json else line.note,
        )
        done = workflow.tune(Path(config), request, line.advance)
    for refused in done.refused:
        echo(f"warning: {refused}", err=True)
    show(done, lambda: _report(done), as_json=as_json, quiet=quiet)


def _report(done: Tuned) -> None:
    """Print ranks and objective of each law before and after tuning, and remarks."""
    from podusv_cli.studies.tuning.remarks import remarks
    from podusv_cli.studies.tuning.report import count_change, intervals, percent, ratio, spread

    results = done.results
    rows = [
        [
            row["law"],
            count_change(row, "rank"),
            count_change(row, "better_than"),
            intervals(row, "before"),
            intervals(row, "after"),
            ratio(row) if row["runs"] else "-",
            f"{percent(row, 'failed_before')} -> {percent(row, 'failed_after')}",
            spread(row),
        ]
        for row in results.laws.sort_values("rank_after").to_dict("records")
    ]
    ratios = "ratio, after / before"
    head = ["law", "rank", "better than", "before", "after", ratios, "failed", "searches"]
    echo(f"{results.plan.tune.objective} on {results.plan.tune.validate} fresh draws:")
    echo_table(head, rows)
    for text in remarks(results):
        echo(text)
    echo(f"gains: {done.folder / 'tuned.yaml'}")
    if (done.folder / "report.html").exists():
        echo(f"report: {done.folder / 'report.html'}")
