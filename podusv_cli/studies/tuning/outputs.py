"""The files of a search: tables, figures and the report."""

from __future__ import annotations

from pathlib import Path

from podusv_cli.pages.page import Picture
from podusv_cli.process.extras import Extras
from podusv_cli.storage import csv_files, files
from podusv_cli.studies.telling.outputs import DIGITS, publish
from podusv_cli.studies.tuning.results import SearchResults


def write_tables(folder: Path, results: SearchResults) -> None:
    """Write all tables. Raises StorageError."""
    tables = {
        "laws": results.laws,
        "searches": results.searches,
        "limits": results.limits,
        "validation": results.pairs,
        "gains": results.gains,
        "importance": results.importance,
        "history": results.history,
    }
    files.write_all(
        {folder / f"{n}.csv": csv_files.text(t, DIGITS).encode() for n, t in tables.items()}
    )


def write_report(folder: Path, results: SearchResults, extras: Extras, *, figures: bool) -> None:
    """Draw the figures and write the report; what fails is noted. Raises StorageError."""
    from podusv_cli.studies.tuning import report

    drawn, shown = dict[str, bytes](), list[Picture]()
    if figures:
        from podusv_cli.figures.sketch import render_sketches  # matplotlib is slow to import
        from podusv_cli.studies.tuning.figures import sketches

        drawn, shown = render_sketches(sketches(results), extras)
    page = extras.make_or_record(
        "report.html", lambda: report.page(folder, results, shown, extras.missing)
    )
    publish(folder, drawn, page, extras)
