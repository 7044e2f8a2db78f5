"""What the commands do, as short pipelines: scenarios or folders in, finished folders out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from podusv_cli.comparison.claims import misfits
from podusv_cli.comparison.differences import differences
from podusv_cli.comparison.entries import Entry
from podusv_cli.config.loading import load, resolved_yaml
from podusv_cli.config.scenario import Claim
from podusv_cli.config.words import unknown
from podusv_cli.errors import UsageError
from podusv_cli.findings.finding import Finding, heard
from podusv_cli.findings.preflight import preflight, together
from podusv_cli.logbook import atomic, folder, jsonfile, provenance
from podusv_cli.running import Finished, Progress, Stopwatch, Task, execute

if TYPE_CHECKING:
    from podusv_cli import comparing
    from podusv_cli.verification.verify import Verified

RESULTS = Path("results")
DRAWN = ("trajectory", "errors", "controls", "adaptation")  # by `run`


@dataclass(frozen=True)
class Request:
    """What a user asks for, the same options for `run` and `compare`."""

    overrides: Sequence[str] = ()
    out: Path | None = None
    force: bool = False
    figures: bool = True
    argv: Sequence[str] = ()
    warn: Callable[[Finding], None] = lambda finding: None  # before anything is simulated


def run(config: Path, request: Request, progress: Progress | None = None) -> Finished:
    """Load a scenario and execute it. Raises ScenarioError and StorageError."""
    watch = Stopwatch()
    with watch.part("load"):
        loaded = load(config, request.overrides)
        scenario = loaded.scenario.alone()
        resolved = resolved_yaml(scenario)
    target = request.out or folder.default_folder(RESULTS, scenario.name, resolved)
    with watch.part("preflight"):
        noticed = heard(preflight(scenario), scenario)
    for finding in noticed:
        request.warn(finding)
    figures = DRAWN if request.figures else ()
    task = Task(
        scenario, loaded.text, target, request.force, figures, request.argv, noticed=noticed
    )
    return replace(execute(task, progress, watch), others=tuple(loaded.scenario.controllers))


@dataclass(frozen=True)
class Compared:
    """A comparison that is over."""

    folder: Path
    result: comparing.Result

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints of a comparison."""
        from podusv_cli import comparing

        result = self.result
        return {
            "format": 1,
            "folder": str(self.folder),
            "runs": [self._run_as_json(entry) for entry in result.entries],
            "comparison": comparing.numbers(result.table),
            "failed": {label: text for label, text in result.endings.items() if text},
            "differences": result.differences,
            "claims": [verdict.as_json() for verdict in result.verdicts],
        }

    def warnings(self) -> list[Finding]:
        """What was noticed about the runs that were made."""
        return together(self.result.warnings)

    def _run_as_json(self, entry: Entry) -> dict[str, Any]:
        """A run as `podusv run --json` prints it; timing only where it was run now."""
        here = entry.label in self.result.timings
        return {
            "format": 1,
            "status": entry.recording.status,
            "run": str(self.folder / entry.label if here else entry.run.folder),
            "controller": entry.recording.controller,
            "metrics": dict(entry.run.metrics),
            "timing": dict(self.result.timings.get(entry.label, {})),
            "warnings": [f.as_json() for f in self.result.warnings.get(entry.label, ())],
        }


def compare(
    items: Sequence[Path], request: Request, progress: Callable[[str, float], None] | None = None
) -> Compared:
    """Run what has to be run, and compare it with what is there.

    Each item is a scenario (all its `controllers`, or its one controller), a run folder or the
    folder of a comparison. Claims are those of the scenarios. Raises ScenarioError, StorageError.
    """
    from podusv_cli import comparing  # pandas is slow to import

    started, argv = datetime.now(UTC), list(request.argv)
    parts, stated, title = _parts(items, request)
    for finding in together({part.label: part.noticed for part in parts}):
        request.warn(finding)
    text = "".join(f"{part.label}\n{resolved_yaml(part.scenario)}" for part in parts)
    target = request.out or folder.default_folder(RESULTS, title, text)
    with folder.RunWriter(target, force=request.force) as writer:
        outcomes = comparing.make_runs(
            parts, writer.folder, figures=request.figures, argv=argv, progress=progress
        )
        result = comparing.collect(parts, outcomes, stated)
        origin = provenance.collect(argv, started, datetime.now(UTC))
        comparing.write(writer, result)
        if request.figures and result.entries and result.status == "finished":
            comparing.draw_all(writer, result, title, origin)
        writer.add_json("provenance.json", origin)
        final = writer.finish(result.status)
    return Compared(final, result)


def _parts(
    items: Sequence[Path], request: Request
) -> tuple[list[comparing.Part], dict[str, Claim], str]:
    """What is to be compared, the claims about it, and a name for it all."""
    from podusv_cli import comparing

    parts: list[comparing.Part] = []
    stated: dict[str, Claim] = {}
    names = []
    for item in items:
        if item.is_dir():
            parts += comparing.from_folder(item)
            names.append(item.name)
            continue
        loaded = load(item, request.overrides, checks=(misfits,))
        alone = len(items) == 1 or bool(loaded.scenario.controllers)
        for label, scenario in loaded.scenario.singles().items():
            name = label if alone else scenario.name
            noticed = heard(preflight(scenario), scenario)
            parts.append(comparing.Part(name, scenario, loaded.text, noticed=noticed))
        stated |= loaded.scenario.claims
        names.append(loaded.scenario.name)
    title = "-".join(dict.fromkeys(names))[:80]
    return comparing.distinct(parts), stated, title


def verify(
    config: Path, overrides: Sequence[str], tolerance: float, out: Path | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Verified:  # fmt: skip
    """Verify a scenario's numbers; written to the file `out`, if there is one, as JSON.

    Raises ScenarioError and StorageError.
    """
    from podusv_cli.verification import verify as verification  # not needed by a run

    done = verification.verify(load(config, overrides).scenario, tolerance, progress)
    if out:
        atomic.write_bytes(out, jsonfile.encode(done.as_json()))
    return done


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
    differences: Mapping[str, Mapping[str, Any]]  # in more than the controller


def plot(runs: Sequence[Path], drawing: Drawing) -> Drawn:
    """Draw finished runs, overlaid; files of the same names in the folder are replaced.

    Raises UsageError for a figure or format that there is not, or that the runs have no signals
    for, and for a file that belongs to a finished folder; StorageError.
    """
    # pandas and matplotlib are slow to import
    from podusv_cli import comparing, plotting
    from podusv_cli.figures.animation import FILE, animate
    from podusv_cli.figures.drawing import FIGURES, draw_in_parallel, dressed
    from podusv_cli.figures.style import FORMATS

    _all_known("figure", drawing.figures, FIGURES)
    _all_known("format", drawing.formats, FORMATS)
    parts = plotting.named(part for path in runs for part in comparing.from_folder(path))
    shown = dressed([(p.label, p.run.recording, p.scenario) for p in parts if p.run])
    empty = plotting.empty(parts, shown)
    names = plotting.chosen(drawing.figures, shown)
    planned = [f"{name}.{form}" for name in names for form in drawing.formats]
    plotting.spared(drawing.out, [*planned, FILE] if drawing.animate else planned)
    drawn = dict(draw_in_parallel(shown, names, drawing.formats, drawing.columns))
    if drawing.animate:
        drawn[FILE] = animate(shown)
    replaced = plotting.put(drawing.out, drawn)
    differing = differences({part.label: part.scenario.model_dump() for part in parts})
    return Drawn([drawing.out / name for name in drawn], replaced, empty, differing)


def _all_known(what: str, names: Sequence[str], known: Iterable[str]) -> None:
    known = tuple(known)
    for name in names:
        if name not in known:
            raise UsageError(unknown(f"{what} {name!r}", name, known))
