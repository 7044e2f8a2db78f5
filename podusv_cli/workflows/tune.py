"""`podusv tune`: a scenario with the key `tune` in, gains for every law and their proof out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from podusv_cli.core.errors import UsageError
from podusv_cli.process.extras import Extras, Failure
from podusv_cli.process.interrupts import interrupts_deferred
from podusv_cli.scenario.load import Loaded
from podusv_cli.storage import files
from podusv_cli.storage.writer import sole_writer
from podusv_cli.studies.making.check import sweep_faults
from podusv_cli.studies.making.dispatch import Executor, StudyTally
from podusv_cli.studies.making.plan import digest
from podusv_cli.studies.making.sessions import SessionLog
from podusv_cli.studies.making.unit import prepare
from podusv_cli.studies.tuning import folder as place
from podusv_cli.studies.tuning import outputs
from podusv_cli.studies.tuning.check import tune_faults
from podusv_cli.studies.tuning.dispatch import dispatch
from podusv_cli.studies.tuning.idle import find_idle
from podusv_cli.studies.tuning.plan import TRAIN, TunePlan
from podusv_cli.studies.tuning.remarks import remarks
from podusv_cli.studies.tuning.results import SearchResults
from podusv_cli.studies.tuning.sampler import optuna
from podusv_cli.studies.tuning.search import GainSearch
from podusv_cli.studies.tuning.space import with_gains
from podusv_cli.studies.tuning.validation import validate
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

Tell = Callable[[StudyTally, str], None]
NO_TUNE = (
    "which says how many runs a search has; see podusv docs tuning, or start from one: podusv "
    "init studies/tune_small"
)


@dataclass(frozen=True)
class Tuned:
    """A finished search and its folder."""

    folder: Path
    results: SearchResults
    missing: tuple[Failure, ...] = ()  # of figures and report
    refused: tuple[str, ...] = ()  # workers of a cluster that got no units, and why

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints."""
        results = self.results
        return {
            "format": 1,
            "status": "finished",
            "folder": str(self.folder),
            "laws": results.laws.to_dict("records"),
            "gains": {law: dict(results.winner(law).gains) for law in results.winners},
            "remarks": remarks(results),
            "missing": [str(failure) for failure in self.missing],
            "refused": self.refused,
        }


def tune(config: Config, request: Request, tell: Tell) -> Tuned:
    """Search gains for every law with equal budgets, and report them on fresh draws.

    `config` is a scenario or the folder of a search. Raises ScenarioError, UsageError where the
    folder holds another search, no law has a gain or Optuna is not installed, StorageError, and
    KeyboardInterrupt; every batch that was finished is kept.
    """
    started = datetime.now(UTC)
    # A missing library is told before anything is loaded or written.
    optuna()
    loaded, folder = _load_config(config, request)
    with sole_writer(folder):
        return _tune_folder(loaded, folder, request, started, tell)


def _tune_folder(
    loaded: Loaded, folder: Path, request: Request, started: datetime, tell: Tell
) -> Tuned:
    """Search what is not there yet, or all anew; no other process writes into the folder."""
    plan, texts = TunePlan(loaded.scenario), scenario_texts(loaded)
    noted = None if request.force else place.read_known(folder, plan)
    # Found once: a continued search leaves out the same gains.
    plan = replace(plan, idle=noted.idle if noted else _idle(plan, request))
    if not any(plan.gains.values()):
        raise UsageError(
            f"{plan.scenario.name}: nothing to search: no number of {', '.join(plan.laws)} "
            "is a gain that changes a run; add a law with gains to `controllers`"
        )
    stamp = started.isoformat(timespec="seconds")
    if request.force:  # by now, nothing that is asked for is wrong
        place.clear(folder)
    place.write(folder, plan, noted, stamp, texts)
    request.begin(f"{plan.size}; in {folder}")
    with executor_for(request, folder, plan.scenario, digest(plan.base.identity)) as executor:
        results = _run_search(plan, folder, request, started, executor, tell)
    return replace(_write_results(results, folder, request), refused=refusals_of(executor))


def _load_config(config: Config, request: Request) -> tuple[Loaded, Path]:
    """The scenario, checked, and the folder of the search. Raises ScenarioError, UsageError."""
    if there := folder_of(config):
        place.check(there)
    loaded = loaded_for("tune", NO_TUNE, config, request, [sweep_faults, tune_faults])
    own = there or RESULTS / f"{loaded.scenario.name}-tune"
    return loaded, request.out or own


def _run_search(
    plan: TunePlan,
    folder: Path,
    request: Request,
    started: datetime,
    executor: Executor,
    tell: Tell,
) -> SearchResults:
    """Search and validate what is not there yet, and note the session.

    Raises KeyboardInterrupt with what is kept and how to go on.
    """
    session = SessionLog(folder, request.argv, started, plan.scenario.plugged)
    made = {"search": 0, "validation": 0}

    def tell_searched(tally: StudyTally, searches: Sequence[GainSearch]) -> None:
        made["search"] = tally.made - tally.before
        tell(tally, _leaders(searches))

    def tell_validated(tally: StudyTally) -> None:
        made["validation"] = tally.made - tally.before
        tell(tally, "found gains on fresh draws")

    try:
        searches = _searches(plan, folder)
        _prepare(plan, request)
        dispatch(searches, executor, tell_searched)
        trials = {law: [s.trials for s in searches if s.law == law] for law in plan.gains}
        trials = {law: of_law for law, of_law in trials.items() if of_law}
        stamp = started.isoformat(timespec="seconds")
        return SearchResults(
            plan, trials, validate(plan, trials, folder, stamp, executor, tell_validated)
        )
    except KeyboardInterrupt as stop:
        raise interruption("all batches that were finished", "tune", folder) from stop
    finally:
        session.end(sum(made.values()), executor.provenance())


def _prepare(plan: TunePlan, request: Request) -> None:
    """Have all laws with gains compiled, with all of their options, before the fork.

    Raises LawError.
    """
    for law, gains in plan.gains.items():
        runs, report = sum(plan.runs_wanted()[law]), compiling(request, law)
        # A word may choose other code, which is compiled as well.
        options = [{gain.key: word} for gain in gains for word in gain.words]
        for new in options or [{}] if gains else []:
            if with_gains(plan.laws[law], new):
                variant = plan.variant({law: (law, new)}, TRAIN, 1)
                if why := prepare(variant, law, 0, runs, report):
                    request.warn(one_by_one(law, why))


def _idle(plan: TunePlan, request: Request) -> dict[str, tuple[str, ...]]:
    """The gains that change no run."""
    _prepare(plan, request)
    request.say("looking for gains that change nothing")
    return find_idle(plan, request.workers)


def _searches(plan: TunePlan, folder: Path) -> list[GainSearch]:
    """All searches of each law with gains, the laws in turn, so that all advance together."""
    return [
        GainSearch(plan, law, number, folder)
        for number in range(plan.tune.searches)
        for law, gains in plan.gains.items()
        if gains
    ]


def _leaders(searches: Sequence[GainSearch]) -> str:
    """The best objective so far of every law, over its searches, in words."""
    best_values: dict[str, float] = {}
    for search in searches:
        if search.leader:
            value = search.leader.value
            best_values[search.law] = min(value, best_values.get(search.law, value))
    leaders = ", ".join(f"{law} {value:.4g}" for law, value in best_values.items())
    return f"best on the training draws: {leaders}" if best_values else "no gains are tried yet"


def _write_results(results: SearchResults, folder: Path, request: Request) -> Tuned:
    """Write the scenario and the tables, then figures and the report."""
    with interrupts_deferred():
        files.write_bytes(folder / place.TUNED, place.tuned_yaml(results))
        outputs.write_tables(folder, results)
        request.say("drawing figures and writing the report")
        extras = Extras()
        outputs.write_report(folder, results, extras, figures=request.figures)
        finish(folder, extras, "gains and tables", "tune")
        return Tuned(folder, results, tuple(extras.missing))
