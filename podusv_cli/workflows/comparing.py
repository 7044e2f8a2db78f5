"""Several runs made side by side, and what they say together written into one folder."""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from podusv_cli.comparison import claims, report, stability, table
from podusv_cli.comparison.differences import differences
from podusv_cli.comparison.entries import Absent, Entry
from podusv_cli.comparison.expressions import Source
from podusv_cli.core.errors import StorageError
from podusv_cli.core.finding import Finding
from podusv_cli.findings.preflight import together
from podusv_cli.metrics.cost import law_costs
from podusv_cli.metrics.table import CLOCKED
from podusv_cli.process.extras import Extras
from podusv_cli.process.interrupts import interrupts_heard
from podusv_cli.process.workers import Outcome, run_all
from podusv_cli.scenario.load import load_resolved
from podusv_cli.scenario.messages import Check
from podusv_cli.scenario.model import Scenario
from podusv_cli.storage import json_files, log_check, manifest
from podusv_cli.storage.files import read_text
from podusv_cli.storage.run_folder import LOG, THEORY, Run, RunWriter, open_run
from podusv_cli.workflows.execute import Finished, Task, execute, warm_up

TABLE = "comparison.csv"
TIMING = "timing.json"
# What a comparison has of its own: in its folder, or as a column of its table.
RESERVED = (
    TABLE, "comparison.md", "comparison.tex", "claims.json", "claims.md", "figures",
    "manifest.json", "metric", "missing.json", "provenance.json", "report.html", TIMING, "unit",
)  # fmt: skip
UNMEASURED = dict.fromkeys(CLOCKED, math.nan)


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
    """What a comparison of these parts found; `entries` are those that left a run.

    `endings` says for each part why it did not finish, "" if it did.
    """

    parts: Sequence[Part]
    entries: Sequence[Entry]
    endings: Mapping[str, str]
    differences: Mapping[str, Mapping[str, Any]]
    table: pd.DataFrame
    verdicts: Sequence[claims.Verdict]
    timings: Mapping[str, Mapping[str, float]]
    warnings: Mapping[str, Sequence[Finding]]  # by run; none of those that were there


def from_folder(path: Path, checks: Sequence[Check] = ()) -> list[Part]:
    """The finished runs of a folder: one run, or all those of a comparison.

    `checks` as `load` has them. Raises UsageError where it is nothing of the kind, StorageError
    where it is damaged.
    """
    inner = _listed(path) if os.path.lexists(path / manifest.NAME) else _found(path)
    if not inner:
        manifest.demand(path)
    return [_from_run(child, checks) for child in (inner or [path])]


def _found(path: Path) -> list[Path]:
    """Run folders that somebody put into a folder; links lead elsewhere and do not count."""
    children = sorted(path.iterdir()) if path.is_dir() else ()
    return [c for c in children if not c.is_symlink() and os.path.lexists(c / LOG)]


def _listed(path: Path) -> list[Path]:
    """The runs of a finished comparison, as in its table, else by name; none in a single run."""
    files = manifest.check(path).files
    runs = sorted(name.removesuffix(f"/{LOG}") for name in files if name.endswith(f"/{LOG}"))
    head = _first_row(path / TABLE) if TABLE in files else []
    runs.sort(key=lambda run: head.index(run) if run in head else len(head))
    return [path / run for run in runs]


def _first_row(path: Path) -> list[str]:
    try:
        return next(csv.reader(read_text(path).splitlines()[:1]), [])
    except csv.Error as error:
        raise StorageError(f"cannot read {path}: no CSV ({error})") from error


def _from_run(path: Path, checks: Sequence[Check]) -> Part:
    """A run, opened with all that may be asked of it later. Raises StorageError, ScenarioError."""
    run = open_run(path)
    scenario = load_resolved(run.resolved_yaml, str(path / "resolved.yaml"), checks)
    if wrong := log_check.fault(run.recording):
        raise StorageError(f"{path / LOG}: damaged, or not a log of a run: {wrong}")
    stability.check(run.theory, run.folder / THEORY)
    return Part(path.name, scenario, run=run)


def comparable(path: Path) -> list[Part]:
    """The finished runs of a folder, as `from_folder`, with all that their laws are timed with."""
    parts = from_folder(path)
    for part in parts:
        if part.run:
            _check_memory(part.run, part.scenario)
    return parts


def _check_memory(run: Run, scenario: Scenario) -> None:
    log = run.recording
    slots = {part.name: size for part, size in scenario.closed_loop().controller.slots()}
    for name, size in slots.items():
        if name not in log or math.prod(log[name].shape[1:]) != size:
            raise StorageError(
                f"{run.folder / LOG}: damaged, or not of the scenario beside it: "
                f"{name} does not have {size} values in a row"
            )


def distinct(parts: Iterable[Part]) -> list[Part]:
    """The parts, in order, with labels that tell them apart."""
    parts = list(parts)
    labels = told_apart([part.label for part in parts], taken=RESERVED)
    return [replace(part, label=label) for part, label in zip(parts, labels, strict=True)]


def told_apart(names: Iterable[str], taken: Iterable[str] = ()) -> list[str]:
    """The names, with a number after those that are taken or came before.

    Names that differ in case alone are the same to some disks.
    """
    found, taken = list[str](), {name.casefold() for name in taken}
    for name in names:
        label, count = name, 1
        while label.casefold() in taken:
            count += 1
            label = f"{name}_{count}"
        taken.add(label.casefold())
        found.append(label)
    return found


def make_runs(
    parts: Sequence[Part], folder: Path, *, figures: bool, argv: Sequence[str],
    progress: Callable[[str, float], None] | None = None,
) -> dict[str, Outcome]:  # fmt: skip
    """Execute the parts that are scenarios, in parallel, each into its own folder in `folder`."""
    wanted = [part for part in parts if part.run is None]
    with interrupts_heard():
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
    parts: Sequence[Part], outcomes: Mapping[str, Outcome],
    stated: Sequence[claims.Stated], extras: Extras,
) -> Result:  # fmt: skip
    """Open the runs that were made, and compare; costs and verdicts are `extras`.

    What the runs lack is missing in the comparison, too.
    """
    entries: list[Entry] = []
    endings, timings, warnings = {}, {}, {}
    for part in parts:
        outcome = outcomes.get(part.label, Outcome())
        done: Finished | None = outcome.result
        run = open_run(done.folder) if done else part.run
        endings[part.label] = outcome.failure or (run.recording.message if run else "")
        if run:
            entries.append(Entry(part.label, run, part.scenario))
        warnings[part.label] = done.warnings if done else part.noticed
        if done:
            timings[part.label] = done.timing
            lacks = (replace(m, what=f"{part.label}: {m.what}") for m in done.missing)
            extras.missing += lacks
    entries = _with_costs(entries, extras)
    sources: dict[str, Source] = {e.label: e for e in entries}
    for part in parts:
        sources.setdefault(part.label, Absent(part.scenario, endings[part.label]))
    differing = differences({part.label: part.scenario.model_dump() for part in parts})
    measured: dict[str, dict[str, float]] = {part.label: {} for part in parts}
    for entry in entries:
        names = dict.fromkeys([*entry.run.metrics, *entry.cost])
        measured[entry.label] = {name: entry.metric(name) for name in names}
    verdicts = extras.made("the claims' verdicts", lambda: claims.judge(stated, sources)) or []
    compared = table.table(measured)
    return Result(parts, entries, endings, differing, compared, verdicts, timings, warnings)


def _with_costs(entries: list[Entry], extras: Extras) -> list[Entry]:
    """The entries with the laws' cost measured here and now, side by side.

    What a run measured for itself stems from another moment, perhaps another machine: without
    these costs there are none.
    """
    timed = [e for e in entries if e.scenario.simulation.compiled and len(e.recording["time"])]
    loops = [(entry.scenario.closed_loop(), entry.recording) for entry in timed]
    costs = extras.attempt("law_ns", lambda: law_costs(loops)) or [UNMEASURED] * len(timed)
    by_label = {entry.label: cost for entry, cost in zip(timed, costs, strict=True)}
    return [replace(entry, cost=by_label.get(entry.label, UNMEASURED)) for entry in entries]


def write(writer: RunWriter, result: Result, extras: Extras) -> None:
    """Table and verdicts, in every form, into the comparison's folder."""
    for name, form in _forms(result).items():
        add_made(writer, extras, name, form)


def _forms(result: Result) -> dict[str, Callable[[], bytes]]:
    """What makes each file of a comparison, by its name.

    What a clock read has a file of its own: all others come out the same every time.
    """
    clocked = result.table.index.isin(CLOCKED)
    lasting, times = result.table[~clocked], table.numbers(result.table[clocked])
    judged = [verdict for verdict in result.verdicts if not verdict.timed]
    timed = [verdict for verdict in result.verdicts if verdict.timed]
    forms: dict[str, Callable[[], bytes]] = {
        TABLE: lambda: table.as_csv(lasting).encode(),
        "comparison.md": lambda: table.as_markdown(lasting, result.endings).encode(),
        "comparison.tex": lambda: table.as_latex(lasting).encode(),
        TIMING: lambda: json_files.encode({**_claims(timed), "metrics": times}),
    }
    if result.verdicts:
        forms["claims.md"] = lambda: claims.as_markdown(judged, timed, TIMING).encode()
        forms["claims.json"] = lambda: json_files.encode(_claims(judged))
    return forms


def _claims(verdicts: Iterable[claims.Verdict]) -> dict[str, Any]:
    return {"format": 1, "claims": [verdict.as_json() for verdict in verdicts]}


def add_made(writer: RunWriter, extras: Extras, name: str, form: Callable[[], bytes]) -> None:
    """Write what `form` returns into a file of the folder; it is one of the `extras`."""
    content = extras.made(name, form)
    if content is not None:
        writer.add(name, content)


def drawn(
    result: Result, extras: Extras, progress: Callable[[str, float], None] | None = None
) -> dict[str, bytes]:
    """Shared figures in every format, by file name."""
    # matplotlib is slow to import
    from podusv_cli.figures.drawing import FIGURES, draw_in_parallel, dressed
    from podusv_cli.figures.style import FORMATS

    tell = progress and partial(progress, "drawing figures")
    if tell:
        tell(0.0)
    shown = dressed([(e.label, e.recording, e.scenario) for e in result.entries])
    return draw_in_parallel(shown, FIGURES, FORMATS, extras, progress=tell)


def _theories(result: Result) -> dict[str, dict[str, Any]]:
    return {entry.label: entry.run.theory for entry in result.entries if entry.run.theory}


def as_report(
    result: Result, title: str, figures: Mapping[str, bytes], provenance: Mapping[str, Any],
    missing: Iterable[object] = (),
) -> str:  # fmt: skip
    """The report; `figures` as `drawn` gives them."""
    pictures: list[tuple[str, str, bytes]] = []
    if figures:
        from podusv_cli.figures.drawing import FIGURES  # matplotlib is slow to import

        pictures = [
            (name, sheet.caption, figures[f"{name}.svg"])
            for name, sheet in FIGURES.items()
            if f"{name}.svg" in figures
        ]
    story = report.Story(
        title=title, scenario=result.parts[0].scenario,
        controllers={part.label: part.scenario.controller for part in result.parts},
        endings=result.endings, missing=[str(part) for part in missing],
        differences=result.differences,
        noticed=together(result.warnings), table=result.table, verdicts=result.verdicts,
        theories=_theories(result), figures=pictures, provenance=provenance,
    )  # fmt: skip
    return report.page(story)
