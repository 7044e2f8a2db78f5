"""`podusv diff`: two finished runs number by number, and in words, which `rerun` prints too."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from podusv_cli.cli.options import AsJson
from podusv_cli.cli.terminal import echo, echo_entry, echo_json, echo_table

if TYPE_CHECKING:
    from podusv_cli.comparison.log_difference import Deviation, LogDifference
    from podusv_cli.comparison.run_difference import Change, RunDifference

DIFFERENT = 3  # exit code
COUNTABLE = 1000  # ulps; beyond, only the relative difference says something


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

    differences = workflow.diff(Path(one), Path(other))
    if as_json:
        echo_json(differences.as_json())
    else:
        for label, (_, _, difference) in differences.pairs.items():
            _report(label, difference)
        for path, names in ((one, differences.only_one), (other, differences.only_other)):
            if names:
                echo(f"only in {path}: {', '.join(names)}")
    raise typer.Exit(0 if differences.same else DIFFERENT)


def _report(label: str, difference: RunDifference) -> None:
    """Print what differs between two runs, under `label` where there are several pairs."""
    if label:
        echo_entry(label)
    if difference.same:
        log = "log.h5 byte for byte" if difference.same_bytes else "every number of log.h5"
        echo(f"identical: scenario, metrics, {log}")
    _show_changes("scenario", difference.scenario)
    _show_changes("versions", difference.versions)
    _show_metrics(difference)
    if difference.log:
        _show_log(difference.log)


def _show_changes(what: str, changes: Mapping[str, Change]) -> None:
    if changes:
        echo_entry(what, *(change_in_words(key, change) for key, change in changes.items()))


def _show_metrics(difference: RunDifference) -> None:
    """Print a table of the metrics that differ.

    Where the runs end at different times, a sentence says that they do not compare.
    """
    from podusv_cli.comparison.run_difference import relative
    from podusv_cli.core.plugins import installed_plugins
    from podusv_cli.metrics.table import metrics_with
    from podusv_cli.metrics.windows import find

    # Of installed packages alone: what lies in the folders of finished runs is not executed.
    known = metrics_with(installed_plugins())
    units = {name: metric.unit for name in difference.metrics if (metric := find(name, known))}
    rows = [
        [name, units.get(name, ""), _number(a), _number(b), _number(relative(a, b), "+.2g")]
        for name, (a, b) in difference.metrics.items()
        if a != b
    ]
    if rows:
        echo_table(["metric", "unit", "first", "second", "relative"], rows)
    one, other = difference.log.ends if difference.log else (0.0, 0.0)
    if rows and one != other:
        echo(
            f"the first run ends at {one:g} s, the second at {other:g} s: their metrics are about "
            "different times and do not compare"
        )


def _show_log(log: LogDifference) -> None:
    """Print the largest difference of each signal, its part of the peak, and its time [s]."""
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
    """A number as text, `-` for one that a run has not."""
    return "-" if number is None else f"{number:{form}}"


def deviation_in_words(d: Deviation) -> str:
    """`psi_e at t = 0.3 s: 0.1 -> 0.2 rad (relative difference 0.5)`."""
    when = "" if d.time is None else f" at t = {d.time!r} s"
    return f"{d.signal}{when}: {d.one!r} -> {d.other!r} {d.unit} ({size(d)})"


def size(d: Deviation) -> str:
    """How far apart the two numbers of a deviation are, in words.

    In units in the last place (ulp) up to COUNTABLE, where these say that it is rounding.
    """
    if math.isinf(d.gap):
        return "one is not finite"
    # 0.0 and -0.0 differ in one bit, and in no number.
    if d.ulps == 0:
        return "the sign of zero"
    if d.ulps is not None and d.ulps <= COUNTABLE:
        return f"{d.ulps} ulp, relative difference {d.relative:.2g}"
    return f"relative difference {d.relative:.2g}"


def changes_in_words(changes: Mapping[str, Change]) -> str:
    """`a 1 -> 2; b x -> y`."""
    return "; ".join(change_in_words(key, change) for key, change in changes.items())


def change_in_words(key: str, change: Change) -> str:
    """`a 1 -> 2`, with - for no value."""
    from podusv_cli.core.phrases import as_yaml

    one, other = ("-" if value is None else as_yaml(value) for value in change)
    return f"{key} {one} -> {other}"


def log_in_words(log: LogDifference) -> Iterator[str]:
    """Sentences on all in which two logs differ, but for each signal's largest difference."""
    if log.first:
        yield f"first difference: {deviation_in_words(log.first)}"
        yield f"{len(log.largest)} of {len(log.compared)} signals differ"
    for name, (one, other) in log.endings.items():
        yield f"{name}: {one or '-'} -> {other or '-'}"
    if len(set(log.rows)) > 1:
        yield "rows: {} -> {}, compared at the {} times that both have".format(*log.rows)
    for names, what in (
        (log.reshaped, "of another size"),
        (log.only_one, "in the first only"),
        (log.only_other, "in the second only"),
    ):
        if names:
            yield f"{what}: {', '.join(names)}"
