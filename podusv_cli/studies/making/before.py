"""Studies of which an older podusv wrote study.json: the rest is in their scenario and runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from pydantic import Field

from podusv_cli.core.about import MetricAbout, StudyAbout, StudyIdentity
from podusv_cli.scenario.model import Scenario
from podusv_cli.storage import json_files
from podusv_cli.storage.run_folder import STUDY
from podusv_cli.studies.counting.expressions import FINISHED
from podusv_cli.studies.counting.runs_file import RunsTable
from podusv_cli.studies.making import record
from podusv_cli.studies.making.plan import digest
from podusv_cli.studies.making.store import RUNS, UNITS, read

FORMAT = 1  # of study.json


class _Before(StudyIdentity):
    laws: tuple[str, ...]
    cells: tuple[str, ...]
    metrics_of_plugins: dict[str, dict[str, Any]] = Field({})


def about(folder: Path, scenario: Callable[[], Scenario]) -> StudyAbout:
    """What a study says about itself, also where an older podusv wrote its study.json.

    An old file lacks what follows from the scenario; only then `scenario` is called, which loads
    it. Raises StorageError, and what `scenario` raises.
    """
    if json_files.read(folder / STUDY).get("format") != FORMAT:
        return record.read(folder)
    before, own = json_files.read_as(folder / STUDY, _Before), scenario()
    known = {name: metric.about for name, metric in own.known_metrics().items()}
    foreign = before.metrics_of_plugins.items()
    known |= {name: MetricAbout(name=name, **facts) for name, facts in foreign if name not in known}
    # Old files do not name the metrics that were measured; the runs have them.
    there = {*_metrics_measured(folder, digest(before.identity))}
    return record.of_scenario(
        own,
        before.laws,
        before.cells,
        before.identity,
        known,
        tuple(name for name in known if name in there),
    ).model_copy(update={"draws": before.draws, "history": before.history})


def _metrics_measured(folder: Path, seal: str) -> Iterator[str]:
    """The metrics of the runs in the folder, perhaps more than once.

    `seal` is the digest of the study's identity.
    """
    if (folder / RUNS).exists():
        yield from RunsTable(folder / RUNS, FINISHED, {}).metrics
    for path in (folder / UNITS).glob("*.unit"):
        if result := read(path, seal):
            yield from result.metrics
