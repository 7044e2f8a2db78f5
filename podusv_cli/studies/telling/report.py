"""The HTML report of a study: one file that needs nothing else, the answer first."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from podusv_cli.core.phrases import value_text
from podusv_cli.expressions.verdict import by_answer
from podusv_cli.pages.page import Picture, environment, flat
from podusv_cli.process.extras import Failure
from podusv_cli.studies.counting.runs import STATUSES, Mask
from podusv_cli.studies.counting.runs_file import RunsTable
from podusv_cli.studies.counting.statistics import Interval, digits
from podusv_cli.studies.making.sessions import sessions
from podusv_cli.studies.telling.bars import bars
from podusv_cli.studies.telling.keep import Kept
from podusv_cli.studies.telling.results import Results

FEW = 5  # laws, whose pairs are no more than ten
FIRST = 20  # rows of a table of runs
DECISIVE = 2  # drawn values of a run
SESSION = ("started", "duration_s", "runs", "podusv", "python", "platform.processor", "argv")


class RunRow(NamedTuple):
    """A run of a table: how it ended and why, who else failed there, and what the draw was."""

    law: str
    cell: int
    label: str
    draw: int
    ending: str
    cause: str
    others: str
    drawn: str


class Rows(NamedTuple):
    """The worst runs of a kind, and how many there are."""

    first: Sequence[RunRow]
    total: int


def page(
    folder: Path,
    results: Results,
    kept: Sequence[Kept],
    figures: Sequence[Picture],
    missing: Sequence[Failure],
) -> str:
    """The whole report as HTML; what could not be made (`missing`) is listed in it."""
    about, beside = results.about, _beside(figures, len(results.runs.laws))
    ordered = [*beside, *(picture for picture in figures if picture not in beside)]
    numbered = [*enumerate(ordered, 1)]
    return (
        environment("podusv_cli.studies.telling")
        .get_template("study.html.j2")
        .render(
            title=f"{about.name}: a study",
            folder=folder,
            results=results,
            about=about,
            several=len(results.runs.cells) > 1,
            answers=by_answer(results.verdicts),
            claims=[
                (v, [*bars(p, v)]) for p, v in zip(results.parsed, results.verdicts, strict=True)
            ],
            laws=list(_laws(results)),
            broken=runs_that(results, results.runs.broken),
            failed=runs_that(results, results.runs.failed),
            pairs=_pairs(results),
            numbers=_numbers(results),
            metrics={name: results.known_metrics[name] for name in results.shown_metrics},
            varied=_varied_quantities(results),
            grid=[(key, ", ".join(given)) for key, given in about.grid.items()],
            kept=kept,
            beside=numbered[: len(beside)],
            figures=numbered,
            missing=[str(failure) for failure in missing],
            sittings=_sessions(folder),
            latest=[
                (key, value_text(value)) for key, value in flat((sessions(folder) or [{}])[-1])
            ],
            first=FIRST,
        )
    )


def _laws(results: Results) -> Iterator[tuple[str, str, str, str, list[str]]]:
    """For every law and cell: how many runs failed, the share's interval, and medians."""
    for (law, cell), rows in results.of_places.items():
        # Failures are the same in the rows of all metrics.
        first = next(iter(rows.values()))
        failed = f"{round(first['failed'] * first['n'])} of {first['n']}"
        share = Interval.of(first, "failed").ends(".3g%")
        yield law, cell, failed, share, results.medians(rows)


def runs_that(results: Results, are: Any) -> Rows:
    """The worst runs of every law of which this is true; `are` gives a mask (cell, draw) of a law.

    At most FIRST rows in all. The laws take turns, so that each has an equal share if it has as
    many.
    """
    runs = results.runs
    masks: dict[str, Mask] = {law: are(law) & runs.done(law) for law in runs.laws}
    # Sorted by rank first: the worst of each law, then the second of each.
    places = sorted(
        (rank, place, cell, draw)
        for place, law in enumerate(runs.laws)
        for rank, (cell, draw) in enumerate(_worst(runs, law, masks[law])[:FIRST].tolist())
    )[:FIRST]
    drawn = runs.drawn_quantities if places else {}
    rows = [
        _row(results, drawn, (runs.laws[place], cell, draw))
        for _, place, cell, draw in sorted(places, key=lambda found: found[1])
    ]
    return Rows(rows, sum(int(mask.sum()) for mask in masks.values()))


def _worst(runs: RunsTable, law: str, mask: Mask) -> Any:
    """Cell and draw (n, 2) of the runs in `mask` (cell, draw), the worst first.

    Those that ended first, then those that missed success by most.
    """
    cells, draws = np.nonzero(mask)
    finished = runs.finished(law)[mask]
    until = np.where(finished, 0.0, runs.until(law)[mask])
    missed = [-by[mask] for by in runs.shortfalls_of(law)]
    # The last key is the first criterion; cell and draw only settle ties.
    order = np.lexsort((cells, draws, *reversed(missed), until, finished))
    return np.column_stack([cells, draws])[order]


def _row(results: Results, drawn: Mapping[str, Any], place: tuple[str, int, int]) -> RunRow:
    """A row of the report's table of runs.

    `drawn` are the drawn quantities (draws,) by name, `place` is (law, cell, draw).
    """
    runs, (law, cell, draw) = results.runs, place
    until = float(runs.until(law)[cell, draw])
    status = STATUSES[int(runs.status(law)[cell, draw])]
    cause = runs.causes.get((runs.laws.index(law), cell, draw), "") or _short_of(
        results, law, cell, draw
    )
    ending = status if status == "finished" or np.isnan(until) else f"{status} at {until:.4g} s"
    others = [other for other in runs.laws if other != law]
    failing = sum(not runs.success(other)[cell, draw] for other in others)
    return RunRow(
        law,
        cell,
        runs.cells[cell],
        draw,
        ending,
        cause,
        f"{failing} of {len(others)}",
        ", ".join(f"{name} {drawn[name][draw]:.3g}" for name in _decisive(results, law, cell))
        or "-",
    )


def _decisive(results: Results, law: str, cell: int) -> list[str]:
    """At most DECISIVE drawn quantities that correlate most with the metric of success in a cell.

    Without one in the success, the first shown metric is taken. Correlations within chance are left
    out.
    """
    metric, label = (
        (*results.runs.success_metrics, *results.shown_metrics)[0],
        results.runs.cells[cell],
    )
    sizes = {
        row["quantity"]: size
        for row in results.tables.sensitivity
        if (row["law"], row["cell"], row["metric"]) == (law, label, metric)
        and (size := abs(row["correlation"])) > 0.0
        and not size <= row["by_chance"]  # which is NaN where draws are no random sample
    }
    return sorted(sizes, key=lambda quantity: -sizes[quantity])[:DECISIVE]


def _short_of(results: Results, law: str, cell: int, draw: int) -> str:
    """Why a run that finished is no success: the metrics that success depends on, with values."""
    reasons = [
        f"{name} = {results.runs.metric(law, name)[cell, draw]:.5g}"
        for name in results.runs.success_metrics
    ]
    return ", ".join(reasons)


def _pairs(results: Results) -> list[Any]:
    """The rows of the shown metrics, in their order."""
    rows = [{**row, "ratio": Interval.of(row, "ratio").text(".4g")} for row in results.tables.pairs]
    return [row for name in results.shown_metrics for row in rows if row["metric"] == name]


def _numbers(results: Results) -> list[list[str]]:
    """The table of quantiles of the shown metrics as text, the median with its interval."""
    return [
        [
            row["law"],
            row["cell"],
            row["metric"],
            row["unit"],
            *(digits(row[q], infinite=word) for q in ("q05", "q25")),
            Interval.of(row, "q50").text(infinite=word),
            *(digits(row[q], infinite=word) for q in ("q75", "q95")),
        ]
        for row in results.tables.summary
        if row["metric"] in results.shown_metrics
        for word in [results.known_metrics[row["metric"]].infinite]
    ]


def _varied_quantities(results: Results) -> list[tuple[str, str, str]]:
    """Every drawn quantity: its keys, how it is drawn, and the scenario's own values."""
    own, run = results.about.identity, f"{results.runs.laws[0]}[0]"
    return [
        (
            ", ".join(quantity.keys),
            quantity.drawn,
            ", ".join(_own(own.get(f"{run}.{key}")) for key in quantity.keys),
        )
        for quantity in results.about.quantities.values()
    ]


def _own(value: Any) -> str:
    """A scenario's own value, with the digits that a reader looks at."""
    return f"{value:.5g}" if isinstance(value, float) else value_text(value)


def _beside(figures: Sequence[Picture], laws: int) -> list[Picture]:
    """The first distribution, and the first ratios where these are few enough to stand there.

    `laws` is how many laws there are.
    """
    # Backwards, so that the first of a kind is the one that stays.
    first = {picture.name.partition("-")[0]: picture for picture in reversed(figures)}
    kinds = ("distribution", "ratios") if laws <= FEW else ("distribution",)
    return [first[kind] for kind in kinds if kind in first]


def _sessions(folder: Path) -> list[list[str]]:
    rows = [dict(flat(session)) for session in sessions(folder)]
    return [[value_text(session.get(key)) for key in SESSION] for session in rows]
