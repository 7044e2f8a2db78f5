"""What a study says: its tables, verdicts and figures, and their files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from podusv_cli.core.errors import UsageError
from podusv_cli.metrics.metric import Metric
from podusv_cli.metrics.table import metrics_with
from podusv_cli.storage import files
from podusv_cli.storage.json_files import encode
from podusv_cli.study import claims, summary, verdict
from podusv_cli.study.plan import Plan
from podusv_cli.study.runs_file import Table
from podusv_cli.study.unit import STATUSES

ALWAYS = ("iae", "z_e_steady")  # metrics that the terminal shows beside those of claims
DEFAULT_MARGIN = 0.01  # relative, of pairs


@dataclass(frozen=True)
class Results:
    """The tables and verdicts of a study that is whole."""

    plan: Plan
    runs: Table
    summary: pd.DataFrame
    pairs: pd.DataFrame
    sensitivity: pd.DataFrame
    verdicts: Sequence[verdict.StudyVerdict]

    @property
    def broken(self) -> int:
        """How many runs crashed, hung or were invalid."""
        return sum(int(np.sum(self.runs.broken(law))) for law in self.runs.laws)

    @property
    def shown(self) -> list[str]:
        """The metrics that the answer is about: those of the claims, and the most common."""
        told = " ".join(claim.expect for claim in self.plan.sweep.claims.values())
        return [m for m in self.runs.metrics if m in ALWAYS or f".{m}" in told]

    def cells(self) -> tuple[list[str], list[list[str]]]:
        """Head and rows of the table on the terminal: failures and medians of every law."""
        head = ["law", "cell", "failed", *(f"{name}, median" for name in self.shown)]
        rows = []
        for law in self.runs.laws:
            for cell in self.runs.cells:
                mine = self.summary[(self.summary.law == law) & (self.summary.cell == cell)]
                rows.append([law, cell or "-", *self._row(mine.set_index("metric"))])
        return head, rows

    def _row(self, mine: pd.DataFrame) -> list[str]:
        first = mine.iloc[0]
        failed = f"{first.failed:.4g} [{first.failed_low:.3g}, {first.failed_high:.3g}]"
        return [failed, *(f"{mine.q50.get(name, np.nan):.5g}" for name in self.shown)]

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints."""
        return {
            "broken": self.broken,
            "summary": self.summary.to_dict("records"),
            "claims": [one.as_json() for one in self.verdicts],
        }


def judged(plan: Plan, runs: Table) -> Results:
    """All tables and verdicts of a study's runs."""
    sweep, known = plan.sweep, metrics_with(plan.scenario.plugged)
    return Results(
        plan, runs, summary.summary(runs, sweep.level, known),
        summary.pairs(runs, DEFAULT_MARGIN, sweep.level, known),
        summary.sensitivity(runs, runs.drawn, sweep.level, known),
        claims.judge(_parsed(plan, known), runs, sweep.level, known),
    )  # fmt: skip


def _parsed(plan: Plan, known: dict[str, Metric]) -> list[claims.ParsedClaim]:
    return [
        claims.ParsedClaim(name, claim, claims.parse(claim.expect, plan.laws, known))
        for name, claim in plan.sweep.claims.items()
    ]


def write(folder: Path, results: Results, *, figures: bool) -> None:
    """Write tables, verdicts, figures and the report into the study's folder."""
    told = {"claims": [one.as_json() for one in results.verdicts]}
    contents = {
        "summary.csv": summary.as_csv(results.summary).encode(),
        "pairs.csv": summary.as_csv(results.pairs).encode(),
        "sensitivity.csv": summary.as_csv(results.sensitivity).encode(),
        "claims.json": encode(told),
        "claims.md": verdict.as_markdown(results.verdicts).encode(),
    }
    files.write_all({folder / name: content for name, content in contents.items()})


def export(runs: Table, path: Path) -> None:
    """Write all runs as one table, a row a run: CSV, or Parquet where the name ends so."""
    frames = [
        _frame(runs, law, cell) for law in runs.laws for cell in range(len(runs.cells))
    ]  # fmt: skip
    whole = pd.concat(frames, ignore_index=True)
    if path.suffix == ".parquet":
        try:
            content = whole.to_parquet(index=False)
        except ImportError as error:
            raise UsageError(
                "Parquet needs pyarrow: pip install pyarrow; or export --format csv"
            ) from error
    else:
        content = whole.to_csv(index=False, lineterminator="\n").encode()
    files.write_bytes(path, content)


def _frame(runs: Table, law: str, cell: int) -> pd.DataFrame:
    done = runs.done(law)[cell]
    drawn = {name: values[done] for name, values in runs.drawn.items()}
    words = np.array(STATUSES)[runs.status(law)[cell][done]]
    numbers = {name: runs.metric(law, name)[cell][done] for name in runs.metrics}
    return pd.DataFrame(
        {"law": law, "cell": runs.cells[cell], "draw": np.flatnonzero(done), **drawn,
         "status": words, "success": runs.success(law)[cell][done], **numbers}
    )  # fmt: skip
