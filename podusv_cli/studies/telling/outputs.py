"""The files of a study: tables, verdicts, figures, the report, and exports of all runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from podusv_cli.core.errors import UsageError
from podusv_cli.core.escaping import markdown
from podusv_cli.core.json_text import encode
from podusv_cli.expressions.verdict import as_markdown
from podusv_cli.pages.page import Picture, sentence
from podusv_cli.process.extras import Extras
from podusv_cli.storage import csv_files, files
from podusv_cli.storage.run_folder import MISSING
from podusv_cli.studies.counting.runs import AXES, ENDING, STATUSES
from podusv_cli.studies.counting.runs_file import RunsTable
from podusv_cli.studies.making.sessions import timing
from podusv_cli.studies.telling.keep import Kept, distance_curves
from podusv_cli.studies.telling.results import Results

if TYPE_CHECKING:
    import pandas as pd

DIGITS = "%.6g"  # of numbers in tables
FIGURES, REPORT = "figures", "report.html"


def write_tables(folder: Path, results: Results) -> None:
    """Write tables and verdicts into the study's folder. Raises StorageError."""
    answer = {"format": 1, "claims": [verdict.as_json() for verdict in results.verdicts]}
    judged = as_markdown(results.verdicts)
    if results.contradicted:
        answer["contradicted"] = results.contradicted
        judged = f"{markdown(sentence(results.contradicted))}\n"
    contents = {
        **{
            f"{name}.csv": csv_files.records(rows, DIGITS).encode()
            for name, rows in results.tables._asdict().items()
        },
        "claims.json": encode(answer),
        "claims.md": judged.encode(),
        "timing.json": encode(timing(folder)),
    }
    files.write_all({folder / name: content for name, content in contents.items()})


def write_report(
    folder: Path, results: Results, kept: Sequence[Kept], extras: Extras, *, figures: bool
) -> None:
    """Draw the figures and write report.html and figures/. Raises StorageError.

    `kept` are the runs with logs, whose distances become a figure. A figure or page that fails is
    noted in `extras`, and then listed in the file of missing things. Files of an earlier report
    that are not made again are removed, since they would show other runs.
    """
    from podusv_cli.studies.telling import report

    drawn, shown = dict[str, bytes](), list[Picture]()
    if figures:
        from podusv_cli.figures.sketch import render_sketches  # matplotlib is slow to import
        from podusv_cli.studies.telling.figures import sketches

        drawn, shown = render_sketches(sketches(results, distance_curves(kept, extras)), extras)
    page = extras.make_or_record(
        REPORT, lambda: report.page(folder, results, kept, shown, extras.missing)
    )
    publish(folder, drawn, page, extras)


def publish(folder: Path, drawn: dict[str, bytes], page: str | None, extras: Extras) -> None:
    """Write figures (`drawn`, by name), the report `page` and what is missing.

    They replace earlier ones. Without a page (None), an old one is removed.
    """
    _replace(folder / FIGURES, drawn)
    _replace(folder, {REPORT: (page or "").encode()} if page else {}, (REPORT,))
    missing = {MISSING: encode(extras.as_json())} if extras.missing else {}
    _replace(folder, missing, (MISSING,))


def _replace(folder: Path, contents: dict[str, bytes], only: Sequence[str] = ()) -> None:
    """Write `contents` into a folder and remove older files that are not among them.

    Older files are those named in `only`, or else all PNG files there.
    """
    if contents:
        files.make_folder(folder)
        files.write_all({folder / name: content for name, content in contents.items()})
    old = [folder / name for name in only] if only else sorted(folder.glob("*.png"))
    with files.storage_errors(f"cannot remove old files in {folder}"):
        for path in old:
            if path.name not in contents:
                path.unlink(missing_ok=True)


def export(runs: RunsTable, path: Path) -> None:
    """Write all runs as one table, a row a run: CSV, or Parquet where the name ends so."""
    whole = as_frame(runs)
    if path.suffix == ".parquet":
        try:
            content = whole.to_parquet(index=False)
        except ImportError as error:
            raise UsageError(
                "Parquet needs pyarrow: pip install pyarrow; or export --format csv"
            ) from error
    else:
        content = csv_files.text(whole).encode()
    files.write_bytes(path, content)


def as_frame(runs: RunsTable) -> pd.DataFrame:
    """Every run that is made as a row: law, cell, draw, drawn quantities, ending, metrics."""
    frames = [_frame(runs, law, cell) for law in runs.laws for cell in range(len(runs.cells))]
    import pandas as pd  # slow to import

    return pd.concat(frames, ignore_index=True)


def _frame(runs: RunsTable, law: str, cell: int) -> pd.DataFrame:
    """A row for each draw of a law and cell that was tried: place, draw, ending, metrics."""
    done = runs.tried(law)[cell]
    import pandas as pd  # slow to import

    drawn = {name: values[done] for name, values in runs.drawn_quantities.items()}
    words = np.array(STATUSES)[runs.status(law)[cell][done]]
    numbers = {name: runs.metric(law, name)[cell][done] for name in runs.metrics}
    place = zip(AXES, (law, runs.cells[cell], np.flatnonzero(done)), strict=True)
    ending = zip(ENDING, (words, runs.success(law)[cell][done]), strict=True)
    return pd.DataFrame({**dict(place), **drawn, **dict(ending), **numbers})
