"""study.json: what a study says about itself, from its plan to whoever reads its runs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from podusv_cli.core import json_text
from podusv_cli.core.about import MetricAbout, QuantityAbout, StudyAbout, StudyIdentity
from podusv_cli.core.errors import StorageError
from podusv_cli.core.phrases import as_yaml
from podusv_cli.core.plugins import digest
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.plugins import FOLDER
from podusv_cli.scenario.sweep import Sweep
from podusv_cli.scenario.words import in_words
from podusv_cli.storage import files, json_files
from podusv_cli.storage.run_folder import STUDY
from podusv_cli.studies.making.draws import SWEEP
from podusv_cli.studies.making.plan import StudyPlan

FORMAT = 2


def about(plan: StudyPlan) -> StudyAbout:
    """What a plan's study says about itself."""
    known = {n: m.about for n, m in plan.scenario.known_metrics().items() if m.accumulator}
    cells = tuple(cell.label for cell in plan.cells)
    return of_scenario(plan.scenario, plan.laws, cells, plan.identity, known, plan.metrics)


def of_scenario(
    scenario: Scenario,
    laws: tuple[str, ...],
    cells: tuple[str, ...],
    identity: Mapping[str, Any],
    metrics: dict[str, MetricAbout],
    measured: tuple[str, ...],
) -> StudyAbout:
    """What the study of a scenario says about itself.

    `cells` are labels, `metrics` all that are known, `measured` the names of those that its runs
    have.
    """
    sweep, seas = scenario.sweep or Sweep(), scenario.disturbances().values()
    return StudyAbout(
        name=scenario.name,
        description=scenario.description,
        duration=scenario.simulation.duration,
        steady_fraction=scenario.metrics.steady_fraction,
        settling_radius=scenario.metrics.settling_radius,
        parts={
            "path": scenario.path.label,
            "disturbance": ", ".join(sea.label for sea in seas),
            "actuator": scenario.actuator.label,
        },
        plugins={n: plugin.sha256 for n, plugin in scenario.plugins.items() if n.endswith(".py")},
        laws=laws,
        cells=cells,
        grid={key: tuple(map(as_yaml, given)) for key, given in sweep.grid.items()},
        draws=sweep.draws,
        seed=sweep.seed,
        design=sweep.design,
        success=sweep.success,
        level=sweep.level,
        keep=sweep.keep,
        claims=sweep.claims,
        quantities={
            name: QuantityAbout(keys=q.targets(name), drawn=in_words(q), is_seed=q.is_label)
            for name, q in sweep.vary.items()
        },
        metrics=metrics,
        measured=measured,
        identity=json_text.plain(identity),
        history=(),
    )


def drawing(study: StudyIdentity) -> tuple[Sweep, str]:
    """The settings of a study's draws, from its identity alone, and the stream of its draws."""
    head = "sweep.vary."
    own = study.identity
    vary = {key.removeprefix(head): value for key, value in own.items() if key.startswith(head)}
    settings = {"seed": own["sweep.seed"], "design": own["sweep.design"], "vary": vary}
    # By way of JSON, as read from a file: lists then become tuples again.
    sweep = Sweep.model_validate_json(json.dumps({**settings, "draws": study.draws}))
    return sweep, own.get("stream", SWEEP)


def read(folder: Path) -> StudyAbout:
    """What the study in a folder says about itself. Raises StorageError."""
    return json_files.read_as(folder / STUDY, StudyAbout)


def read_identity(folder: Path) -> StudyIdentity:
    """What the runs in a folder depend on, whichever podusv made them. Raises StorageError."""
    return json_files.read_as(folder / STUDY, StudyIdentity)


def write(folder: Path, study: StudyAbout) -> None:
    """Write study.json. Raises StorageError."""
    content = {"format": FORMAT, **study.model_dump(exclude_defaults=True)}
    files.write_bytes(folder / STUDY, json_text.encode(content))


def plugin_files(folder: Path, study: StudyAbout) -> dict[str, str]:
    """The text of each plug-in file in a study's folder, by its name there; none is executed.

    Raises StorageError for a file that is not the one of the study's runs.
    """
    texts = {name: files.read_text(folder / FOLDER / Path(name).name) for name in study.plugins}
    for name, text in texts.items():
        if name != f"{FOLDER}/{Path(name).name}" or digest(text) != study.plugins[name]:
            raise StorageError(f"{folder / name} is not the plug-in file of the runs in {folder}")
    return texts
