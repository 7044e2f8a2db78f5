"""What the commands do, as short pipelines: scenarios or folders in, finished folders out."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from podusv_cli.core.errors import UsageError
from podusv_cli.core.finding import Finding
from podusv_cli.core.recording import Status
from podusv_cli.findings.finding import heard, unknown_codes
from podusv_cli.findings.preflight import preflight, together
from podusv_cli.process.extras import Extras, Missing
from podusv_cli.process.interrupts import interrupts_held
from podusv_cli.process.workers import workers_here
from podusv_cli.scenario.limits import estimate, limits, needed
from podusv_cli.scenario.load import load, resolved_yaml
from podusv_cli.scenario.model import Claim
from podusv_cli.storage import files as atomic
from podusv_cli.storage import provenance
from podusv_cli.storage import run_folder as folder
from podusv_cli.workflows.execute import Finished, Progress, Stopwatch, Task, execute, unwritten

if TYPE_CHECKING:
    from podusv_cli.comparison.claims import Stated
    from podusv_cli.comparison.entries import Entry
    from podusv_cli.workflows import comparing

RESULTS = Path("results")
DRAWN = ("controls", "trajectory", "errors")  # by `run`; the longest to draw first


@dataclass(frozen=True)
class Request:
    """What a user asks for, the same options for `run` and `compare`."""

    overrides: Sequence[str] = ()
    out: Path | None = None
    force: bool = False
    figures: bool = True
    argv: Sequence[str] = ()
    warn: Callable[[Finding], None] = lambda finding: None  # before anything is simulated
    allow_large: bool = False


def run(config: Path, request: Request, progress: Progress | None = None) -> Finished:
    """Load a scenario and execute it. Raises ScenarioError and StorageError."""
    watch = Stopwatch()
    with watch.part("load"):
        loaded = load(
            config, request.overrides, checks=(unknown_codes, limits(request.allow_large))
        )
        scenario = loaded.scenario.alone()
        resolved = resolved_yaml(scenario)
    target = request.out or folder.default_folder(RESULTS, scenario.name, resolved)
    with watch.part("preflight"):
        noticed = heard(preflight(scenario), scenario)
    for finding in noticed:
        request.warn(finding)
    figures = DRAWN if request.figures else ()
    task = Task(
        scenario, loaded.text, target, request.force, request.out is not None, figures,
        request.argv, noticed=noticed,
    )  # fmt: skip
    return replace(execute(task, progress, watch), others=tuple(loaded.scenario.controllers))


@dataclass(frozen=True)
class Compared:
    """A comparison that is over."""

    folder: Path
    result: comparing.Result
    status: Status  # interrupted where a run or the figures were, else finished
    missing: tuple[Missing, ...] = ()  # in the comparison and its runs

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints of a comparison."""
        from podusv_cli.comparison.table import numbers  # pandas is slow to import

        result = self.result
        return {
            "format": 1,
            "status": self.status,
            "folder": str(self.folder),
            "runs": [self._run_as_json(entry) for entry in result.entries],
            "comparison": numbers(result.table),
            "failed": {label: text for label, text in result.endings.items() if text},
            "differences": result.differences,
            "claims": [verdict.as_json() for verdict in result.verdicts],
            "missing": [str(part) for part in self.missing],
        }

    def warnings(self) -> list[Finding]:
        """What was noticed about the runs that were made."""
        return together(self.result.warnings)

    def _run_as_json(self, entry: Entry) -> dict[str, Any]:
        """As `podusv run --json`, without what is missing; timing only where it was run now."""
        here = entry.label in self.result.timings
        return {
            "format": 1,
            "status": entry.recording.status,
            "run": str(self.folder / entry.label if here else entry.run.folder),
            "controller": entry.recording.controller,
            "metrics": dict(entry.run.metrics),
            "timing": dict(self.result.timings.get(entry.label, {})),
            "warnings": [f.as_json() for f in self.result.warnings[entry.label]],
        }


def compare(
    items: Sequence[Path], request: Request, progress: Callable[[str, float], None] | None = None
) -> Compared:
    """Run what has to be run, and compare it with what is there.

    Each item is a scenario (all its `controllers`, or its one controller), a run folder or the
    folder of a comparison. Claims are those of the scenarios. After an interrupt what the runs have
    is compared, without figures; KeyboardInterrupt where they have nothing. Raises UsageError,
    ScenarioError, StorageError.
    """
    from podusv_cli.workflows import comparing  # pandas is slow to import

    started, argv = datetime.now(UTC), list(request.argv)
    gathered = _gathered(items, request)
    parts, title = gathered.parts, gathered.title
    for finding in together({part.label: part.noticed for part in parts}):
        request.warn(finding)
    text = "".join(f"{part.label}\n{resolved_yaml(part.scenario)}" for part in parts)
    target = request.out or folder.default_folder(RESULTS, title, text)
    _keep_apart(items, target)
    named = request.out is not None
    sizes = [estimate(part.scenario) for part in parts if part.run is None]
    room = needed(sizes, workers_here())
    with (
        interrupts_held(),
        folder.RunWriter(target, force=request.force, named=named, needed=room) as writer,
    ):
        outcomes = comparing.make_runs(
            parts, writer.folder, figures=request.figures, argv=argv, progress=progress
        )
        lost = unwritten(outcomes.values())
        extras = Extras(interrupted=any(outcome.cut for outcome in outcomes.values()))
        result = comparing.collect(parts, outcomes, gathered.stated, extras)
        if extras.interrupted and not result.entries:
            raise KeyboardInterrupt("stopped before any run finished; nothing was saved")
        origin = provenance.collect(argv, started, datetime.now(UTC))
        comparing.write(writer, result, extras)
        if request.figures:
            work = partial(comparing.drawn, result, extras, progress)
            figures = extras.attempt("figures", work) or {}
            for name, content in figures.items():
                writer.add(f"figures/{name}", content)
            heading = f"{title} (interrupted)" if extras.interrupted else title
            page = partial(comparing.as_report, result, heading, figures, origin, extras.missing)
            comparing.add_made(writer, extras, "report.html", lambda: page().encode())
        writer.add_json("provenance.json", origin)
        writer.add_missing(extras)
        status: Status = "interrupted" if extras.interrupted else "finished"
        return Compared(writer.finish(status, lost), result, status, tuple(extras.missing))


def _keep_apart(items: Sequence[Path], target: Path) -> None:
    """UsageError where writing the comparison would touch what is compared."""
    there = Path(os.path.realpath(target))
    for item in items:
        here = Path(os.path.realpath(item))
        within = there.is_relative_to(here) and (here / "manifest.json").exists()
        if here.is_relative_to(there) or within:
            raise UsageError(
                f"--out {target}: {item} is to be compared and would be overwritten or written "
                "into; name another folder"
            )


@dataclass(frozen=True)
class _Gathered:
    """What is to be compared, the claims about it, and a name for it all."""

    parts: Sequence[comparing.Part]
    stated: Sequence[Stated]
    title: str


def _gathered(items: Sequence[Path], request: Request) -> _Gathered:
    from podusv_cli.workflows import comparing

    if request.overrides and all(item.is_dir() for item in items):
        given = ", ".join(request.overrides)
        raise UsageError(
            f"--set {given}: finished runs are as they are; --set changes scenarios, and none is "
            "given"
        )
    found = [_opened(item, request, alone=len(items) == 1) for item in items]
    parts = comparing.distinct(part for some in found for part in some.parts)
    labels = iter(part.label for part in parts)
    called = [dict(zip(some.names, labels, strict=False)) for some in found]
    title = "-".join(dict.fromkeys(some.name for some in found))[:80]
    return _Gathered(parts, _stated(found, called), title)


@dataclass(frozen=True)
class _Item:
    """What one argument stands for; `names` are what its own claims call the `parts`."""

    name: str
    parts: Sequence[comparing.Part]
    names: Sequence[str] = ()
    claims: Mapping[str, Claim] = field(default_factory=dict)


def _opened(path: Path, request: Request, *, alone: bool) -> _Item:
    from podusv_cli.comparison.claims import misfits
    from podusv_cli.workflows import comparing

    if path.is_dir():
        parts = comparing.comparable(path)
        return _Item(path.resolve().name, parts, [part.label for part in parts])
    fits = limits(request.allow_large, read_back=True)
    loaded = load(path, request.overrides, checks=(unknown_codes, misfits, fits))
    scenario, singles = loaded.scenario, loaded.scenario.singles()
    by_law = alone or scenario.controllers
    labels = list(singles) if by_law else [scenario.name]
    parts = [
        comparing.Part(label, single, loaded.text, noticed=heard(preflight(single), single))
        for label, single in zip(labels, singles.values(), strict=True)
    ]
    return _Item(scenario.name, parts, list(singles), scenario.claims)


def _stated(found: Sequence[_Item], called: Sequence[Mapping[str, str]]) -> list[Stated]:
    """All claims; those of the same name bear their scenario's too."""
    from podusv_cli.comparison.claims import Stated
    from podusv_cli.workflows import comparing

    counts = Counter(name for item in found for name in item.claims)
    stated = [
        Stated(f"{item.name}.{name}" if counts[name] > 1 else name, claim, labels)
        for item, labels in zip(found, called, strict=True)
        for name, claim in item.claims.items()
    ]
    names = comparing.told_apart(said.name for said in stated)
    return [replace(said, name=name) for said, name in zip(stated, names, strict=True)]


@dataclass(frozen=True)
class Drawing:
    """What to draw of finished runs, how, and into which folder."""

    figures: Sequence[str]
    formats: Sequence[str]
    columns: int
    animate: bool
    out: Path


@dataclass(frozen=True)
class Drawn:
    """What was drawn, and what is to be said about it."""

    files: Sequence[Path]
    replaced: Sequence[Path]  # of `files`, those that were there with another content
    empty: Mapping[str, str]  # runs that ended before there was anything to draw, and how
    missing: Sequence[Missing]  # figures that could not be drawn
    differences: Mapping[str, Mapping[str, Any]]  # in more than the controller


def plot(runs: Sequence[Path], drawing: Drawing) -> Drawn:
    """Draw finished runs, overlaid; files of the same names in the folder are replaced.

    Raises UsageError for a figure or format that there is not, or that the runs have no signals
    for, and for a file that belongs to a finished folder; StorageError.
    """
    # pandas and matplotlib are slow to import
    from podusv_cli.comparison.differences import differences
    from podusv_cli.figures.animation import FILE, animate
    from podusv_cli.figures.drawing import draw_in_parallel, dressed
    from podusv_cli.workflows import comparing, plotting

    plotting.check_names(drawing.figures, drawing.formats)
    parts = plotting.named(part for path in runs for part in comparing.from_folder(path))
    shown = dressed([(p.label, p.run.recording, p.scenario) for p in parts if p.run])
    empty = plotting.empty(parts, shown)
    names = plotting.chosen(drawing.figures, shown)
    planned = [f"{name}.{form}" for name in names for form in drawing.formats]
    planned += [FILE] * drawing.animate
    plotting.spared(drawing.out, planned)
    atomic.check_places(drawing.out / name for name in planned)
    extras = Extras()
    drawn = draw_in_parallel(shown, names, drawing.formats, extras, drawing.columns)
    if drawing.animate:
        drawn |= extras.attempt(FILE, lambda: {FILE: animate(shown)}) or {}
    if extras.interrupted:
        raise KeyboardInterrupt
    replaced = plotting.put(drawing.out, drawn)
    differing = differences({part.label: part.scenario.model_dump() for part in parts})
    return Drawn([drawing.out / n for n in drawn], replaced, empty, extras.missing, differing)
