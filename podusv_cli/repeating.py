"""Finished runs made once more, or held against others, and what became different."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from podusv_cli import comparing
from podusv_cli.comparing import Part
from podusv_cli.config.checking import Check
from podusv_cli.config.size import estimate, limits, needed
from podusv_cli.errors import UsageError
from podusv_cli.extras import Missing
from podusv_cli.logbook import folder, manifest, provenance
from podusv_cli.logbook.staging import Staging, sweep
from podusv_cli.parallel import INTERRUPTED, Outcome, run_all, workers_here
from podusv_cli.recording import Status
from podusv_cli.repetition.difference import Difference, difference
from podusv_cli.running import Task, execute, unwritten, warm_up

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Request:
    """Where repeated runs go (None: nowhere), whether they may replace what is there, be large."""

    out: Path | None = None
    force: bool = False
    argv: Sequence[str] = ()
    allow_large: bool = False


@dataclass(frozen=True)
class Repeated:
    """A run that was made once more: how it had ended, how it ended now, what is different."""

    original: Path
    was: Status
    status: Status
    found: Difference
    missing: Sequence[Missing] = ()  # from the repeated run

    @property
    def identical(self) -> bool:
        """Whether the log holds the same numbers, to the last bit."""
        return self.found.log.same

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints of it."""
        return {
            "original": str(self.original),
            "identical": self.identical,
            "status": [self.was, self.status],
            "missing": [str(part) for part in self.missing],
            **self.found.as_json(),
        }


@dataclass(frozen=True)
class Repetition:
    """Runs that were made once more by label, and in `failures` why others could not be."""

    runs: Mapping[str, Repeated]
    failures: Mapping[str, str]

    @property
    def identical(self) -> bool:
        """Whether every run was repeated to the last bit."""
        return not self.failures and all(run.identical for run in self.runs.values())

    @property
    def interrupted(self) -> bool:
        """Whether the user ended it."""
        cut = any(run.status == "interrupted" for run in self.runs.values())
        return cut or INTERRUPTED in self.failures.values()

    @property
    def diverges(self) -> bool:
        """Whether a run diverged that had not."""
        runs = self.runs.values()
        return any(run.status == "diverged" and run.was != "diverged" for run in runs)


def rerun(path: Path, request: Request, progress: Progress | None = None) -> Repetition:
    """Make a run, or every run of a comparison, once more from what its folder holds.

    Raises UsageError where `path` is no run folder or a run was interrupted, ScenarioError where
    this podusv does not know a key any more or the run is too large, and StorageError.
    """
    parts = _parts(path, (limits(request.allow_large, read_back=True),))
    for part in parts:
        if part.run and part.run.status == "interrupted":
            text = f"{part.run.folder} was interrupted; there is no whole run to repeat"
            raise UsageError(text)
    if len(parts) == 1:
        return _one(parts[0], request, progress)
    return _several(parts, request, progress)


def _parts(path: Path, checks: Sequence[Check] = ()) -> list[Part]:
    """The finished runs of a folder; UsageError where it is none."""
    manifest.demand(path)
    return comparing.from_folder(path, checks)


def _one(part: Part, request: Request, progress: Progress | None) -> Repetition:
    label = part.label or str(part.run and part.run.folder)
    advance = partial(progress, label) if progress else None
    with _passing(request) as place:
        target = request.out or place / "again"
        return Repetition({label: _repeat(part, target, request, advance)}, {})


def _several(parts: Sequence[Part], request: Request, progress: Progress | None) -> Repetition:
    started = datetime.now(UTC)

    def tell(position: int, fraction: float) -> None:
        if progress:
            progress(parts[position].label, fraction)

    with _passing(request) as place:
        target = request.out or place / "again"
        room = needed([estimate(part.scenario) for part in parts], workers_here())
        with folder.RunWriter(target, force=request.force, needed=room) as writer:
            for part in parts:
                warm_up(part.scenario)
            jobs = [partial(_repeat, p, writer.folder / p.label, request) for p in parts]
            outcomes = run_all(jobs, tell)
            missing = unwritten(outcomes)
            done = _repetition(parts, outcomes)
            origin = provenance.collect(request.argv, started, datetime.now(UTC))
            writer.add_json("provenance.json", origin)
            writer.finish("interrupted" if done.interrupted else "finished", missing)
        return done


def _repetition(parts: Sequence[Part], outcomes: Sequence[Outcome]) -> Repetition:
    pairs = [(part.label, outcome) for part, outcome in zip(parts, outcomes, strict=True)]
    runs = {label: outcome.result for label, outcome in pairs if outcome.result}
    failures = {label: outcome.failure for label, outcome in pairs if not outcome.result}
    return Repetition(runs, failures)


@contextmanager
def _passing(request: Request) -> Iterator[Path]:
    """A folder that is gone afterwards, for runs that are not to be kept."""
    if request.out is not None:
        yield request.out.parent
        return
    place = Path(tempfile.gettempdir())
    sweep(place)  # what a killed one left
    staging = Staging(place / "podusv-rerun")
    try:
        yield staging.folder
    finally:
        staging.discard()


def _repeat(
    part: Part, target: Path, request: Request, progress: Callable[[float], None] | None = None
) -> Repeated:
    """Run the scenario into `target` and hold it against the original."""
    original = part.run
    if original is None:
        raise ValueError(f"{part.label} has not been run")
    task = Task(part.scenario, original.resolved_yaml, target, request.force, argv=request.argv)
    done = execute(task, progress)
    found = difference(original, folder.open_run(done.folder))
    return Repeated(original.folder, original.status, done.status, found, done.missing)


@dataclass(frozen=True)
class Differences:
    """Pairs of runs that were held against each other, by label, and the runs without a partner."""

    pairs: Mapping[str, tuple[Path, Path, Difference]]
    only_one: Sequence[str] = ()
    only_other: Sequence[str] = ()

    @property
    def nothing(self) -> bool:
        """Whether all are the same in scenario, signals and metrics."""
        alone = self.only_one or self.only_other
        return not alone and all(found.nothing for _, _, found in self.pairs.values())

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints of them."""
        return {
            "format": 1,
            "identical": self.nothing,
            "only": [list(self.only_one), list(self.only_other)],
            "pairs": [
                {"label": label, "runs": [str(one), str(other)], **found.as_json()}
                for label, (one, other, found) in self.pairs.items()
            ],
        }


def diff(one: Path, other: Path) -> Differences:
    """Hold a run against another, or the runs of a comparison against those of the same name.

    Raises UsageError where one is no run folder, and StorageError.
    """
    sides = [[part.run for part in _parts(path) if part.run] for path in (one, other)]
    if all(len(runs) == 1 for runs in sides):
        return Differences({"": _pair(sides[0][0], sides[1][0])})
    ours, theirs = ({run.folder.name: run for run in runs} for runs in sides)
    return Differences(
        {label: _pair(run, theirs[label]) for label, run in ours.items() if label in theirs},
        [label for label in ours if label not in theirs],
        [label for label in theirs if label not in ours],
    )


def _pair(one: folder.Run, other: folder.Run) -> tuple[Path, Path, Difference]:
    return one.folder, other.folder, difference(one, other)
