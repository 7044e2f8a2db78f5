"""`podusv identify`: the hull of a boat from its logs."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from podusv_cli.cli import options
from podusv_cli.cli.exit_codes import INTERRUPTED
from podusv_cli.cli.terminal import Warnings, echo, echo_result, echo_table, show
from podusv_cli.core.errors import UsageError

if TYPE_CHECKING:
    from podusv_cli.identify.logs.listing import Listing
    from podusv_cli.identify.outputs import Identified
    from podusv_cli.workflows.look import LookedAt


def _show_columns(found: Listing, as_json: bool) -> None:
    """Print the columns of a log, or as JSON; warnings go to the standard error."""
    for line in found.warnings:
        echo(f"warning: {line}", err=True)
    echo_result(found, lambda: _report_columns(found), as_json=as_json, quiet=False)


def _show_page(done: LookedAt, *, as_json: bool, quiet: bool) -> None:
    """Print where the page of a log is; warnings go to the standard error."""
    for line in done.listing.warnings:
        echo(f"warning: {line}", err=True)
    show(done, lambda: echo(f"page: {done.page}"), as_json=as_json, quiet=quiet)


def _report_columns(found: Listing) -> None:
    """Print a row for each column, and a section `identify` to begin with."""
    echo_table([*found.HEAD], [[*own.cells] for own in found.columns])
    for line in ("", "identify:", *(f"  {line}" for line in found.mapping())):
        echo(line)


REFUSED = 3
Force = Annotated[
    bool,
    typer.Option(
        "--force",
        help="Replace finished results, and write a hull that predicts worse than `vessel`.",
    ),
]
Columns = Annotated[
    Path | None,
    typer.Option(
        "--columns",
        metavar="LOG",
        help="Only list the columns of a log, and what each may be; with CONFIG for its boat.",
    ),
]
Look = Annotated[
    Path | None,
    typer.Option(
        "--look",
        metavar="LOG",
        help="Only draw a log, its track and every signal, as a page; nothing is fitted.",
    ),
]


def identify(
    config: options.Config = "",
    columns: Columns = None,
    look: Look = None,
    assign: options.Assignments = None,
    out: options.Out = None,
    force: Force = False,
    figures: options.Figures = True,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
    trust: options.Trust = False,
    plugin: options.Plugins = None,
) -> None:
    """Find the numbers of a hull, and how far off they may be, from logs of the boat.

    The section `identify` of the scenario names the logs and their columns; `vessel` is what is
    known before. What the logs do not determine is named. Exit code 3 when the hull predicts a log
    worse than `vessel`: it is kept aside, and no scenario takes it.
    """
    from podusv_cli.workflows.look import list_log, look_at  # heavy imports only when needed
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
        warn=warned,
    )
    if columns:
        return _show_columns(list_log(columns, config, request), as_json)
    if look:
        return _show_page(look_at(look, config, request), as_json=as_json, quiet=quiet)
    # Optional only for the sake of --columns and --look.
    if not config:
        raise typer.BadParameter("CONFIG is missing: a scenario with the section `identify`")
    from podusv_cli.cli.progress import progress_bars
    from podusv_cli.identify.logs.formats import READERS
    from podusv_cli.workflows import identify as workflow  # heavy imports only when needed

    ending = Path(config).suffix.lower()
    if ending and ending in READERS:
        raise UsageError(
            f"{config} is a log; CONFIG is a scenario that names logs, as `podusv init "
            f"identify/otter` copies one. `podusv identify --columns {config}` lists its columns"
        )
    with progress_bars(wanted=not (quiet or as_json)) as bars:
        done = workflow.identify(Path(config), request, bars)
    show(done, lambda: _report(done), as_json=as_json, quiet=quiet)
    if done.refusal:
        echo(done.refusal, err=True)
    if done.status == "interrupted":
        echo("interrupted; the numbers are the best so far", err=True)
        raise typer.Exit(INTERRUPTED)
    raise typer.Exit(REFUSED if done.refusal else 0)


def _report(done: Identified) -> None:
    """Print the forces, the scores (of the judged logs, if there are any), and what stays open."""
    from podusv_cli.identify.outputs import FORCES, SCORES, force_rows, score_rows
    from podusv_cli.identify.phrases import open_words, summary

    answer = done.answer
    echo_table(list(FORCES), [*force_rows(answer)])
    judged = [score for score in answer.scores if score.role == "judge"]
    echo_table(list(SCORES), [*score_rows(judged or answer.scores)])
    for line in (*summary(answer), *open_words(answer)):
        echo(line)
    echo(f"hull: {done.hull}")
    echo(f"report: {done.folder / 'report.html'}")
