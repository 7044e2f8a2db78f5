"""`podusv rerun`: finished runs simulated once more, and how the new logs differ."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from podusv_cli.comparison.run_difference import RunDifference, difference
from podusv_cli.core.errors import UsageError
from podusv_cli.core.recording import Status
from podusv_cli.process.extras import Failure
from podusv_cli.process.workers import INTERRUPTED, available_workers
from podusv_cli.scenario.about import about_of, identify_of
from podusv_cli.scenario.case import Case
from podusv_cli.scenario.limits import disk_needed, limits
from podusv_cli.scenario.load import load_stored
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.plugins import of_folder
from podusv_cli.storage import manifest, run_folder
from podusv_cli.storage.run_folder import LOG, RunFolder
from podusv_cli.storage.staging import Staging, remove_abandoned
from podusv_cli.workflows.compare import make_runs, sizes
from podusv_cli.workflows.execute import Finished, RunTask, execute, why_unwritten
from podusv_cli.workflows.members import Member, runs_of
from podusv_cli.workflows.request import Request

Progress = Callable[[str, float], None]
Pairs = Sequence[tuple[RunFolder, Scenario]]


@dataclass(frozen=True)
class Repeated:
    """A run that was made once more: how it had ended, how it ended now, what is different."""

    original: Path
    was: Status
    status: Status
    found: RunDifference
    missing: Sequence[Failure] = ()  # from the repeated run
    message: str = ""  # why the repeated run did not finish

    @property
    def identical(self) -> bool:
        """Whether the log holds the same numbers, to the last bit."""
        return self.found.same_numbers

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints of it."""
        return {
            "original": str(self.original),
            "identical": self.identical,
            "status": [self.was, self.status],
            "missing": [str(lack) for lack in self.missing],
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

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints of them, but for the folder."""
        runs = [{"label": label, **run.as_json()} for label, run in self.runs.items()]
        failed = dict(self.failures)
        return {"format": 1, "identical": self.identical, "runs": runs, "failed": failed}

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
    manifest.demand(path)
    runs = [(run, _scenario(run, request)) for run in runs_of(path, optional=LOG)]
    for run, _ in runs:
        if run.status == "interrupted":
            raise UsageError(f"{run.path} was interrupted; there is no whole run to repeat")
    return (_one if len(runs) == 1 else _several)(runs, request, progress)


def _scenario(run: RunFolder, request: Request) -> Scenario:
    """The resolved scenario of a run, with code from its folder where that is trusted."""
    return load_stored(
        run.resolved_yaml,
        str(run.path / run_folder.RESOLVED),
        # The new log is read back, to be compared with the old one.
        checks=(limits(request.allow_large, read_back=True),),
        plugged=of_folder(request.trust),
    ).scenario


def _one(runs: Pairs, request: Request, progress: Progress | None) -> Repetition:
    """Simulate one run again and compare it with the original."""
    # There is exactly one.
    ((original, scenario),) = runs
    label = original.path.name or str(original.path)
    advance = partial(progress, label) if progress else None
    with _passing(request) as place:
        target, text = request.out or place / "again", original.resolved_yaml
        task = RunTask(scenario, text, target, request.force, argv=request.argv)
        case = Case.of(scenario, identify_of(original.about))
        done = execute(task, advance, case=case)
        return Repetition({label: _hold_against(original, done)}, {})


def _several(runs: Pairs, request: Request, progress: Progress | None) -> Repetition:
    """Simulate the runs of a comparison again and compare each with the original.

    One that cannot be made is among the failures.
    """
    again = [
        Member(
            run.path.name,
            about_of(scenario, identify_of(run.about)),
            run.resolved_yaml,
            case=Case.of(scenario, identify_of(run.about)),
            text=run.resolved_yaml,
        )
        for run, scenario in runs
    ]
    with _passing(request) as place:
        target = request.out or place / "again"
        room = disk_needed(sizes(again), available_workers())
        with run_folder.RunWriter(
            target, force=request.force, needed=room, argv=request.argv
        ) as writer:
            outcomes = make_runs(again, writer.folder, request, progress)
            missing = why_unwritten(outcomes.values())
            ended = zip((run for run, _ in runs), outcomes.items(), strict=True)
            done = Repetition(
                {
                    label: _hold_against(run, end.result)
                    for run, (label, end) in ended
                    if end.result
                },
                {label: end.failure for label, end in outcomes.items() if not end.result},
            )
            # the order in which compare and rerun take them, as no table here has it
            writer.add_origin(runs=[member.label for member in again])
            writer.extras.interrupted = done.interrupted
            writer.finish(missing=missing)
        return done


@contextmanager
def _passing(request: Request) -> Iterator[Path]:
    """The folder to write runs into: that of `request.out`, else one that is removed afterwards."""
    if request.out is not None:
        yield request.out.parent
        return
    place = Path(tempfile.gettempdir())
    remove_abandoned(place)  # what a killed one left
    staging = Staging(place / "podusv-rerun")
    try:
        yield staging.folder
    finally:
        staging.discard()


def _hold_against(original: RunFolder, done: Finished) -> Repeated:
    """A run that was made once more, held against the original."""
    differing = difference(original, run_folder.open_run(done.folder))
    return Repeated(
        original.path, original.status, done.status, differing, done.missing, done.message
    )
