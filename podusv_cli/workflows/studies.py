"""What commands of `podusv sweep` read from the folder of a study; none of them simulates."""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from podusv_cli.core import json_text
from podusv_cli.core.errors import ScenarioError, UsageError
from podusv_cli.core.escaping import visible
from podusv_cli.core.phrases import unknown_word
from podusv_cli.scenario import plugins
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.resolved import resolved_yaml
from podusv_cli.storage import files
from podusv_cli.storage.run_folder import STUDY
from podusv_cli.studies.making import before, record
from podusv_cli.studies.making.plan import KERNELS, StudyPlan, differing, disagreements, plan
from podusv_cli.studies.making.store import RUNS, SCENARIO, Store
from podusv_cli.studies.telling import outputs
from podusv_cli.workflows.keep import scenario_of_draw, seen_from
from podusv_cli.workflows.many_runs import kept_scenario

FORMATS = ("csv", "parquet")


@dataclass(frozen=True)
class Made:
    """How many draws of every law and cell are made, of those wanted."""

    wanted: int
    rows: Sequence[tuple[str, str, int]]

    def as_json(self) -> list[dict[str, Any]]:
        """As plain data."""
        return [
            {"law": law, "cell": cell, "made": count, "wanted": self.wanted}
            for law, cell, count in self.rows
        ]


def check_study(folder: Path) -> None:
    """Raise UsageError where this is no folder of a study."""
    if not os.path.lexists(folder):
        raise UsageError(f"{folder} does not exist; it has to be the folder of a study")
    if folder.is_file():
        raise UsageError(
            f"{folder} is a file, not the folder of a study; to make one of a scenario: "
            "podusv sweep run SCENARIO"
        )
    if not (folder / STUDY).is_file():
        raise UsageError(f"{folder} is not the folder of a study: it has no {STUDY}")


def open_store(study: Path) -> Store:
    """The store of a study's folder, for reading; its scenario and plug-ins are not looked at.

    Where an older podusv wrote study.json, its scenario is looked at, with installed plug-ins
    alone. Raises UsageError where the folder is no study, and where the scenario needs another
    plug-in; StorageError where it is damaged.
    """
    check_study(study)
    return Store(study, before.about(study, partial(_of_before, study)))


def _of_before(study: Path) -> Scenario:
    """The scenario of a study that an older podusv wrote. Raises UsageError."""
    try:
        return kept_scenario(study).scenario
    except ScenarioError as error:
        raise UsageError(
            f"{study}: an older podusv wrote its {STUDY}, and its scenario cannot be read: "
            f"{str(error).splitlines()[0]}; have {STUDY} written anew: "
            f"{plugins.continue_with('sweep run', study)}"
        ) from error


def read_plan(study: Path, *, trusted: bool) -> StudyPlan:
    """The plan of a study's folder, whose plug-in files are executed if they are `trusted`.

    Runs of other kernels than those of this podusv are no fault. Raises UsageError where the folder
    is no study, and where its scenario is not the one of its runs; StorageError where that is
    damaged or names another file; ScenarioError where its plug-ins are not trusted.
    """
    check_study(study)
    made = plan(kept_scenario(study, plugged=plugins.of_folder(trusted)))
    noted, ours = record.read_identity(study).identity, json_text.plain(made.identity)
    if keys := [key for key in differing(noted, ours) if not key.endswith(KERNELS)]:
        raise UsageError(
            f"{study / SCENARIO} is not the scenario of the runs in {STUDY}: "
            f"{disagreements(ours, noted, keys)}; restore the file, or use the podusv that "
            "made them"
        )
    return made


def status(study: Path) -> Made:
    """How far a study is. Raises UsageError, StorageError."""
    store = open_store(study)
    rows = [
        (law, store.about.cells[cell], int(there.sum()))
        for (law, cell), there in store.covered_draws().items()
    ]
    return Made(store.about.draws, rows)


def draw(
    study: Path, law: str, number: int, cell: int, out: Path | None, *, trusted: bool = False
) -> Path:
    """Write the scenario of one run of a study to `out`, or beside: law, draw `number` and `cell`.

    Its plug-ins are executed if they are `trusted`. Raises UsageError, ScenarioError where they are
    not, StorageError.
    """
    made = read_plan(study, trusted=trusted)
    if law not in made.laws:
        raise UsageError(unknown_word(f"law {law!r}", law, made.laws))
    if cell >= len(made.cells):
        last = len(made.cells) - 1
        raise UsageError(f"--cell {cell}: there is no such cell; they are numbered 0 to {last}")
    if number >= made.sweep.draws:
        last = made.sweep.draws - 1
        raise UsageError(f"--draw {number}: there is no such draw; they are numbered 0 to {last}")
    single = scenario_of_draw(made, law, cell, number)
    path = out or Path(f"{single.name}.yaml")
    single = seen_from(path.parent, study, single)
    if path.exists():
        raise UsageError(f"{path} exists already; name another file with --out")
    at = f", cell {cell} ({made.cells[cell].label})" if len(made.cells) > 1 else ""
    head = f"# Draw {number} of the study {visible(study)}, law {law}{visible(at)}.\n"
    files.write_bytes(path, f"{head}{resolved_yaml(single)}".encode())
    return path


def export(study: Path, form: str, out: Path | None) -> Path:
    """Write all runs as one table: `form` is csv or parquet, `out` the file (None: in the study).

    Raises UsageError, also for a study without results, and StorageError.
    """
    if form not in FORMATS:
        raise UsageError(unknown_word(f"format {form!r}", form, FORMATS))
    path = out or study / f"runs.{form}"
    store = open_store(study)
    if not (study / RUNS).exists():
        raise UsageError(
            f"{study} has no {RUNS} yet: podusv sweep report {shlex.quote(str(study))}"
        )
    outputs.export(store.runs(), path)
    return path
