"""What a comparison found, and the files of its folder."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from podusv_cli.comparison import claims, report, table
from podusv_cli.core import json_text
from podusv_cli.core.about import MetricAbout, RunAbout
from podusv_cli.core.finding import Finding, merge_findings
from podusv_cli.core.past_run import PastRun
from podusv_cli.core.plugins import Plugins
from podusv_cli.figures import chase, traces
from podusv_cli.figures.shown import dress_runs
from podusv_cli.metrics.table import CLOCKED, METRICS
from podusv_cli.pages.page import Picture
from podusv_cli.process.extras import Extras
from podusv_cli.storage.run_folder import RunWriter

TABLE = "comparison.csv"
TIMING = "timing.json"
IN_REPORT = "png"  # the format of figures in report.html
# Names that no run may have: files of the comparison's folder and columns of its table.
RESERVED = (
    TABLE,
    "comparison.md",
    "comparison.tex",
    "claims.json",
    "claims.md",
    "figures",
    "manifest.json",
    "metric",
    "missing.json",
    "provenance.json",
    "report.html",
    TIMING,
    "unit",
)


@dataclass(frozen=True)
class Result:
    """What a comparison found.

    All but `runs`, those that have a log, are by label. An ending says why a run did not
    finish, "" if it did. Warnings and timings are those of the runs made for this comparison.
    """

    abouts: Mapping[str, RunAbout]
    runs: Sequence[PastRun]
    endings: Mapping[str, str]
    differences: Mapping[str, Mapping[str, Any]]
    table: table.MetricTable
    verdicts: Sequence[claims.RunsVerdict]
    timings: Mapping[str, Mapping[str, float]]
    warnings: Mapping[str, Sequence[Finding]]
    metrics: Mapping[str, MetricAbout] = field(default_factory=lambda: METRICS)  # of the table
    peaks: Mapping[str, float] = field(default_factory=dict)  # of signals, as claims name them
    chosen: Sequence[str] = ()  # metrics that tables for readers are to have; none: all, headlines
    ratios: bool = False  # whether comparison.tex has those to the first run
    doubts: Sequence[Sequence[str]] = ()  # head and rows of what verdicts hang on, if asked for
    plugins: Plugins = ()  # of all runs
    meanings: Mapping[str, str] = field(default_factory=dict)  # of the codes of warnings

    @property
    def unsettled_runs(self) -> list[str]:
        """The runs that do not end at their target, which no table ranks."""
        return [run.label for run in self.runs if run.off_target]


def write(writer: RunWriter, result: Result, extras: Extras) -> None:
    """Write table and verdicts in every form into the comparison's folder."""
    for name, form in _forms(result).items():
        add_made(writer, extras, name, form)


def _forms(result: Result) -> dict[str, Callable[[], bytes]]:
    """A function for each file that makes its content, by the file's name.

    Clock readings have a file of their own, so that all others come out the same every time.
    """
    lasting = result.table.only(result.table.rows.keys() - CLOCKED)
    headlines = [name for name in lasting.rows if result.metrics[name].headline]
    times = table.numbers(result.table.only(CLOCKED))
    judged = [verdict for verdict in result.verdicts if not verdict.timed]
    timed = [verdict for verdict in result.verdicts if verdict.timed]
    forms: dict[str, Callable[[], bytes]] = {
        TABLE: lambda: table.as_csv(lasting, result.metrics).encode(),
        "comparison.md": lambda: table.as_markdown(
            lasting, result.endings, result.metrics, result.unsettled_runs, chosen=result.chosen
        ).encode(),
        "comparison.tex": lambda: table.as_latex(
            lasting,
            result.metrics,
            result.unsettled_runs,
            chosen=result.chosen or headlines,
            ratios=result.ratios,
        ).encode(),
        TIMING: lambda: json_text.encode({**_claims(timed), "metrics": times}),
    }
    if result.verdicts:
        forms["claims.md"] = lambda: claims.with_timed(judged, timed, TIMING).encode()
        forms["claims.json"] = lambda: json_text.encode(_claims(judged))
    return forms


def _claims(verdicts: Iterable[claims.RunsVerdict]) -> dict[str, Any]:
    return {"format": 1, "claims": [verdict.as_json() for verdict in verdicts]}


def add_made(writer: RunWriter, extras: Extras, name: str, form: Callable[[], bytes]) -> None:
    """Write what `form` returns into a file of the folder; if it fails, `extras` notes it."""
    content = extras.make_or_record(name, form)
    if content is not None:
        writer.add(name, content)


def draw_comparison(
    result: Result,
    extras: Extras,
    progress: Callable[[str, float], None] | None = None,
    names: Sequence[str] = (),
    formats: Sequence[str] = ("png",),
    workers: int = 0,
) -> dict[str, bytes]:
    """The figures of all runs together by file name: as asked, and as PNGs for the report.

    `names` are those of figures, as `choose_sheets` takes them. `progress` is called with a text
    and the fraction done. `workers` processes draw at a time (0: one a core).
    """
    # matplotlib is slow to import
    from podusv_cli.figures.drawing import PHONE, choose_sheets, draw_in_parallel

    tell = partial(progress or (lambda what, fraction: None), "drawing figures")
    tell(0.0)
    shown = dress_runs(result.runs, result.peaks)
    sheets = choose_sheets(names, shown, extras)
    formats = tuple(dict.fromkeys((*formats, IN_REPORT, PHONE)))
    return draw_in_parallel(shown, sheets, formats, extras, progress=tell, workers=workers)


def as_report(
    result: Result,
    title: str,
    figures: Mapping[str, bytes],
    provenance: Mapping[str, Any],
    missing: Iterable[object] = (),
) -> str:
    """The HTML report; `figures` are the files of `draw_comparison`, `missing` what failed.

    `title` is its heading, `provenance` that of the comparison.
    """
    pictures: list[Picture] = []
    if figures:
        from podusv_cli.figures.drawing import PHONE, figures_of  # matplotlib is slow to import

        # the figures that podusv draws again are those of one paper
        of_paper = any(about.polar for about in result.abouts.values())
        pictures = [
            Picture(
                name,
                sheet.caption,
                figures[f"{name}.{IN_REPORT}"],
                sheet.source if of_paper else "",
                figures[f"{name}.{PHONE}"],
            )
            for name, sheet in figures_of([result.plugins]).items()
            if f"{name}.{IN_REPORT}" in figures
        ]
    shown = dress_runs(result.runs)
    story = report.Story(
        title=title,
        abouts=result.abouts,
        meanings=result.meanings,
        endings=result.endings,
        missing=[str(part) for part in missing],
        differences=result.differences,
        noticed=merge_findings(result.warnings),
        table=result.table,
        verdicts=result.verdicts,
        theories={run.label: run.theory for run in result.runs if run.theory},
        figures=pictures,
        provenance=provenance,
        chase=chase.chase(shown),
        traces=traces.traces(shown),
        metrics=result.metrics,
        unsettled=result.unsettled_runs,
        doubts=result.doubts,
    )
    return report.page(story)
