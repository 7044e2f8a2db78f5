"""`podusv verify`: have the numbers of a scenario converged."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from podusv_cli.cli.options import AsJson, Assignments, Config, Plugins, Trust
from podusv_cli.cli.terminal import Warnings, echo, echo_entry, echo_json, echo_table
from podusv_cli.verification import TOLERANCE

if TYPE_CHECKING:
    from podusv_cli.verification.ranking import Ranking
    from podusv_cli.verification.richardson import StepEstimate
    from podusv_cli.verification.verify import RunVerification, Verification

NOT_CONVERGED = 3


def verify(
    config: Config,
    assign: Assignments = None,
    tolerance: Annotated[
        float, typer.Option(min=0.0, help="Relative error up to which a number is converged.")
    ] = TOLERANCE,
    out: Annotated[
        Path | None,
        typer.Option(help="File to write the JSON object to as well; replaces an earlier one."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace any other file, too.")] = False,
    as_json: AsJson = False,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="Print nothing; see the exit code.")
    ] = False,
    trust: Trust = False,
    plugin: Plugins = None,
) -> None:
    """Repeat a scenario at half and at a quarter of its step.

    Shows order and error of every metric, and in a comparison whether the ranking is the same.
    Exit code 3 when something is not converged.
    """
    from podusv_cli.cli.progress import progress_bars
    from podusv_cli.workflows import verify as verifying  # heavy imports only when they are needed

    with progress_bars(wanted=not (quiet or as_json)) as progress:
        try:
            done = verifying.verify(
                Path(config),
                assign or (),
                tolerance,
                out,
                progress,
                force=force,
                plugins=plugin or (),
                trust=trust,
                warn=Warnings(quiet),
            )
        except KeyboardInterrupt:
            text = f"{config}: interrupted before all steps were simulated; nothing was written"
            raise KeyboardInterrupt(text) from None
    try:
        if out:
            verifying.keep(done, out, force=force)
    finally:  # print the result even if the file cannot be written
        if as_json:
            echo_json(done.as_json())
        elif not quiet:
            _report(done)
    raise typer.Exit(NOT_CONVERGED if done.unconverged_by_run else 0)


def _report(done: Verification) -> None:
    """Print numbers by step for each run, the rankings, and whether all are converged."""
    for label, run in done.runs.items():
        _show_run(label, run, done)
    if done.rankings:
        _show_rankings(done.rankings)
    failed = [f"{label}: {', '.join(names)}" for label, names in done.unconverged_by_run.items()]
    heading = "not converged" if failed else "converged"
    echo("end_position: distance from where the run with the smallest step ends")
    echo(f"{heading} within {done.tolerance:.3g} relative", *failed)
    step = done.sufficient_step
    if step:
        echo(
            f"by their orders errors are within it from a step of {step:.2g} s down: set "
            "simulation.step"
        )


def _show_run(label: str, run: RunVerification, done: Verification) -> None:
    """Print a run's numbers at each step, their order and error, and where one ended early.

    `label` is the run's; `done` has the tolerance and the units of all runs.
    """
    steps = [f"{level.step:.6g} s" for level in run.levels]
    rows = [
        [name, done.units.get(name, "m"), *_cells(e, done.tolerance)]
        for name, e in run.estimates.items()
    ]
    echo(f"{label}:")
    echo_table(["number", "unit", *steps, "order", "rel. error", "verdict"], rows)
    for level in run.levels:
        if level.message:
            echo(f"at {level.step:.6g} s: {level.message}")
    echo("")


def _cells(e: StepEstimate, tolerance: float) -> list[str]:
    """Table cells of one number: its value at each step, order, relative error, verdict."""
    values = ["-" if math.isnan(value) else f"{value:.6g}" for value in e.values]
    order = "-" if math.isnan(e.order) else f"{e.order:.1f}"
    error = "-" if math.isinf(e.relative) else f"{e.relative:.1e}"
    return [*values, order, error, "converged" if e.converged(tolerance) else "not converged"]


def _show_rankings(rankings: dict[str, Ranking]) -> None:
    """Print the order of the laws by each metric."""
    echo("ranking, smallest first:")
    for name, rank in rankings.items():
        echo_entry(f"  {name}", _in_order(rank))
    echo("")


def _in_order(rank: Ranking) -> str:
    """A ranking of laws in words: labels in order, which are equal, which are too close to rank."""
    if not rank.same:
        return "changes with the step: " + "; ".join(", ".join(o) for o in rank.orders)
    first = rank.orders[0]
    # Neighbours with equal numbers get an equals sign between them.
    marks = (" = " if pair in rank.equal else ", " for pair in pairwise(first))
    order = first[0] + "".join(mark + label for mark, label in zip(marks, first[1:], strict=True))
    if len(rank.equal) == len(first) - 1:
        return f"{order}; equal at all steps, no ranking"
    if rank.close:
        pairs = "; ".join(" and ".join(pair) for pair in rank.close)
        return f"{order}; cannot be ranked, they differ by less than the numerical error: {pairs}"
    return f"{order}; the same at all steps, beyond the errors"
