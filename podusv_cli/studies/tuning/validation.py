"""Found gains on fresh draws: the scenario's and the found ones of every law meet the same."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from podusv_cli.storage import files
from podusv_cli.storage.run_folder import STUDY
from podusv_cli.studies.counting.runs_file import RunsTable
from podusv_cli.studies.making import record
from podusv_cli.studies.making.dispatch import Executor, StudyTally, dispatch
from podusv_cli.studies.making.store import RUNS, UNITS, Store
from podusv_cli.studies.tuning.plan import VALIDATE, Contestant, TunePlan
from podusv_cli.studies.tuning.trials import GainTrial, best

FOLDER = "validation"
Searched = Mapping[str, Sequence[Sequence[GainTrial]]]  # the trials by law, a list for each search


def tuned_name(law: str) -> str:
    """The name of a law with the gains that were found; no law's own name has a space."""
    return f"{law} tuned"


def searched_names(law: str, searches: Sequence[Sequence[GainTrial]]) -> list[str]:
    """The names in the table of a law with the gains of each of its searches.

    The search whose gains are taken has the name `tuned_name`.
    """
    names = [f"{law} repeat {number + 1}" for number in range(len(searches))]
    names[choose_search(searches)] = tuned_name(law)
    return names


def choose_search(searches: Sequence[Sequence[GainTrial]]) -> int:
    """The number of the search whose gains are taken: it gained most on its training draws.

    Its value counts relative to the scenario's own gains, its first trial on the same draws, since
    searches on other draws have other values. Where those fail, the best value counts.
    """
    own = [trials[0].value for trials in searches]
    known = all(map(math.isfinite, own))
    winners = [
        replace(won := best(trials), number=place, value=won.value - (own[place] if known else 0.0))
        for place, trials in enumerate(searches)
    ]
    return best(winners).number


def contestants(plan: TunePlan, trials: Searched) -> dict[str, Contestant]:
    """All laws that meet the fresh draws, by name: before, after, and those of other searches.

    Each is the name of the scenario's law and its changed numbers.
    """
    found: dict[str, Contestant] = {}
    for law in plan.laws:
        found[law] = law, {}
        searches = trials.get(law, ())
        names = searched_names(law, searches) if searches else ()
        found |= {name: (law, best(one).gains) for name, one in zip(names, searches, strict=True)}
    return found


def validate(
    plan: TunePlan,
    trials: Searched,
    folder: Path,
    started: str,
    executor: Executor,
    tell: Callable[[StudyTally], None],
) -> RunsTable:
    """Simulate what is missing of the validation; its runs.

    Raises PodusvError, StorageError and KeyboardInterrupt; finished units are kept.
    """
    made = plan.variant(contestants(plan, trials), VALIDATE, plan.tune.validate)
    store = Store(folder / FOLDER, record.about(made))
    _clear_other_runs(store)
    store.open(started)
    dispatch(store, made, tell, executor)
    return store.write_runs()


def _clear_other_runs(store: Store) -> None:
    """Remove the runs in the folder unless this validation can go on with them.

    They are of other gains where an earlier session had a smaller budget. More draws than are asked
    for now cannot be kept either. study.json goes last, because a folder without it that is not
    empty is no study.
    """
    folder = store.folder
    if not (folder / STUDY).exists():
        return
    begun = record.read_identity(folder)
    if begun.identity == store.about.identity and begun.draws <= store.about.draws:
        return
    with files.storage_errors(f"cannot remove old runs in {folder}"):
        if (folder / UNITS).exists():
            shutil.rmtree(folder / UNITS)
        for path in (folder / RUNS, folder / STUDY):
            path.unlink(missing_ok=True)
