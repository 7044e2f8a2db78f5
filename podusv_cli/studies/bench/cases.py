"""The cases of a bench: every task with every vessel in every condition, as scenarios of all laws.

A bench is a folder with `laws.yaml`, `tasks/`, `vessels/` and `conditions/`. Each file is a layer
of a scenario. A condition that differs between vessels is a folder with a file for each of them.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from podusv_cli.core.errors import ScenarioError, UsageError
from podusv_cli.core.phrases import unknown_word
from podusv_cli.scenario import shipped
from podusv_cli.scenario.layers import compose_layers
from podusv_cli.scenario.load import load_text
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.plugins import of_files
from podusv_cli.scenario.yaml_text import read_text
from podusv_cli.scenario.yaml_tree import Fault, Mark

LAWS = "laws.yaml"
OF_CASES = ("vessel", "path", "disturbance", "start")  # what tasks, vessels and conditions set
AXES = ("vessels", "tasks", "conditions")  # folders, in the order in which cases are numbered


@dataclass(frozen=True)
class Selection:
    """What of a bench is to be run: its folder, files with further laws, changes, and choices.

    An empty choice means all; `overrides` are such as `simulation.step=0.005`.
    """

    folder: Path
    laws: Sequence[Path] = ()
    overrides: Sequence[str] = ()
    chosen: Mapping[str, Sequence[str]] | None = None  # names by axis
    trust: bool = False  # whether plug-in files of somebody's folder may be executed


@dataclass(frozen=True)
class BenchCase:
    """A task with a vessel in a condition, and a scenario for each law by its label."""

    vessel: str
    task: str
    condition: str
    laws: Mapping[str, Scenario]

    @property
    def place(self) -> tuple[str, str, str]:
        """Vessel, task, condition."""
        return self.vessel, self.task, self.condition


def shipped_bench() -> Path:
    """The folder of the bench that comes with podusv."""
    return shipped.folder() / "bench"


def cases(wanted: Selection) -> Iterator[BenchCase]:
    """All cases, one by one: each vessel with each task under each condition, with all laws.

    `wanted` says which of them. Raises UsageError for a folder or a name, ScenarioError for a file.
    """
    for path in wanted.laws:
        _check_laws(path)
    vessels, tasks, conditions = (_choose_files(wanted, axis) for axis in AXES)
    for vessel, task, condition in product(vessels, tasks, conditions):
        # Later layers win: a vessel over its task, a condition over both, laws of one's own over
        # all.
        layers = [
            wanted.folder / LAWS,
            tasks[task],
            vessels[vessel],
            _for_vessel(conditions[condition], vessel),
            *wanted.laws,
        ]
        # JSON is YAML, too, and quotes what a path may contain.
        names = json.dumps([str(layer.absolute()) for layer in layers])
        text = (
            f"extends: {names}\nname: {task}-{condition}-{vessel}\n"
            f"description: {task}, {condition}, {vessel}\n"
        )
        place = str(wanted.folder / f"{task}, {condition}, {vessel}")
        loaded = load_text(text, place, wanted.overrides, plugged=of_files(wanted.trust))
        yield BenchCase(vessel, task, condition, loaded.scenario.singles())


def _check_laws(path: Path) -> None:
    """Raise UsageError for a file of laws that also sets what tasks, vessels or conditions set.

    It is the last layer, so its vessel would replace that of every case. ScenarioError if
    unreadable.
    """
    if path.suffix == ".py":
        raise UsageError(
            f"{path} is Python; write a YAML file with `plugins: [{path.name}]` and the law "
            "under `controllers`, and give that file to --laws"
        )
    faults: list[Fault] = []
    text = read_text(str(path), Mark(str(path)), "", faults)
    root = text and compose_layers(text, str(path), (), faults)
    if not root or faults:
        raise ScenarioError(faults)
    if taken := [key for key in OF_CASES if root.get(key)]:
        raise UsageError(
            f"{path} has {', '.join(taken)}, and with them all tasks and vessels of the bench "
            "would be the same; give --laws a file with `controllers` (and `plugins`) that extends "
            "no scenario"
        )


def _choose_files(wanted: Selection, axis: str) -> dict[str, Path]:
    """The chosen files (folders for conditions that differ by vessel) of an axis, by name.

    `axis` is one of AXES, `wanted` has the folder and the names. Raises UsageError for a folder or
    a name that there is not.
    """
    if not (wanted.folder / axis).is_dir():
        raise UsageError(
            f"{wanted.folder} is no bench: it has no folder {axis}; a bench has {LAWS} and the "
            f"folders {', '.join(AXES)}"
        )
    paths = sorted((wanted.folder / axis).iterdir())
    known = {path.stem: path for path in paths if path.suffix == ".yaml" or path.is_dir()}
    names = (wanted.chosen or {}).get(axis) or known
    for name in names:
        if name not in known:
            raise UsageError(unknown_word(f"{axis.rstrip('s')} {name!r}", name, known))
    return {name: known[name] for name in names}


def _for_vessel(condition: Path, vessel: str) -> Path:
    """The condition's file for a vessel. Raises UsageError where it has none."""
    if condition.suffix == ".yaml":
        return condition
    path = condition / f"{vessel}.yaml"
    if not path.is_file():
        raise UsageError(f"{condition} has no file for the vessel {vessel}: write {path}")
    return path
