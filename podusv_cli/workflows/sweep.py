"""`podusv sweep`: a scenario with the key `sweep` in, one folder with all its runs out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from podusv_cli.core.about import Keep
from podusv_cli.core.errors import UsageError
from podusv_cli.core.recording import Status
from podusv_cli.engine.running.simulate import ready
from podusv_cli.process.extras import Extras, Failure
from podusv_cli.process.interrupts import interrupts_deferred
from podusv_cli.scenario import plugins
from podusv_cli.scenario.model import Scenario
from podusv_cli.storage.writer import PATIENCE, TABLES, sole_writer
from podusv_cli.studies.counting.runs_file import RunsTable
from podusv_cli.studies.making import record
from podusv_cli.studies.making.check import sweep_faults, unjudged_claims
from podusv_cli.studies.making.dispatch import Executor, Gaps, StudyTally, Tell, dispatch
from podusv_cli.studies.making.estimate import check_fits
from podusv_cli.studies.making.invalid import check_draws
from podusv_cli.studies.making.joining import mixture
from podusv_cli.studies.making.plan import StudyPlan, plan
from podusv_cli.studies.making.sessions import SessionLog
from podusv_cli.studies.making.store import Store
from podusv_cli.studies.telling import outputs
from podusv_cli.studies.telling.keep import contradiction, find_kept, missing_runs
from podusv_cli.studies.telling.results import Results, judge_study
from podusv_cli.workflows.keep import keep
from podusv_cli.workflows.many_runs import (
    Config,
    compiling,
    executor_for,
    finish,
    folder_of,
    interruption,
    loaded_for,
    one_by_one,
    refusals_of,
    scenario_texts,
)
from podusv_cli.workflows.request import Request
from podusv_cli.workflows.run import RESULTS
from podusv_cli.workflows.studies import check_study, open_store

NO_SWEEP = (
    "which says what is to be drawn; see podusv docs studies, or start from one: podusv "
    "init studies/hull_and_sea"
)


@dataclass(frozen=True)
class Swept:
    """A study as far as it is made; without results where it is not whole."""

    folder: Path
    tally: StudyTally
    results: Results | None = None
    missing: tuple[Failure, ...] = ()  # of figures, report and kept logs
    missing_runs: tuple[str, ...] = ()  # after a merge, in words
    part_is_whole: bool = False  # the runs of a shard are made, others are missing
    refused: tuple[str, ...] = ()  # workers of a cluster that got no units, and why

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints."""
        answer = self.results.as_json() if self.results else {}
        status = "finished" if self.results else "unfinished"
        counts = {"wanted": self.tally.wanted, "made": self.tally.made}
        missing = [str(failure) for failure in self.missing]
        return {
            "format": 1,
            "status": status,
            "folder": str(self.folder),
            **counts,
            **answer,
            "missing": missing,
            "missing_runs": self.missing_runs,
            "refused": self.refused,
        }


def run(config: Config, request: Request, tell: Tell) -> Swept:
    """Simulate what is missing of a study, and judge it once all of it is there.

    `config` is a scenario or the folder of a study; `tell` is called with the tally after each
    unit. Raises ScenarioError, UsageError where the folder holds another study, StorageError, and
    KeyboardInterrupt; every unit that was finished is kept.
    """
    started = datetime.now(UTC)
    made, folder, texts = _plan_study(config, request)
    check_fits(made, folder, request.shard[1])
    for law in made.laws:  # before there is a folder that a mended law would not fit
        compiled = made.scenario.simulation.compiled
        ready(made.run_plan(law, 0), compiled, compiling(request, law))
    store = Store(folder, record.about(made))
    with sole_writer(store.folder):
        if request.force:
            store.clear()
        store.open(started.isoformat(timespec="seconds"), texts)
        return _run(store, made, request, started, tell)


def _run(store: Store, made: StudyPlan, request: Request, started: datetime, tell: Tell) -> Swept:
    """Simulate what is missing of a study whose folder is open, and judge it if it is whole.

    `made` is the study's plan; `started` is when the session began.
    """
    with executor_for(request, store.folder, made.scenario, store.seal) as executor:
        tally, whole = _march_study(store, made, request, started, executor, tell)
    swept = Swept(store.folder, tally, refused=refusals_of(executor))
    # The last of several shards to end finds the study whole, and judges it.
    if whole and request.shard != Request().shard:
        whole = _is_whole(store)
        swept = replace(swept, part_is_whole=not whole)
    if not whole:
        return swept
    with sole_writer(store.folder, TABLES, PATIENCE, request.warn):
        runs = store.write_runs()
        return replace(answer_study(store, runs, request, made), refused=swept.refused)


def _march_study(
    store: Store,
    made: StudyPlan,
    request: Request,
    started: datetime,
    executor: Executor,
    tell: Tell,
) -> tuple[StudyTally, bool]:
    """Simulate what is missing, and note the session; how far the study is, and if it is whole.

    `made` is the study's plan. Raises KeyboardInterrupt with what is kept and how to go on.
    """
    session = SessionLog(store.folder, request.argv, started, made.scenario.plugged)
    seen = StudyTally(0)

    def tell_tally(tally: StudyTally) -> None:
        """Keep the latest tally, for the message after an interrupt, and pass it on."""
        nonlocal seen
        seen = tally
        tell(tally)

    try:
        return dispatch(
            store,
            made,
            tell_tally,
            executor,
            seconds=request.seconds,
            part=request.shard,
            begin=partial(_announce, store.folder, made, request),
        )
    except KeyboardInterrupt as stop:
        kept = f"the {seen.made} runs that are made" if seen.made else "all runs that were made"
        raise interruption(kept, "sweep run", store.folder) from stop
    finally:
        # After an interrupt, too: without an end the session would count as one that was killed.
        timed = {"processor_s": seen.computed, "timed_runs": seen.ran}
        session.end(
            seen.made - seen.before, {**timed, "ended": seen.ended, **executor.provenance()}
        )


def _announce(
    folder: Path, made: StudyPlan, request: Request, missing: Gaps, alone: Mapping[str, str]
) -> None:
    """Warn of mixed machines, of invalid draws, and of laws whose runs march one by one.

    `missing` counts runs to be made, `alone` says by law why its runs march one by one.
    """
    if missing and (mixed := mixture(folder)):
        request.warn(mixed)
    if missing and (invalid := check_draws(made)).count:
        request.warn(invalid.in_words())
    for law, why in alone.items():
        request.warn(one_by_one(law, why))


def _is_whole(store: Store) -> bool:
    """Whether all runs of the study are there."""
    tally = StudyTally.of(store.covered_draws())
    return tally.made == tally.wanted


def _plan_study(config: Config, request: Request) -> tuple[StudyPlan, Path, dict[str, str]]:
    """The plan of a study, new or continued, its folder, and the texts that the folder keeps."""
    if there := folder_of(config):
        check_study(there)
    loaded = loaded_for("sweep", NO_SWEEP, config, request, [sweep_faults])
    if remark := unjudged_claims(loaded.scenario):
        request.warn(remark)
    own = there or default_folder(loaded.scenario)
    return plan(loaded), request.out or own, scenario_texts(loaded)


def default_folder(scenario: Scenario) -> Path:
    """Where the study of a scenario goes that is given no place."""
    return RESULTS / f"{scenario.name}-sweep"


def answer_study(
    store: Store, runs: RunsTable, request: Request, made: StudyPlan | None = None
) -> Swept:
    """Judge the runs that are there, and write everything about them.

    With the plan of the study (`made`), the logs that it is to keep are made, too. Tables and
    verdicts come first, so an interrupt costs only figures and kept logs.
    """
    with interrupts_deferred():
        results = judge_study(store.about, runs)
        outputs.write_tables(store.folder, results)
        extras, whole = Extras(), results.made_runs == results.wanted_runs
        if whole and made:
            if store.about.keep != Keep():
                request.say("making the logs that are kept")
            kept = keep(store.folder, made, results, extras, request)
        else:
            kept = find_kept(store.folder, results, extras)
        if whole and not made and missing_runs(store.folder, results):
            again = plugins.continue_with("sweep run", store.folder)
            request.warn(f"logs of kept runs are missing; they are made by: {again}")
        if contradicted := contradiction(kept):
            results = results.without_verdicts(contradicted)
            # Once more: those above have verdicts of runs that are in doubt now.
            outputs.write_tables(store.folder, results)
        request.say("drawing figures and writing the report")
        outputs.write_report(store.folder, results, kept, extras, figures=request.figures)
        status: Status = "finished" if whole else "interrupted"
        command = "sweep run" if made else "sweep report"
        finish(store.folder, extras, "runs, tables and verdicts", command, status)
        tally = StudyTally(results.wanted_runs, results.made_runs)
        return Swept(store.folder, tally, results, tuple(extras.missing))


def report(study: Path, request: Request) -> Swept:
    """Judge a study anew, of the runs that are there; nothing is simulated.

    Raises UsageError where there are no runs, or none that all laws have met.
    """
    started = datetime.now(UTC)
    check_study(study)
    with sole_writer(study, TABLES):  # as draws and runs may be added until it is locked
        store = open_store(study)
        if not StudyTally.of(store.covered_draws()).made:
            raise UsageError(
                f"{study} has no runs yet: {plugins.continue_with('sweep run', study)}"
            )
        SessionLog(study, request.argv, started, ()).end(0)
        runs = store.write_runs()
        if not runs.common.any():
            raise UsageError(
                f"no draw in {study} has runs of all laws yet, so they cannot be compared; "
                f"continue: {plugins.continue_with('sweep run', study)}"
            )
        return answer_study(store, runs, request)
