"""`podusv compare`: several runs side by side."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from podusv_cli.cli import completion, options
from podusv_cli.cli.exit_codes import INTERRUPTED
from podusv_cli.cli.grid import grid
from podusv_cli.cli.terminal import (
    Warnings,
    columns,
    echo,
    echo_entry,
    echo_how_to_draw,
    echo_result,
    echo_table,
    warn_of_differences,
)
from podusv_cli.core.escaping import visible

if TYPE_CHECKING:
    from podusv_cli.core.past_run import PastRun
    from podusv_cli.workflows.compare import Compared

SOME_FAILED = 3


def compare(
    items: Annotated[
        list[str],
        typer.Argument(
            metavar="CONFIG_OR_RUN...",
            help="Scenarios, run folders, comparisons; beside them a log of a boat.",
        ),
    ],
    assign: options.Assignments = None,
    out: options.Out = None,
    force: options.Force = False,
    figures: options.Figures = True,
    figure: options.Figure = None,
    form: Annotated[
        str, typer.Option("--format", help="Of figures: png, pdf, svg; several with commas.")
    ] = "png",
    metric: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Show only this in tables, here and in .md and .tex; repeatable.",
            autocompletion=completion.metrics,
        ),
    ] = None,
    ratios: Annotated[
        bool, typer.Option("--ratios", help="Ratios to the first run in comparison.tex, too.")
    ] = False,
    align: Annotated[
        str,
        typer.Option(
            "--align",
            metavar="start|place",
            help="Lay a log on the first run: clock and place of its beginning, or place alone.",
        ),
    ] = "",
    doubt: Annotated[
        bool,
        typer.Option("--doubt", help="Say what each verdict depends on, as podusv doubt does."),
    ] = False,
    workers: options.Workers = 0,
    as_json: options.AsJson = False,
    allow_large: options.AllowLarge = False,
    quiet: options.Quiet = False,
    verbose: options.Verbose = False,
    trust: options.Trust = False,
    plugin: options.Plugins = None,
) -> None:
    """Simulate scenarios, and compare them with finished runs: table, claims, figures, report.

    One scenario with `controllers`, several scenarios, finished runs, or any mixture. A log, such
    as LOG.csv with columns time, x, y, psi, is drawn beside them. Exit code 3
    when a run failed or diverged; the others are compared all the same. Draws trajectory and
    errors, with `--figure all` every figure that the runs have signals for.
    """
    from podusv_cli.cli.progress import compiling, progress_bars
    from podusv_cli.workflows import compare as workflow  # heavy imports only when needed
    from podusv_cli.workflows.request import Request

    warned = Warnings(quiet)
    with progress_bars(wanted=not (quiet or as_json)) as progress:
        request = Request(
            assign or (),
            out,
            force=force,
            figures=figures,
            argv=sys.argv,
            plugins=plugin or (),
            trust=trust,
            allow_large=allow_large,
            workers=workers,
            names=figure or (),
            formats=[name.strip() for name in form.split(",")],
            metrics=metric or (),
            align=align,
            ratios=ratios,
            doubt=doubt,
            warn=warned,
            compiling=compiling(progress, wanted=not (quiet or as_json)),
        )
        done = workflow.compare([Path(item) for item in items], request, progress)
    echo_result(done, lambda: _report(done, verbose, metric or ()), as_json=as_json, quiet=quiet)
    together = [*done.result.warnings] if sys.stderr.isatty() and not verbose else []
    warned.all_of(done.warnings(), together)
    warn_of_differences(done.result.differences)
    if lacking := [name for name in metric or () if name not in done.result.table.rows]:
        echo(f"warning: no run here has {', '.join(lacking)}; tables are without it", err=True)
    for label, ending in done.result.endings.items():
        if ending:
            echo(*f"{label}: {ending}".splitlines(), err=True)
    for part in done.missing:
        echo(part.sentence_with_trace, err=True)
    if done.status == "interrupted":
        echo("interrupted; the runs made so far are compared, without figures", err=True)
        raise typer.Exit(INTERRUPTED)
    if done.unverified and not quiet:
        echo(_advice(done, items, assign or (), plugin or ()), err=True)
    if not (figure or quiet or as_json):
        echo_how_to_draw(done.folder, done.places())
    page = done.folder / "report.html"
    if page.exists() and not (as_json or quiet):
        echo(f"report: {page}")
    raise typer.Exit(SOME_FAILED if any(done.result.endings.values()) else 0)


def _report(done: Compared, verbose: bool, metrics: Sequence[str]) -> None:
    """Print the comparison and where it is.

    `metrics` restricts the table; `verbose` adds all metrics and the time [s] that each part took.
    """
    echo_comparison(done, metrics, whole=verbose)
    result = done.result
    if verbose:
        for label, timing in result.timings.items():
            shown = ", ".join(f"{name} {seconds:.3f}" for name, seconds in timing.items())
            echo(f"{label}: {shown}")
    echo(f"compared {_count_words(result.runs)}: {done.folder}")


def _count_words(past: Sequence[PastRun]) -> str:
    """How many runs, and how many logs beside them."""
    from podusv_cli.comparison.measured import NO_LAW

    logs = sum(run.recording.controller == NO_LAW for run in past)
    runs = len(past) - logs
    words = [f"{runs} {'run' if runs == 1 else 'runs'}", *(["1 log"] if logs else [])]
    return " and ".join(words)


def echo_comparison(done: Compared, metrics: Sequence[str] = (), *, whole: bool = False) -> None:
    """Print the table, or only its rows of `metrics`, and what the claims came to.

    A terminal gets the headlines, or these metrics, in as many columns as it has; a pipe, and a
    terminal with `whole`, get all.
    """
    if whole or not sys.stdout.isatty() or not _echo_brief(done, metrics):
        _echo_whole(done, metrics)
    result = done.result
    for v in result.verdicts:
        echo_entry(v.name, v.claim.says, v.evidence(), facts=v.in_words)
    if result.doubts:
        echo_table(list(result.doubts[0]), [list(row) for row in result.doubts[1:]])


def _echo_whole(done: Compared, metrics: Sequence[str]) -> None:
    """Print all metrics, or those named, of all runs, with the notes below the table."""
    from podusv_cli.comparison.table import cells, head, note, window

    result = done.result
    rows = cells(result.table, result.metrics, result.unsettled_runs, chosen=metrics)
    echo_table(head(result.table), rows)
    echo(*filter(None, (note(result.table), window(result.table))))


def _echo_brief(done: Compared, metrics: Sequence[str]) -> bool:
    """Print the laws side by side, or a line each; False where there are no rows or no room."""
    from podusv_cli.comparison.table import rows, window

    result = done.result
    every = rows(
        result.table,
        result.metrics,
        result.unsettled_runs,
        chosen=metrics,
        brief=True,
        ratios=False,
    )
    # A headline that no run has is left out.
    shown = [r for r in every if metrics or (r.metric.headline and {*r.texts} != {"-"})]
    if not shown:
        return False
    units = [f"[{row.metric.unit}]" if row.metric.unit != "1" else "" for row in shown]
    names = [f"{row.metric.name}\n{unit}".strip() for row, unit in zip(shown, units, strict=True)]
    words = [f"{row.metric.row} {unit}".strip() for row, unit in zip(shown, units, strict=True)]
    labels = result.table.columns
    across = [[text, *row.texts] for text, row in zip(words, shown, strict=True)]
    down = [[label, *(row.texts[i] for row in shown)] for i, label in enumerate(labels)]
    # Laws across, where they fit; else a line for each law.
    lines = grid(["", *labels], across, columns()) or grid(["", *names], down, columns())
    typer.echo("\n".join(map(visible, lines)))
    if lines:
        note = "-v: every metric"
        if len(labels) > 1:
            note = f"* best of those that end at their target; {note}, with ratios"
        echo(*filter(None, (note, window(result.table))))
    return bool(lines)


def _advice(
    done: Compared, items: Sequence[str], assign: Sequence[str], plugin: Sequence[str]
) -> str:
    """The command that shows whether the numbers of the first unverified run have converged.

    `items`, `assign` and `plugin` are the arguments of this command.
    """
    from podusv_cli.workflows.measured import is_log

    finished = {run.label: done.place(run) for run in done.result.runs}
    label = done.unverified[0]
    if label in done.result.timings:
        scenario = next(i for i in items if not (Path(i).is_dir() or is_log(Path(i))))
        changes = [word for change in assign for word in ("--set", change)]
    else:  # it was there before
        scenario, changes = str(finished[label] / "resolved.yaml"), []
    files = [word for file in plugin for word in ("--plugin", file)]
    command = shlex.join(["podusv", "verify", scenario, *changes, *files])
    return f"the numbers may not have converged; check them: {command}"
