"""The files of a bench's folder: tables, leaderboard, figures and page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from podusv_cli.pages.page import Picture
from podusv_cli.process.extras import Extras
from podusv_cli.storage import csv_files
from podusv_cli.storage.run_folder import RunWriter
from podusv_cli.studies.bench import optima, page
from podusv_cli.studies.bench.optima import Least
from podusv_cli.studies.bench.runs import BenchRun

RUNS, BOARD, REPORT = "runs.csv", "leaderboard.md", "report.html"
OPTIMA = "optima.csv"
DIGITS = "%.6g"


def draw_figures(runs: Sequence[BenchRun], made: pd.DataFrame, extras: Extras) -> list[Picture]:
    """All figures of a bench; one that cannot be drawn is noted in `extras`.

    `made` is `standing.table` of the runs.
    """
    from podusv_cli.figures.sketch import render_sketches
    from podusv_cli.studies.bench.figures import sketches  # matplotlib is slow to import

    return render_sketches(sketches(runs, made), extras)[1]


def write_files(
    writer: RunWriter,
    made: pd.DataFrame,
    figures: Sequence[Picture],
    provenance: Mapping[str, Any],
    solved: Sequence[Least],
) -> None:
    """Write everything but provenance.json and the manifest. Raises StorageError.

    `made` is `standing.table` of the runs, `solved` the optima; their file is written if there are
    any.
    """
    writer.add(RUNS, _csv(made))
    writer.add(BOARD, page.as_markdown(made).encode())
    writer.add(REPORT, page.page(made, figures, provenance, solved).encode())
    if solved:
        writer.add(OPTIMA, _csv(optima.table(solved)))
    for figure in figures:
        writer.add(f"figures/{figure.name}.png", figure.file)


def _csv(rows: pd.DataFrame) -> bytes:
    return csv_files.text(rows, DIGITS).encode()
