"""`podusv runs`: the runs and studies below a folder."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from podusv_cli.cli import completion, options
from podusv_cli.cli.terminal import echo, echo_json, echo_table

if TYPE_CHECKING:
    from podusv_cli.workflows.runs import ListedRun

USUAL = "iae"


def runs(
    folder: Annotated[Path, typer.Argument(help="Where to look, in all folders below.")] = Path(
        "results"
    ),
    where: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=VALUE",
            help="Only those whose scenario has this value; repeatable.",
            autocompletion=completion.keys,
        ),
    ] = None,
    sort: Annotated[
        str,
        typer.Option(
            metavar="METRIC",
            help="Show this metric, the smallest first, in place of the latest.",
            autocompletion=completion.metrics,
            show_default=False,
        ),
    ] = "",
    as_json: options.AsJson = False,
) -> None:
    """List the runs, studies, searches and benches below a folder, a line each.

    Reads their small files alone, and executes none of them.
    """
    from podusv_cli.workflows import runs as workflow  # heavy imports only when needed

    listed = workflow.runs(folder, where or (), sort)
    if as_json:
        echo_json({"format": 1, "runs": [run.as_json() for run in listed]})
    elif listed:
        head = ["started (UTC)", "what", "name", "law", "status", "took", sort or USUAL, "folder"]
        echo_table(head, [_row(run, sort or USUAL) for run in listed])
    else:
        echo(f"no run or study below {folder}")


def _row(run: ListedRun, metric: str) -> list[str]:
    """A table row of a run, as text: start, kind, name, law, status, duration, `metric`, folder."""
    from podusv_cli.core.quantities import time_in_words

    law = run.laws[0] if len(run.laws) == 1 else f"{len(run.laws)} laws"
    number = run.metrics.get(metric, math.nan)
    return [
        run.started[:16].replace("T", " ") or "-",
        run.kind,
        run.name,
        law if run.laws else "-",
        run.status,
        time_in_words(run.seconds) if run.seconds > 0 else "-",
        "-" if math.isnan(number) else f"{number:.5g}",
        str(run.folder),
    ]
