"""Several runs made side by side, and what they say together written into one folder."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from podusv_cli.comparison import claims, report, table
from podusv_cli.comparison.differences import differences
from podusv_cli.comparison.entries import Absent, Entry
from podusv_cli.config.loading import load_text
from podusv_cli.config.scenario import Claim, Scenario
from podusv_cli.findings.finding import Finding
from podusv_cli.logbook.folder import Run, RunWriter, open_run
from podusv_cli.metrics.cost import law_costs
from podusv_cli.parallel import INTERRUPTED, Outcome, run_all
from podusv_cli.recording import Status
from podusv_cli.running import Finished, Task, execute, warm_up


@dataclass(frozen=True)
class Part:
    """One run of a comparison: to be made from a scenario, or there already."""

    label: str
    scenario: Scenario
    text: str = ""
    run: Run | None = None
    noticed: Sequence[Finding] = ()  # before the run


@dataclass(frozen=True)
class Result:
    """What a comparison found. `endings` says for each run why it did not finish, "" if it did."""

    entries: Sequence[Entry]
    endings: Mapping[str, str]
    differences: Mapping[str, Mapping[str, Any]]
    table: pd.DataFrame
    verdicts: Sequence[claims.Verdict]
    timings: Mapping[str, Mapping[str, float]]
    warnings: Mapping[str, Sequence[Finding]]  # of the runs that were made

    @property
    def status(self) -> Status:
        """Interrupted when a run was, else finished, whatever became of the runs."""
        cut = any(entry.recording.status == "interrupted" for entry in self.entries)
        return "interrupted" if cut or INTERRUPTED in self.endings.values() else "finished"


def from_folder(path: Path) -> list[Part]:
    """The finished runs of a folder: one run, or all those of a comparison."""
    children = path.iterdir() if path.is_dir() else ()
    inner = sorted((c for c in children if (c / "log.h5").is_file()), key=_place(path))
    return [_from_run(child) for child in (inner or [path])]


def _place(comparison: Path) -> Callable[[Path], tuple[int, str]]:
    """Where a run stands in a comparison: as in its table, else by name."""
    table_file = comparison / "comparison.csv"
    head = table_file.read_text().partition("\n")[0] if table_file.is_file() else ""
    order = {label: place for place, label in enumerate(head.split(","))}
    return lambda run: (order.get(run.name, len(order)), run.name)


def _from_run(path: Path) -> Part:
    run = open_run(path)
    scenario = load_text(run.resolved_yaml, str(path / "resolved.yaml")).scenario
    return Part(path.name, scenario, run=run)


def distinct(parts: Iterable[Part]) -> list[Part]:
    """The parts with labels that tell them apart."""
    found: dict[str, Part] = {}
    for part in parts:
        label, count = part.label, 1
        while label in found:
            count += 1
            label = f"{part.label}_{count}"
        found[label] = replace(part, label=label)
    return list(found.values())


def make_runs(
    parts: Sequence[Part], folder: Path, *, figures: bool, argv: Sequence[str],
    progress: Callable[[str, float], None] | None = None,
) -> dict[str, Outcome]:  # fmt: skip
    """Execute the parts that are scenarios, in parallel, each into its own folder in `folder`."""
    wanted = [part for part in parts if part.run is None]
    for part in wanted:
        warm_up(part.scenario)
    tasks = [
        Task(
            part.scenario,
            part.text,
            folder / part.label,
            figures=("controls",) if figures else (),
            argv=argv,
            label=part.label,
            noticed=part.noticed,
        )
        for part in wanted
    ]

    def tell(position: int, fraction: float) -> None:
        if progress:
            progress(wanted[position].label, fraction)

    outcomes = run_all([partial(execute, task) for task in tasks], tell)
    return {part.label: outcome for part, outcome in zip(wanted, outcomes, strict=True)}


def collect(
    parts: Sequence[Part], outcomes: Mapping[str, Outcome], stated: Mapping[str, Claim]
) -> Result:
    """Open the runs that were made, and compare."""
    entries: list[Entry] = []
    endings, timings, warnings = {}, {}, {}
    for part in parts:
        outcome = outcomes.get(part.label, Outcome())
        done: Finished | None = outcome.result
        run = open_run(done.folder) if done else part.run
        endings[part.label] = outcome.failure or (run.recording.message if run else "")
        if run:
            entries.append(Entry(part.label, run, part.scenario))
        if done:
            timings[part.label], warnings[part.label] = done.timing, done.warnings
    entries = _timed(entries)
    sources = {part.label: Absent() for part in parts} | {e.label: e for e in entries}
    differing = differences({part.label: part.scenario.model_dump() for part in parts})
    measured = {entry.label: {n: entry.metric(n) for n in entry.run.metrics} for entry in entries}
    verdicts = claims.judge(stated, sources)
    return Result(entries, endings, differing, table.table(measured), verdicts, timings, warnings)


def _timed(entries: Sequence[Entry]) -> list[Entry]:
    """The entries with the laws' cost measured here and now, side by side.

    What a run measured for itself stems from another moment, perhaps another machine.
    """
    timed = [e for e in entries if e.scenario.simulation.compiled and len(e.recording["time"])]
    costs = law_costs([(e.scenario.closed_loop(), e.recording) for e in timed])
    by_label = {entry.label: cost for entry, cost in zip(timed, costs, strict=True)}
    return [replace(entry, cost=by_label.get(entry.label, {})) for entry in entries]


def numbers(frame: pd.DataFrame) -> dict[str, dict[str, float | None]]:
    """The table as plain data: metric, run, number or None."""
    return {
        str(name): {str(label): None if math.isnan(x) else float(x) for label, x in row.items()}
        for name, row in frame.iterrows()
    }


def write(writer: RunWriter, result: Result) -> None:
    """Table and verdicts, in every form, into the comparison's folder."""
    forms = {
        "comparison.csv": table.as_csv(result.table),
        "comparison.md": table.as_markdown(result.table),
        "comparison.tex": table.as_latex(result.table),
    }
    for name, text in forms.items():
        writer.add(name, text.encode())
    if result.verdicts:
        writer.add("claims.md", claims.as_markdown(result.verdicts).encode())
        verdicts = [verdict.as_json() for verdict in result.verdicts]
        writer.add_json("claims.json", {"format": 1, "claims": verdicts})


def draw_all(writer: RunWriter, result: Result, title: str, provenance: Mapping[str, Any]) -> None:
    """Shared figures in every format, and the report."""
    # matplotlib is slow to import
    from podusv_cli.figures.drawing import FIGURES, draw_in_parallel, dressed
    from podusv_cli.figures.style import FORMATS

    shown = dressed([(e.label, e.recording, e.scenario) for e in result.entries])
    drawn = dict(draw_in_parallel(shown, FIGURES, FORMATS))
    for name, content in drawn.items():
        writer.add(f"figures/{name}", content)
    pictures = [
        (name, sheet.caption, drawn[f"{name}.svg"])
        for name, sheet in FIGURES.items()
        if f"{name}.svg" in drawn
    ]
    first = result.entries[0].scenario
    story = report.Story(
        title=title, scenario=first,
        controllers={e.label: e.scenario.controller for e in result.entries},
        endings=result.endings, differences=result.differences, table=result.table,
        verdicts=result.verdicts, figures=pictures, provenance=provenance,
    )  # fmt: skip
    writer.add("report.html", report.page(story).encode())
