"""`podusv sweep`: a scenario with the key `sweep` in, one folder with all its runs out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from podusv_cli.core.errors import UsageError
from podusv_cli.core.recording import Status
from podusv_cli.process.extras import Extras, Failure
from podusv_cli.process.interrupts import interrupts_deferred
from podusv_cli.scenario import plugins
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.sweep import Keep
from podusv_cli.storage.writer import PATIENCE, TABLES, sole_writer
from podusv_cli.studies.study import outputs
from podusv_cli.studies.study.check import sweep_faults, unjudged
from podusv_cli.studies.study.dispatch import Engine, Gaps, Tally, Tell, dispatch
from podusv_cli.studies.study.estimate import check_fits
from podusv_cli.studies.study.invalid import check_draws
from podusv_cli.studies.study.joining import mixture
from podusv_cli.studies.study.keep import contradiction, found, unmade
from podusv_cli.studies.study.plan import plan
from podusv_cli.studies.study.results import Results, judged
from podusv_cli.studies.study.sessions import Session
from podusv_cli.studies.study.store import Store
from podusv_cli.workflows.keep import keep
from podusv_cli.workflows.many_runs import (
    WHOLE,
    Request,
    Source,
    compiling,
    engine_for,
    finish,
    folder_of,
    interrupted,
    loaded_for,
    one_by_one,
    refused,
    scenario_texts,
)
from podusv_cli.workflows.run import RESULTS
from podusv_cli.workflows.studies import check_study, stored

NO_SWEEP = (
    "which says what is to be drawn; see podusv docs studies, or start from one: podusv "
    "init studies/hull_and_sea"
)


@dataclass(frozen=True)
class Swept:
    """A study as far as it is made; without results where it is not whole."""

    folder: Path
    tally: Tally
    results: Results | None = None
    missing: tuple[Failure, ...] = ()  # of figures, report and kept logs
    missing_runs: tuple[str, ...] = ()  # after a merge, in words
    part_is_whole: bool = False  # the runs of a shard are made, others are missing
    refused: tuple[str, ...] = ()  # workers of a cluster that got no units, and why

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints."""
        told = self.results.as_json() if self.results else {}
        status = "finished" if self.results else "unfinished"
        counts = {"wanted": self.tally.wanted, "made": self.tally.made}
        missing = [str(one) for one in self.missing]
        return {
            "format": 1, "status": status, "folder": str(self.folder), **counts, **told,
            "missing": missing, "missing_runs": self.missing_runs, "refused": self.refused,
        }  # fmt: skip


def run(config: Source, request: Request, tell: Tell) -> Swept:
    """Simulate what is missing of a study, and judge it once all of it is there.

    `config` is a scenario or the folder of a study. Raises ScenarioError, UsageError where the
    folder holds another study, StorageError, and KeyboardInterrupt; every unit that was finished is
    kept.
    """
    started = datetime.now(UTC)
    store, texts = _planned(config, request)
    check_fits(store.plan, store.folder, request.shard[1])
    for law in store.plan.laws:  # before there is a folder that a mended law would not fit
        store.plan.single(law, 0).ready(compiling(request, law))
    with sole_writer(store.folder):
        if request.force:
            store.clear()
        store.open(started.isoformat(timespec="seconds"), texts)
        return _run(store, request, started, tell)


def _run(store: Store, request: Request, started: datetime, tell: Tell) -> Swept:
    """Simulate what is missing of a study whose folder is open, and judge it if it is whole."""
    with engine_for(request, store.folder, store.plan.scenario, store.seal) as engine:
        tally, whole = _marched(store, request, started, engine, tell)
    swept = Swept(store.folder, tally, refused=refused(engine))
    if whole and request.shard != WHOLE:
        whole = _is_whole(store)
        swept = replace(swept, part_is_whole=not whole)
    if not whole:
        return swept
    with sole_writer(store.folder, TABLES, PATIENCE, request.warn):
        store.write_runs()
        return replace(answered(store, request), refused=swept.refused)


def _marched(
    store: Store, request: Request, started: datetime, engine: Engine, tell: Tell
) -> tuple[Tally, bool]:
    """Simulate what is missing, and note the session; how far it is, and if it is whole."""
    session = Session(store.folder, request.argv, started, store.plan.scenario.plugged)
    seen = Tally(0)

    def told(tally: Tally) -> None:
        nonlocal seen
        seen = tally
        tell(tally)

    try:
        return dispatch(
            store, told, engine, seconds=request.seconds, part=request.shard,
            begin=partial(_announce, store, request),
        )  # fmt: skip
    except KeyboardInterrupt as stop:
        made = f"the {seen.made} runs that are made" if seen.made else "all runs that were made"
        raise interrupted(made, "sweep run", store.folder) from stop
    finally:
        timed = {"processor_s": seen.computed, "timed_runs": seen.ran}
        session.end(seen.made - seen.before, {**timed, "ended": seen.ended, **engine.told()})


def _announce(store: Store, request: Request, missing: Gaps, alone: Mapping[str, str]) -> None:
    """Warn of mixed machines, of invalid draws, and of laws whose runs march one by one."""
    if missing and (mixed := mixture(store.folder)):
        request.warn(mixed)
    if missing and (invalid := check_draws(store.plan)).count:
        request.warn(invalid.in_words())
    for law, why in alone.items():
        request.warn(one_by_one(law, why))


def _is_whole(store: Store) -> bool:
    """Whether all runs of the study are there."""
    tally = Tally.of(store.covered())
    return tally.made == tally.wanted


def _planned(config: Source, request: Request) -> tuple[Store, dict[str, str]]:
    """The store of a new study, or of one that is to be continued; its scenario and plug-ins."""
    if there := folder_of(config):
        check_study(there)
    loaded = loaded_for("sweep", NO_SWEEP, config, request, [sweep_faults])
    if remark := unjudged(loaded.scenario):
        request.warn(remark)
    own = there or default_folder(loaded.scenario)
    return Store(request.out or own, plan(loaded)), scenario_texts(loaded)


def default_folder(scenario: Scenario) -> Path:
    """Where the study of a scenario goes that is given no place."""
    return RESULTS / f"{scenario.name}-sweep"


def answered(store: Store, request: Request) -> Swept:
    """Judge the runs that are there, and write everything about them.

    Tables and verdicts come first. An interrupt then costs figures and kept logs, nothing else.
    """
    with interrupts_deferred():
        results = judged(store.plan, store.runs())
        outputs.write_tables(store.folder, results)
        extras, whole = Extras(), results.made == results.wanted
        make = partial(
            keep, store.folder, results, extras, request.argv, request.workers,
            figures=request.figures,
        )  # fmt: skip
        if results.plan.sweep.keep != Keep():
            request.say("making the logs that are kept")
        if whole and store.plan.record and unmade(store.folder, results):
            request.warn(
                f"no logs of kept runs are made, as this would execute the plug-in files in "
                f"{store.folder}; read them, then allow it with --trust"
            )
        adds = whole and not store.plan.record and not store.kernels
        kept = make() if adds else found(store.folder, results, extras)
        if contradicted := contradiction(kept):
            results = results.without_verdicts(contradicted)
            outputs.write_tables(store.folder, results)
        request.say("drawing figures and writing the report")
        outputs.write_report(store.folder, results, kept, extras, figures=request.figures)
        status: Status = "finished" if whole else "interrupted"
        finish(store.folder, extras, "runs, tables and verdicts", "sweep report", status)
        tally = Tally(results.wanted, results.made)
        return Swept(store.folder, tally, results, tuple(extras.missing))


def report(study: Path, request: Request) -> Swept:
    """Judge a study anew, of the runs that are there. Raises UsageError where there are none."""
    started = datetime.now(UTC)
    check_study(study)
    with sole_writer(study, TABLES):  # as draws and runs may be added until it is locked
        store = stored(study, request.warn, trusted=request.trust)
        if not Tally.of(store.covered()).made:
            raise UsageError(
                f"{study} has no runs yet: {plugins.continue_with('sweep run', study)}"
            )
        Session(study, request.argv, started, store.plan.scenario.plugged).end(0)
        store.write_runs()
        if not store.runs().common.any():
            raise UsageError(
                f"no draw in {study} has runs of all laws yet, so they cannot be compared; "
                f"continue: {plugins.continue_with('sweep run', study)}"
            )
        return answered(store, request)
