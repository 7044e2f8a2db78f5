"""`podusv diff`: compare two finished runs number by number."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from podusv_cli.cli.difference_text import DIFFERENT
from podusv_cli.cli.options import AsJson
from podusv_cli.cli.terminal import echo, echo_entry, echo_json, echo_table

if TYPE_CHECKING:
    from podusv_cli.comparison.log_difference import LogDifference
    from podusv_cli.comparison.run_difference import Change, RunDifference


def diff(
    one: Annotated[str, typer.Argument(metavar="RUN", help="A run folder, or a comparison's.")],
    other: Annotated[str, typer.Argument(metavar="RUN", help="The run to compare it with.")],
    as_json: AsJson = False,
) -> None:
    """Show how two runs differ: scenario, versions, metrics, signals.

    Exit code 0 when scenario, signals and metrics are the same to the last bit, 3 when not;
    versions and the measured time of a law do not count. Of two comparisons, runs of the same name
    are compared.
    """
    from podusv_cli.workflows import diff as workflow  # heavy imports only when they are needed

    found = workflow.diff(Path(one), Path(other))
    if as_json:
        echo_json(found.as_json())
    else:
        for label, (_, _, difference) in found.pairs.items():
            _report(label, difference)
        for path, names in ((one, found.only_one), (other, found.only_other)):
            if names:
                echo(f"only in {path}: {', '.join(names)}")
    raise typer.Exit(0 if found.same else DIFFERENT)


def _report(label: str, found: RunDifference) -> None:
    if label:
        echo_entry(label)
    if found.same:
        log = "log.h5 byte for byte" if found.same_bytes else "every number of log.h5"
        echo(f"identical: scenario, metrics, {log}")
    _show_changes("scenario", found.scenario)
    _show_changes("versions", found.versions)
    _show_metrics(found)
    _show_log(found.log)


def _show_changes(what: str, changes: Mapping[str, Change]) -> None:
    from podusv_cli.cli.difference_text import change_in_words

    if changes:
        echo_entry(what, *(change_in_words(key, change) for key, change in changes.items()))


def _show_metrics(found: RunDifference) -> None:
    from podusv_cli.comparison.run_difference import relative
    from podusv_cli.core.plugins import installed
    from podusv_cli.metrics.table import metrics_with

    units = {name: metric.unit for name, metric in metrics_with(installed()).items()}
    rows = [
        [name, units.get(name, ""), _number(a), _number(b), _number(relative(a, b), "+.2g")]
        for name, (a, b) in found.metrics.items()
        if a != b
    ]
    if rows:
        echo_table(["metric", "unit", "first", "second", "relative"], rows)


def _show_log(log: LogDifference) -> None:
    from podusv_cli.cli.difference_text import log_in_words

    rows = [
        [d.signal, d.unit, _number(d.gap), _number(d.relative_to_peak), _number(d.time)]
        for d in log.largest
    ]
    if rows:
        echo_table(["signal", "unit", "largest difference", "of its peak", "at t [s]"], rows)
    lines = list(log_in_words(log))
    if lines:
        echo_entry("log", *lines)


def _number(number: float | None, form: str = ".6g") -> str:
    return "-" if number is None else f"{number:{form}}"
