"""The HTML report of a study: one file that needs nothing else, the answer first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from podusv_cli.core.phrases import value_text
from podusv_cli.expressions.verdict import by_answer
from podusv_cli.pages.page import Picture, environment, flat
from podusv_cli.process.extras import Failure
from podusv_cli.studies.counting.runs import STATUSES, Mask
from podusv_cli.studies.counting.statistics import Interval, digits
from podusv_cli.studies.making.sessions import sessions
from podusv_cli.studies.telling.bars import bars
from podusv_cli.studies.telling.keep import Kept
from podusv_cli.studies.telling.results import Results

FEW = 5  # laws, whose pairs are no more than ten
FIRST = 20  # rows of a table of runs
SESSION = ("started", "duration_s", "runs", "podusv", "python", "platform.processor", "argv")


class Row(NamedTuple):
    """A run of a table: how it ended, when and why."""

    law: str
    cell: int
    label: str
    draw: int
    status: str
    until: str
    cause: str


class Rows(NamedTuple):
    """The first runs of a kind, and how many there are."""

    first: Sequence[Row]
    total: int


def page(
    folder: Path, results: Results, kept: Sequence[Kept], figures: Sequence[Picture],
    missing: Sequence[Failure],
) -> str:  # fmt: skip
    """The whole report."""
    about, beside = results.about, _beside(figures, len(results.runs.laws))
    ordered = [*beside, *(picture for picture in figures if picture not in beside)]
    numbered = [*enumerate(ordered, 1)]
    return environment("podusv_cli.studies.telling").get_template("study.html.j2").render(
        title=f"{about.name}: a study",
        folder=folder,
        results=results,
        about=about,
        several=len(results.runs.cells) > 1,
        answers=by_answer(results.verdicts),
        claims=[(v, [*bars(p, v)]) for p, v in zip(results.parsed, results.verdicts, strict=True)],
        laws=list(_laws(results)),
        broken=runs_that(results, results.runs.broken),
        failed=runs_that(results, results.runs.failed),
        pairs=_pairs(results),
        numbers=_numbers(results),
        metrics={name: results.known[name] for name in results.shown},
        varied=_varied(results),
        grid=[(key, ", ".join(given)) for key, given in about.grid.items()],
        kept=kept,
        beside=numbered[: len(beside)],
        figures=numbered,
        missing=[str(failure) for failure in missing],
        sittings=_sessions(folder),
        latest=[(key, value_text(value)) for key, value in flat((sessions(folder) or [{}])[-1])],
        first=FIRST,
    )  # fmt: skip


def _laws(results: Results) -> Iterator[tuple[str, str, str, str, list[str]]]:
    """For every law and cell: how many runs failed, the share's interval, and medians."""
    for (law, cell), rows in results.of_places.items():
        first = next(iter(rows.values()))
        failed = f"{round(first['failed'] * first['n'])} of {first['n']}"
        share = Interval.of(first, "failed").ends(".3g%")
        yield law, cell, failed, share, results.medians(rows)


def runs_that(results: Results, are: Any) -> Rows:
    """The runs of which this is true, by draw; `are` gives a mask (cell, draw) of a law."""
    runs = results.runs
    masks: dict[str, Mask] = {law: are(law) & runs.done(law) for law in runs.laws}
    places = sorted(
        (draw, cell, law)
        for law, mask in masks.items()
        for draw, cell in np.argwhere(mask.T)[:FIRST].tolist()
    )
    rows = [_row(results, law, cell, draw) for draw, cell, law in places[:FIRST]]
    return Rows(rows, sum(int(mask.sum()) for mask in masks.values()))


def _row(results: Results, law: str, cell: int, draw: int) -> Row:
    runs = results.runs
    until = float(runs.until(law)[cell, draw])
    status = STATUSES[int(runs.status(law)[cell, draw])]
    cause = runs.causes.get((runs.laws.index(law), cell, draw), "") or _short_of(
        results, law, cell, draw
    )
    end = "-" if np.isnan(until) else f"{until:.4g} s"
    return Row(law, cell, runs.cells[cell], draw, status, end, cause)


def _short_of(results: Results, law: str, cell: int, draw: int) -> str:
    """Why a run that finished is no success: the metrics that decide."""
    reasons = [
        f"{name} = {results.runs.metric(law, name)[cell, draw]:.5g}" for name in results.runs.asked
    ]
    return ", ".join(reasons)


def _pairs(results: Results) -> list[Any]:
    """The rows of the shown metrics, in their order."""
    rows = [{**row, "ratio": Interval.of(row, "ratio").text(".4g")} for row in results.tables.pairs]
    return [row for name in results.shown for row in rows if row["metric"] == name]


def _numbers(results: Results) -> list[list[str]]:
    """Quantiles of the shown metrics, the median with its interval."""
    return [
        [row["law"], row["cell"], row["metric"], row["unit"],
         *(digits(row[q], infinite=word) for q in ("q05", "q25")),
         Interval.of(row, "q50").text(infinite=word),
         *(digits(row[q], infinite=word) for q in ("q75", "q95"))]
        for row in results.tables.summary if row["metric"] in results.shown
        for word in [results.known[row["metric"]].infinite]
    ]  # fmt: skip


def _varied(results: Results) -> list[tuple[str, str, str]]:
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
    """The first distribution, and the first ratios where these are few enough to stand there."""
    first = {picture.name.partition("-")[0]: picture for picture in reversed(figures)}
    kinds = ("distribution", "ratios") if laws <= FEW else ("distribution",)
    return [first[kind] for kind in kinds if kind in first]


def _sessions(folder: Path) -> list[list[str]]:
    rows = [dict(flat(session)) for session in sessions(folder)]
    return [[value_text(session.get(key)) for key in SESSION] for session in rows]
