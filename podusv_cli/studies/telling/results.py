"""What a study says: the tables and verdicts of its runs."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from podusv_cli.core.about import MetricAbout, StudyAbout
from podusv_cli.studies.counting import claims, verdict
from podusv_cli.studies.counting.runs_file import RunsTable
from podusv_cli.studies.counting.statistics import Interval, digits
from podusv_cli.studies.telling import summary

if TYPE_CHECKING:
    import pandas as pd

ALWAYS = ("iae", "z_e_steady", "e_ct_rms")  # metrics that the answer has beside those of claims
MARGIN = 0.01  # relative, of pairs


class Tables(NamedTuple):
    """The rows of the tables of `summary`; pandas, which is slow to import, need not have them."""

    summary: summary.Rows
    pairs: summary.Rows
    sensitivity: summary.Rows


@dataclass(frozen=True)
class Results:
    """The tables and verdicts of a study's runs, as far as these are made."""

    about: StudyAbout
    runs: RunsTable
    tables: Tables
    parsed: Sequence[claims.ParsedStudyClaim]
    verdicts: Sequence[verdict.StudyVerdict]
    contradicted: str = ""  # why no claim is judged: a kept log has other numbers than the table

    @property
    def known_metrics(self) -> Mapping[str, MetricAbout]:
        """All metrics, with those of plug-ins."""
        return self.about.metrics

    @cached_property
    def summary(self) -> pd.DataFrame:
        """A row for each law, cell and metric."""
        return _frame(self.tables.summary)

    @cached_property
    def pairs(self) -> pd.DataFrame:
        """A row for each metric, cell and pair of laws."""
        return _frame(self.tables.pairs)

    @cached_property
    def sensitivity(self) -> pd.DataFrame:
        """A row for each law, cell, quantity and metric."""
        return _frame(self.tables.sensitivity)

    @cached_property
    def of_places(self) -> dict[tuple[str, str], dict[str, dict[str, Any]]]:
        """The rows of the summary by law and cell, and there by metric."""
        places: dict[tuple[str, str], dict[str, dict[str, Any]]] = {}
        for row in self.tables.summary:
            places.setdefault((row["law"], row["cell"]), {})[row["metric"]] = row
        return places

    @cached_property
    def broken_runs(self) -> int:
        """How many runs crashed, hung or were invalid."""
        return sum(int(np.sum(self.runs.broken(law))) for law in self.runs.laws)

    @cached_property
    def made_runs(self) -> int:
        """How many runs there are."""
        return sum(int(np.sum(self.runs.tried(law))) for law in self.runs.laws)

    @property
    def preliminary(self) -> str:
        """How many draws the answer is about, as a phrase; "" where no run is missing."""
        if self.made_runs == self.wanted_runs:
            return ""
        draws, laws = int(np.sum(self.runs.common, axis=1).min()), len(self.runs.laws)
        cells = " of each cell" if len(self.runs.cells) > 1 else ""
        of = f"that all {laws} laws have" if laws > 1 else "that are made"
        return f"preliminary: {draws:,} of {self.runs.wanted:,} draws{cells} {of}"

    @property
    def wanted_runs(self) -> int:
        """How many runs were asked for."""
        return len(self.runs.laws) * len(self.runs.cells) * self.runs.wanted

    @property
    def level(self) -> float:
        """The confidence of all intervals; NaN where the draws allow none."""
        return self.about.level if self.about.independent else np.nan

    @property
    def shown_metrics(self) -> list[str]:
        """The metrics that the answer is about: those of the claims, and the most common.

        Runs without any of the most common, as manoeuvring trials are, have those that a reader
        sees first in their place; such metrics always come before the others.
        """
        expected = " ".join(claim.expect for claim in self.about.claims.values())
        gathered = self.runs.metrics
        headlines = [m for m in gathered if self.known_metrics[m].headline]
        usual = [m for m in gathered if m in ALWAYS] or headlines
        shown = [m for m in gathered if m in usual or re.search(rf"\.{re.escape(m)}\b", expected)]
        return sorted(shown, key=lambda name: not self.known_metrics[name].headline)

    def without_verdicts(self, contradicted: str) -> Results:
        """The tables alone, where the runs are not what their logs say."""
        return replace(self, parsed=(), verdicts=(), contradicted=contradicted)

    def cells(self) -> tuple[list[str], list[list[str]]]:
        """Head and rows of the answer's table as text.

        A row has the share of failures and the medians of a law (and cell).
        """
        several, about = (
            len(self.runs.cells) > 1,
            [self.known_metrics[name] for name in self.shown_metrics],
        )
        medians = (f"median of {metric.row} [{metric.unit}]" for metric in about)
        head = ["law", *(["cell"] if several else []), "failed", *medians]
        rows = []
        for law in self.runs.laws:
            for cell in self.runs.cells:
                place = [law, cell] if several else [law]
                rows.append([*place, *self._row(self.of_places.get((law, cell), {}))])
        return head, rows

    def _row(self, mine: Mapping[str, Mapping[str, Any]]) -> list[str]:
        """A law's share of failures and medians as text; `mine` are its summary rows by metric."""
        if not mine:  # no run yet
            return ["-"] * (1 + len(self.shown_metrics))
        failed = f"{Interval.of(next(iter(mine.values())), 'failed'):.3g%}"
        return [failed, *self.medians(mine)]

    def medians(self, mine: Mapping[str, Mapping[str, Any]]) -> list[str]:
        """Medians of the shown metrics as text, a dash where there is none.

        `mine` are the summary rows of one law and cell, by metric.
        """
        return [
            digits(number, infinite=self.known_metrics[name].infinite)
            for name in self.shown_metrics
            for number in [mine[name]["q50"] if name in mine else np.nan]
        ]

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints."""
        return {
            "preliminary": self.preliminary,
            "broken": self.broken_runs,
            "contradicted": self.contradicted,
            "summary": self.tables.summary,
            "claims": [verdict.as_json() for verdict in self.verdicts],
        }


def judge_study(about: StudyAbout, runs: RunsTable) -> Results:
    """All tables and verdicts of a study's runs.

    There are no intervals where draws are not independent.
    """
    level, known = about.level, about.metrics
    parsed = [
        claims.ParsedStudyClaim(name, claim, claims.parse(claim.expect, about.laws, known))
        for name, claim in about.claims.items()
    ]
    # The size of a seed means nothing, so it correlates with nothing.
    numbers = {
        q: values for q, values in runs.drawn_quantities.items() if not about.quantities[q].is_seed
    }
    tables = Tables(
        summary.summary(runs, level, known),
        summary.pairs(runs, MARGIN, level, known),
        summary.sensitivity(runs, numbers, level, known),
    )
    if not about.independent:
        tables = Tables(*map(summary.without_intervals, tables))
    verdicts = claims.judge(parsed, runs, level, known)
    return Results(about, runs, tables, parsed, verdicts)


def _frame(rows: summary.Rows) -> pd.DataFrame:
    """Rows as a table of pandas."""
    import pandas as pd  # slow to import

    return pd.DataFrame(rows)
