"""Found gains on fresh draws: the scenario's and the found ones of every law meet the same."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from podusv_cli.storage import files
from podusv_cli.storage.run_folder import STUDY
from podusv_cli.studies.counting.runs_file import Table
from podusv_cli.studies.making import record
from podusv_cli.studies.making.dispatch import Executor, Tally, dispatch
from podusv_cli.studies.making.store import RUNS, UNITS, Store
from podusv_cli.studies.tuning.plan import VALIDATE, Contestant, TunePlan
from podusv_cli.studies.tuning.trials import Trial, best

FOLDER = "validation"
Winners = Mapping[str, Sequence[Trial]]  # by law, one for each repeat


def tuned(law: str) -> str:
    """The name of a law with the gains that were found; no law's own name has a space."""
    return f"{law} tuned"


def repeated(law: str, repeat: int) -> str:
    """The name of a law with the gains that a repeat found."""
    return f"{law} repeat {repeat + 1}"


def chosen(winners: Sequence[Trial]) -> int:
    """Which repeat found the gains that are taken: the best on the draws for training."""
    return best([replace(trial, number=place) for place, trial in enumerate(winners)]).number


def contestants(plan: TunePlan, winners: Winners) -> dict[str, Contestant]:
    """All laws that meet the fresh draws, by name: before, after, and those of other repeats."""
    laws: dict[str, Contestant] = {}
    for law in plan.laws:
        laws[law] = law, {}
        if law in winners:
            first = chosen(winners[law])
            for repeat, trial in enumerate(winners[law]):
                laws[tuned(law) if repeat == first else repeated(law, repeat)] = law, trial.gains
    return laws


def validate(
    plan: TunePlan, winners: Winners, folder: Path, started: str, executor: Executor,
    tell: Callable[[Tally], None],
) -> Table:  # fmt: skip
    """Simulate what is missing of the validation; its runs.

    Raises PodusvError, StorageError and KeyboardInterrupt; finished units are kept.
    """
    made = plan.variant(contestants(plan, winners), VALIDATE, plan.tune.validate)
    store = Store(folder / FOLDER, record.about(made))
    _clear(store)
    store.open(started)
    dispatch(store, made, tell, executor)
    return store.write_runs()


def _clear(store: Store) -> None:
    """Remove the runs of other gains, which an earlier session with a smaller budget found.

    study.json goes last, because a folder without it that is not empty is no study.
    """
    folder = store.folder
    if not (folder / STUDY).exists():
        return
    begun = record.begun(folder)
    if begun.identity == store.about.identity and begun.draws <= store.about.draws:
        return
    with files.storage_errors(f"cannot remove old runs in {folder}"):
        if (folder / UNITS).exists():
            shutil.rmtree(folder / UNITS)
        for path in (folder / RUNS, folder / STUDY):
            path.unlink(missing_ok=True)
