"""`podusv sweep`: many draws of a scenario as one answer."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from podusv_cli.cli import completion, options
from podusv_cli.cli.exit_codes import with_exit_codes
from podusv_cli.cli.progress import StudyLine
from podusv_cli.cli.terminal import echo, echo_entry, echo_json, echo_path, echo_table, show
from podusv_cli.core.errors import UsageError

if TYPE_CHECKING:
    from podusv_cli.workflows.sweep import Swept

sweep = typer.Typer(
    help="Draw a scenario many times, and judge laws by all draws.", no_args_is_help=True
)
SOME_FAILED = 3
UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}
Study = Annotated[Path, typer.Argument(metavar="STUDY", help="The folder of a study.")]


def command(function: object) -> object:
    """Make a function a command of `podusv sweep`, with podusv's exit codes."""
    return sweep.command()(with_exit_codes(function))  # type: ignore[arg-type]


@command
def run(
    config: Annotated[
        str,
        typer.Argument(
            metavar="CONFIG|STUDY",
            help="A scenario (a YAML file or podusv:NAME.yaml), or the folder of a study.",
        ),
    ],
    assign: options.Assignments = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of the study.", show_default="results/<name>-sweep")
    ] = None,
    draws: Annotated[
        int, typer.Option(min=0, help="How many draws.", show_default="the scenario's")
    ] = 0,
    until: Annotated[str, typer.Option(help="Begin no run after this time: 90s, 30min, 8h.")] = "",
    workers: options.Workers = 0,
    shard: Annotated[
        str, typer.Option(help="A part of the study, as 3/20: for `podusv sweep merge`.")
    ] = "",
    scheduler: options.Scheduler = "",
    trust: options.Trust = False,
    force: Annotated[
        bool, typer.Option("--force", help="Remove the study that is there, and begin anew.")
    ] = False,
    figures: options.Figures = True,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
    plugin: options.Plugins = None,
) -> None:
    """Simulate all draws of all laws, or those that are missing, and judge the study's claims.

    Run it again to continue after an interrupt, or with more draws. Exit code 3 when a run crashed,
    hung or was invalid, and when a kept log differs from the table; runs that diverge are results.
    """
    from podusv_cli.workflows import sweep as workflow  # heavy imports only when needed
    from podusv_cli.workflows.request import Request

    changes = [*(assign or ()), *([f"sweep.draws={draws}"] if draws else [])]
    with StudyLine(wanted=not (quiet or as_json)) as line:
        request = Request(
            changes,
            out,
            force=force,
            figures=figures,
            argv=sys.argv,
            plugins=plugin or (),
            trust=trust,
            workers=workers,
            scheduler=scheduler,
            seconds=seconds(until),
            shard=part_of(shard),
            say=line.say,
            warn=line.warn,
        )
        try:
            done = workflow.run(Path(config), request, line.tell)
        except KeyboardInterrupt as stop:
            # An interrupt before the first run has no words of its own.
            again = f"the same command{' without --force' if force else ''} goes on"
            raise KeyboardInterrupt(str(stop) or f"interrupted; {again}") from None
    for refused in done.refused:
        warn(refused)
    _tell(done, as_json=as_json, quiet=quiet)


def warn(text: str) -> None:
    """Print a warning."""
    echo(f"warning: {text}", err=True)


def seconds(text: str) -> float:
    """A time such as 30min in seconds, infinite for none. Raises UsageError."""
    if not text:
        return float("inf")
    match = re.fullmatch(r"(\d+(?:\.\d+)?)(s|min|h|d)", text)
    if not match:
        raise UsageError(f"--until {text!r} is no time; write a number and s, min, h or d: 30min")
    return float(match[1]) * UNITS[match[2]]


def part_of(text: str) -> tuple[int, int]:
    """A shard such as 3/20 as its number from 1, and how many there are; "" is 1/1.

    Raises UsageError.
    """
    match = re.fullmatch(r"(\d+)/(\d+)", text or "1/1")
    if not match or not 1 <= int(match[1]) <= int(match[2]):
        raise UsageError(f"--shard {text!r} is no part; write its number and the count: 3/20")
    return int(match[1]), int(match[2])


def _tell(done: Swept, *, as_json: bool, quiet: bool) -> None:
    """Print a study, and on stderr what of it could not be made.

    Exits with SOME_FAILED for broken runs, and for kept logs that differ from the table.
    """
    show(done, lambda: _report(done), as_json=as_json, quiet=quiet)
    if done.results and (done.results.broken_runs or done.results.contradicted):
        raise typer.Exit(SOME_FAILED)


def _report(done: Swept) -> None:
    """Print how many runs are made, and of a study with results its table and verdicts."""
    if done.results is None:
        echo(f"{done.tally.made} of {done.tally.wanted} runs are made; {_next_step(done)}")
        for line in done.missing_runs:
            echo(line)
        echo(f"study: {done.folder}")
        return
    if done.results.preliminary:
        echo(f"{done.results.preliminary}; {_next_step(done)}")
    echo_table(*done.results.cells())
    for v in done.results.verdicts:
        echo_entry(v.name, v.claim.says, v.evidence(), facts=v.in_words)
    if done.results.contradicted:
        echo(done.results.contradicted)
    if done.results.broken_runs:
        echo(f"{done.results.broken_runs} runs crashed, hung or were invalid: see the report")
    echo(f"study: {done.folder}")
    if (done.folder / "report.html").exists():
        echo(f"report: {done.folder / 'report.html'}")


def _next_step(done: Swept) -> str:
    """What to do next with an unfinished study, in words: join its shards, or continue it."""
    if done.part_is_whole:
        return "this shard is done: join all of them with podusv sweep merge"
    from podusv_cli.scenario.plugins import continue_with

    return f"continue with: {continue_with('sweep run', done.folder)}"


@command
def status(study: Study, as_json: options.AsJson = False) -> None:
    """Say how far a study is: the runs of every law and cell that are made."""
    from podusv_cli.workflows import studies

    made = studies.status(study)
    if as_json:
        echo_json({"format": 1, "folder": str(study), "made": made.as_json()})
        return
    rows = [[law, cell or "-", str(count), str(made.wanted)] for law, cell, count in made.rows]
    echo_table(["law", "cell", "made", "wanted"], rows)


@command
def report(
    study: Study,
    figures: options.Figures = True,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Make the tables, verdicts and figures of a study anew, of what is there."""
    from podusv_cli.workflows import sweep as workflow
    from podusv_cli.workflows.request import Request

    with StudyLine(wanted=not (quiet or as_json)) as line:
        request = Request(argv=sys.argv, figures=figures, say=line.say, warn=line.warn)
        done = workflow.report(study, request)
    _tell(done, as_json=as_json, quiet=quiet)


@command
def merge(
    studies: Annotated[list[Path], typer.Argument(metavar="STUDY...", help="Folders of shards.")],
    out: Annotated[Path, typer.Option(help="Folder of the whole study.")],
    figures: options.Figures = True,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Join the runs of several folders of one study, as `--shard` makes them."""
    from podusv_cli.workflows import merge as joining
    from podusv_cli.workflows.request import Request

    with StudyLine(wanted=not (quiet or as_json)) as line:
        request = Request(argv=sys.argv, figures=figures, say=line.say, warn=line.warn)
        done = joining.merge(studies, out, request)
    _tell(done, as_json=as_json, quiet=quiet)


@command
def draw(
    study: Study,
    law: Annotated[str, typer.Option(help="The law.", autocompletion=completion.laws)],
    number: Annotated[int, typer.Option("--draw", min=0, help="The draw.")],
    cell: Annotated[int, typer.Option(min=0, help="The cell of the grid.")] = 0,
    out: Annotated[
        Path | None,
        typer.Option(help="The file to write.", show_default="<name>-<law>-<draw>.yaml"),
    ] = None,
    trust: options.Trust = False,
) -> None:
    """Write one run of a study as a scenario of its own, for `podusv run` and `compare`."""
    from podusv_cli.workflows import studies

    path = studies.draw(study, law, number, cell, out, trusted=trust)
    echo_path(path)
    echo(f"run it: podusv run {path}", err=True)


@command
def export(
    study: Study,
    form: Annotated[
        str, typer.Option("--format", help="csv or parquet.", autocompletion=completion.exports)
    ] = "csv",
    out: Annotated[
        Path | None, typer.Option(help="The file to write.", show_default="<study>/runs.<format>")
    ] = None,
) -> None:
    """Write all runs as one table: a row a run, with its draw, status and metrics."""
    from podusv_cli.workflows import studies

    echo_path(studies.export(study, form, out))
