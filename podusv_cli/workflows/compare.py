"""`podusv compare`: scenarios and finished runs in, one finished comparison folder out."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from podusv_cli.comparison import claims, outputs, table
from podusv_cli.comparison.differences import differences
from podusv_cli.comparison.known_metrics import metrics_of
from podusv_cli.comparison.optimum import with_optimum_ratios
from podusv_cli.core.about import RunAbout
from podusv_cli.core.errors import UsageError
from podusv_cli.core.finding import Finding, merge_findings
from podusv_cli.core.past_run import PastRun
from podusv_cli.core.phrases import unknown_word
from podusv_cli.core.plugins import Plugins
from podusv_cli.core.recording import Recording, Status
from podusv_cli.findings.finding import finding_kinds
from podusv_cli.metrics.cost import law_costs
from podusv_cli.metrics.table import CLOCKED, metrics_with
from podusv_cli.process.extras import Extras, Failure
from podusv_cli.process.interrupts import interrupts_deferred, interrupts_enabled
from podusv_cli.process.workers import Outcome, available_workers, run_all
from podusv_cli.scenario.case import Case
from podusv_cli.scenario.limits import Size, disk_needed, estimate
from podusv_cli.scenario.load import Loaded
from podusv_cli.storage import provenance
from podusv_cli.storage.run_folder import RunWriter, default_folder, open_run
from podusv_cli.workflows.claimed_margins import with_margins
from podusv_cli.workflows.execute import RunTask, execute, warm_up, why_unwritten
from podusv_cli.workflows.gather import Members, gather
from podusv_cli.workflows.members import Member
from podusv_cli.workflows.request import Request
from podusv_cli.workflows.run import RESULTS, check_asked, open_scenario, writer_of
from podusv_cli.workflows.verify import is_verified

if TYPE_CHECKING:
    from podusv_cli.doubt.outputs import Doubted

Progress = Callable[[str, float], None]
UNMEASURED = dict.fromkeys(CLOCKED, math.nan)


@dataclass(frozen=True)
class Compared:
    """A finished or interrupted comparison."""

    folder: Path
    result: outputs.Result
    status: Status  # "interrupted" where a run or the figures were, else "finished"
    missing: tuple[Failure, ...] = ()  # in the comparison and its runs
    doubted: Doubted | None = None  # what the verdicts hang on, where that was asked for
    unverified: tuple[str, ...] = ()  # runs whose numbers `podusv verify` has not found converged

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints of a comparison."""
        result = self.result
        return {
            "format": 1,
            "status": self.status,
            "folder": str(self.folder),
            "runs": [self._run_as_json(run) for run in result.runs],
            "comparison": table.numbers(result.table),
            "failed": {label: text for label, text in result.endings.items() if text},
            "differences": result.differences,
            "claims": [verdict.as_json() for verdict in result.verdicts],
            "missing": [str(part) for part in self.missing],
            **({"doubt": self.doubted.as_json()["claims"]} if self.doubted else {}),
        }

    def places(self) -> list[Path]:
        """The fewest folders that have all of its runs."""
        runs = (run for run in self.result.runs if not self.place(run).is_file())
        places = [self.place(run) for run in runs]  # without what was measured
        return [self.folder] if {place.parent for place in places} == {self.folder} else places

    def place(self, run: PastRun) -> Path:
        """Where one of its runs lies: within, or where it was made; the file of a log."""
        assert run.folder is not None  # all were opened
        return self.folder / run.label if run.label in self.result.timings else run.folder

    def warnings(self) -> list[Finding]:
        """The findings about the runs made for this comparison, before and after them."""
        return merge_findings(self.result.warnings)

    def _run_as_json(self, run: PastRun) -> dict[str, Any]:
        """As `podusv run --json`, without what is missing; timing only of runs made now."""
        return {
            "format": 1,
            "status": run.recording.status,
            "run": str(self.place(run)),
            "controller": run.recording.controller,
            "metrics": dict(run.metrics),
            "timing": dict(self.result.timings.get(run.label, {})),
            "warnings": [f.as_json() for f in self.result.warnings[run.label]],
        }


def compare(items: Sequence[Path], request: Request, progress: Progress | None = None) -> Compared:
    """Simulate what is not simulated yet, and compare all runs.

    Each item is a scenario (all its `controllers`, or its one controller), a run folder, the folder
    of a comparison, or a log. The claims are those of the scenarios. `progress` is called with a
    run's label and the fraction done. After an interrupt the finished runs are compared, without
    figures; KeyboardInterrupt if there are none. Raises UsageError, ScenarioError, StorageError.
    """
    loaded = _to_doubt(items, request) if request.doubt else None
    return compare_gathered(gather(items, request), items, request, progress, loaded)


def _to_doubt(items: Sequence[Path], request: Request) -> Loaded:
    """The scenario whose verdicts are doubted, checked.

    Raises UsageError unless it is the only item.
    """
    from podusv_cli.doubt.check import doubt_faults  # slow to import, as much of podusv's studies
    from podusv_cli.workflows.doubt import comparison

    if len(items) > 1 or items[0].is_dir():
        given = ", ".join(map(str, items))
        raise UsageError(
            f"--doubt moves the values of one scenario, and {given} is given; name that alone, or "
            "run podusv doubt on each"
        )
    # Silent: the comparison itself opens it again, with its warnings.
    loaded = open_scenario(items[0], replace(request, warn=lambda finding: None), (doubt_faults,))
    # Raises where there is nothing to judge, before anything is simulated.
    comparison(loaded)
    return loaded


def compare_gathered(
    given: Members,
    items: Sequence[Path],
    request: Request,
    progress: Progress | None = None,
    loaded: Loaded | None = None,
) -> Compared:
    """Compare what is gathered already, as `compare` does.

    `items` are the files and folders that it is from. `loaded` is the scenario whose verdicts are
    doubted, if any.
    """
    check_asked(request, [member.plugins for member in given.members])
    _check_metrics(request, given.members)
    for finding in merge_findings({member.label: member.noticed for member in given.members}):
        request.warn(finding)
    text = "".join(f"{member.label}\n{member.resolved}" for member in given.members)
    target = request.out or default_folder(RESULTS, given.name, text)
    _keep_apart(items, target)
    with interrupts_deferred(), _writer(target, given.members, request) as writer:
        outcomes = make_runs(given.members, writer.folder, request, progress)
        lost = why_unwritten(outcomes.values())
        extras = writer.extras
        extras.interrupted = any(outcome.interrupted for outcome in outcomes.values())
        result = collect(given.members, outcomes, given.claims, extras)
        result = replace(result, chosen=request.metrics, ratios=request.ratios)
        if extras.interrupted and not result.runs:
            raise KeyboardInterrupt("interrupted before any run finished; nothing was written")
        doubted = None
        if loaded and not extras.interrupted:
            from podusv_cli.doubt.outputs import HEAD, row
            from podusv_cli.workflows.doubt import doubt_of

            # Within a folder that is new, `force` can replace nothing of the user's.
            own = replace(request, out=writer.folder / "doubt", force=True)
            doubted = doubt_of(loaded, own, progress)
            result = replace(result, doubts=[HEAD, *map(row, doubted.answers)])
            extras.interrupted = doubted.status == "interrupted"
        outputs.write(writer, result, extras)
        origin = writer.add_origin(result.plugins)
        _add_report(writer, result, given.name, origin, extras, progress, request)
        folder = writer.finish(missing=lost)
        made = {run.label for run in result.runs}
        # A log was measured, so no step of its own has to converge.
        runs = [m for m in given.members if m.label in made and not m.track]
        unverified = tuple(m.label for m in runs if not is_verified(m.resolved))
        return Compared(folder, result, writer.status, tuple(extras.missing), doubted, unverified)


def _check_metrics(request: Request, members: Sequence[Member]) -> None:
    """Raise UsageError for a metric in the request that no run has."""
    logged = (name for member in members if member.folder for name in member.folder.metrics)
    plugged = (name for member in members for name in metrics_with(member.plugins))
    own = (name for member in members for name in member.about.metrics)
    known = dict.fromkeys((*plugged, *own, *logged))
    for name in request.metrics:
        if name not in known:
            raise UsageError(unknown_word(f"metric {name!r}", name, known, "podusv list metrics"))


def _keep_apart(items: Sequence[Path], target: Path) -> None:
    """Raise UsageError where writing the comparison would touch a run that it compares."""
    # Real paths, as one of them may lead through a link into the other.
    there = Path(os.path.realpath(target))
    for item in items:
        here = Path(os.path.realpath(item))
        within = there.is_relative_to(here) and (here / "manifest.json").exists()
        if here.is_relative_to(there) or within:
            raise UsageError(
                f"--out {target}: {item} is to be compared and would be overwritten or written "
                "into; name another folder"
            )


def _writer(target: Path, members: Sequence[Member], request: Request) -> RunWriter:
    """The writer of the comparison's folder. Raises StorageError where the disk has no room."""
    space = disk_needed(sizes(members), request.workers or available_workers())
    return writer_of(request, target, space)


def sizes(members: Sequence[Member]) -> list[Size]:
    """The sizes of the runs that are to be made."""
    return [estimate(member.case.scenario, member.case.plan) for member in members if member.case]


def make_runs(
    members: Sequence[Member], folder: Path, request: Request, progress: Progress | None = None
) -> dict[str, Outcome]:
    """Execute the members that have no run yet, in parallel, each into a folder in `folder`.

    The outcomes by label; `progress` is called with a label and the fraction done.
    """
    wanted = [(member, member.case) for member in members if member.case]
    # Imports, versions and compiled code, so that each process finds them done.
    with interrupts_enabled():  # once, before the forks
        provenance.surroundings()
        import_module("podusv_cli.storage.log_reader")
        for _, case in wanted:
            warm_up(case, request.compiling)
    tasks = [
        RunTask(
            case.scenario,
            member.text,
            folder / member.label,
            argv=request.argv,
            label=member.label,
            noticed=member.noticed,
        )
        for member, case in wanted
    ]

    def advance(position: int, fraction: float) -> None:
        if progress:
            progress(tasks[position].label, fraction)

    jobs = [
        partial(execute, task, case=case) for task, (_, case) in zip(tasks, wanted, strict=True)
    ]
    outcomes = run_all(jobs, advance, request.workers)
    return {task.label: outcome for task, outcome in zip(tasks, outcomes, strict=True)}


def collect(
    members: Sequence[Member],
    outcomes: Mapping[str, Outcome],
    parsed: Sequence[claims.ParsedClaim],
    extras: Extras,
) -> outputs.Result:
    """Open the runs and compare them; a law's cost or a verdict that fails is noted in `extras`.

    `outcomes` are those of runs made now, by label, `parsed` the claims. What the runs lack is
    missing in the comparison, too.
    """
    finished = {label: o.result for label, o in outcomes.items() if o.result is not None}
    folders = {m.label: m.folder for m in members if m.folder}
    folders |= {label: open_run(done.folder) for label, done in finished.items()}
    opened_runs = [
        folders[m.label].as_run(m.label, m.about, m.plugins) for m in members if m.label in folders
    ]
    members = _place_measured(members, opened_runs)
    runs = [*opened_runs, *_as_finished_runs(members, opened_runs)]
    messages = {run.label: run.recording.message for run in runs}
    endings = {
        m.label: outcomes.get(m.label, Outcome()).failure or messages.get(m.label, "")
        for m in members
    }
    for label, done in finished.items():
        extras.missing += (replace(lack, what=f"{label}: {lack.what}") for lack in done.missing)
    made = {m.label: m.case for m in members if m.case and m.label in finished}
    runs = with_optimum_ratios(_with_costs(runs, made, extras), extras)
    runs = _with_departures(runs, members)
    scenarios = {label: case.scenario for label, case in made.items()}
    runs = with_margins(runs, scenarios, parsed, extras)
    # A run without a log, as one that crashed, has no numbers.
    every = {m.label: PastRun.without_log(m.label, m.about, endings[m.label]) for m in members}
    every |= {run.label: run for run in runs}
    numbers = {label: run.compared_metrics() for label, run in every.items()}
    abouts = {m.label: m.about for m in members}
    known = metrics_of(runs)
    plugins = tuple(dict.fromkeys(plugin for m in members for plugin in m.plugins))
    return outputs.Result(
        abouts=abouts,
        runs=runs,
        endings=endings,
        differences=differences({label: about.values for label, about in abouts.items()}),
        table=table.table(numbers, known),
        verdicts=extras.make_or_record(
            "the claims' verdicts", lambda: claims.judge(parsed, every, known)
        )
        or [],
        timings={label: done.timing for label, done in finished.items()},
        metrics=known,
        peaks=claims.peaks(parsed),
        plugins=plugins,
        meanings=extras.make_or_record("what the warnings mean", lambda: _meanings(plugins)) or {},
        warnings={m.label: getattr(finished.get(m.label), "warnings", m.noticed) for m in members},
    )


def _place_measured(members: Sequence[Member], runs: Sequence[PastRun]) -> list[Member]:
    """The members, with a measured track placed beside the first run.

    The track's remarks say how it fits.
    """
    logs = {run.label: run.recording for run in runs if len(run.recording["time"])}
    done = [_done_after(m.about, logs[m.label]) for m in members if m.label in logs]
    placed = []
    for member in members:
        if member.track and logs:
            label, first = next(iter(logs.items()))
            remarks = member.track.beside_run(label, first)
            track = member.track.place_beside(label, first)
            remarks = [*track.remarks, *remarks]
            # Up to when the last run has done its path: then the log counts no longer, either.
            about = track.about(member.about, max(done))
            member = replace(member, track=track, noticed=remarks, about=about)
        placed.append(member)
    return placed


def _done_after(about: RunAbout, log: Recording) -> float:
    """When a run has done its path or ends before [s]; infinite for a path without an end."""
    return float(log.up_to(about.path_end)["time"][-1]) if about.path_end else math.inf


def _as_finished_runs(members: Sequence[Member], runs: Sequence[PastRun]) -> list[PastRun]:
    """Measured tracks as runs, with the target of the first of `runs` that has a log."""
    logs = (run.recording for run in runs)
    first = next((log for log in logs if len(log["time"])), None)
    return [m.track.beside(first, m.label, m.about) for m in members if m.track and first]


def _with_departures(runs: Sequence[PastRun], members: Sequence[Member]) -> list[PastRun]:
    """The runs, with distances from the measured track, if there is one.

    Only simulated runs have these distances.
    """
    measured = {m.label: m.track for m in members if m.track}
    # There is one track at most; without it the list is empty, and the runs stay as they are.
    return [
        replace(run, cost={**run.cost, **track.departures(run.counted_recording)})
        if run.label not in measured
        else run
        for track in measured.values()
        for run in runs
    ] or [*runs]


def _meanings(plugins: Plugins) -> dict[str, str]:
    return {code: kind.meaning for code, kind in finding_kinds(plugins).items()}


def _with_costs(runs: Sequence[PastRun], made: Mapping[str, Case], extras: Extras) -> list[PastRun]:
    """The runs, those `made` now with their laws' cost, measured here and now, side by side.

    The cost in a run's own metrics was measured at another time, perhaps on another machine, so it
    is never compared. A finished run gets none, as it is looked at without its law.
    """
    timed = [
        run
        for run in runs
        if run.label in made
        and made[run.label].scenario.simulation.compiled
        and len(run.recording["time"])
    ]
    loops = [(made[run.label].plan, run.recording) for run in timed]
    costs = extras.attempt("the laws' times", lambda: law_costs(loops)) or [UNMEASURED] * len(timed)
    by_label = {run.label: cost for run, cost in zip(timed, costs, strict=True)}
    return [replace(run, cost=by_label.get(run.label, UNMEASURED)) for run in runs]


def _add_report(
    writer: RunWriter,
    result: outputs.Result,
    title: str,
    origin: Mapping[str, Any],
    extras: Extras,
    progress: Progress | None,
    request: Request,
) -> None:
    """Draw the figures that are asked for, and write the report, which has them as PNG.

    `origin` is the provenance of the comparison; what fails is noted in `extras`.
    """
    figures: dict[str, bytes] = {}
    if request.figures:
        draw = partial(
            outputs.draw_comparison, result, extras, progress, request.names, request.formats
        )
        figures = extras.attempt("figures", partial(draw, request.workers)) or {}
    for name, content in figures.items():
        # PNGs for the report alone are no files.
        if name.partition(".")[2] in request.formats:
            writer.add(f"figures/{name}", content)
    heading = f"{title} (interrupted)" if extras.interrupted else title
    page = partial(outputs.as_report, result, heading, figures, origin, extras.missing)
    outputs.add_made(writer, extras, "report.html", lambda: page().encode())
