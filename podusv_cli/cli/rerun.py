"""`podusv rerun`: repeat a finished run and compare the logs bit by bit."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from podusv_cli.cli.diff import DIFFERENT, changes_in_words, deviation_in_words, log_in_words
from podusv_cli.cli.exit_codes import INTERRUPTED
from podusv_cli.cli.options import AllowLarge, AsJson, Force, Trust
from podusv_cli.cli.terminal import echo, echo_entry, echo_json

if TYPE_CHECKING:
    from podusv_cli.workflows.rerun import Repeated, Repetition

DIVERGED = 4


def rerun(
    run: Annotated[str, typer.Argument(metavar="RUN", help="A run folder, or a comparison's.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder to keep the repeated run in.", show_default="none")
    ] = None,
    force: Force = False,
    allow_large: AllowLarge = False,
    trust: Trust = False,
    as_json: AsJson = False,
) -> None:
    """Repeat a finished run from its folder and tell whether the log is the same.

    Exit code 0 when every number of the log is the same to the last bit, 3 when not, 4 when the
    run diverges and had not. Nothing is left behind without `--out`.
    """
    from podusv_cli.cli.progress import progress_bars
    from podusv_cli.workflows import rerun as repeating  # heavy imports only when they are needed
    from podusv_cli.workflows.request import Request

    request = Request(
        out=out, force=force, figures=False, argv=sys.argv, allow_large=allow_large, trust=trust
    )
    with progress_bars(wanted=not as_json) as progress:
        done = repeating.rerun(Path(run), request, progress)
    if as_json:
        echo_json(done.as_json() | {"folder": out and str(out)})
    else:
        for label, repeated in done.runs.items():
            echo_entry(label, *_lines(repeated), facts=_verdict(repeated))
        if out:
            echo(f"repeated: {out}")
    for label, repeated in done.runs.items():
        if repeated.status == "interrupted":
            echo(f"{label}: {repeated.message}", err=True)
        for part in repeated.missing:
            echo(f"{label}: {part}", err=True)
    for label, failure in done.failures.items():
        echo(*f"{label}: {failure}".splitlines(), err=True)
    raise typer.Exit(_exit_code(done))


def _exit_code(done: Repetition) -> int:
    """The exit code of a repetition: interrupted before diverged before different."""
    if done.interrupted:
        return INTERRUPTED
    if done.diverges:
        return DIVERGED
    return 0 if done.identical else DIFFERENT


def _verdict(run: Repeated) -> str:
    """Whether a run came out the same again, in one phrase: bytes, numbers only, or neither."""
    if run.found.same_bytes:
        return f"identical: {run.found.sizes[0]} bytes, sha256 {run.found.digests[0]}"
    if run.identical:
        return "identical in every number; but log.h5 differs in compression or descriptions"
    return "interrupted" if run.status == "interrupted" else "not identical"


def _lines(run: Repeated) -> Iterator[str]:
    """Sentences on what differs from the run before: signals, scenario, versions."""
    difference = run.found
    if difference.log:
        yield from log_in_words(difference.log)
    elif not run.identical:
        yield "the run's own log is not here, so that only the digests were compared"
    if difference.log and difference.log.largest:
        widest = max(difference.log.largest, key=lambda deviation: deviation.relative_to_peak)
        share = f"{widest.relative_to_peak:.2g} of its peak"
        yield f"largest difference, {share}: {deviation_in_words(widest)}"
    if difference.scenario:
        yield f"changed in the scenario: {changes_in_words(difference.scenario)}"
    if difference.versions:
        yield f"changed in versions: {changes_in_words(difference.versions)}"
    if not (run.identical or difference.scenario or difference.versions):
        yield "no change in the scenario or in the versions of provenance.json explains it"
