"""`podusv runs`: what is in a folder of results, by its small files; nothing is executed."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from podusv_cli.core.errors import StorageError, UsageError
from podusv_cli.scenario.phrases import unknown
from podusv_cli.storage import files, json_files
from podusv_cli.storage.run_folder import STUDY

# A file that only folders of this kind have, and the file with their scenario.
KINDS = {
    "metrics.json": ("run", "resolved.yaml"), STUDY: ("study", "scenario.yaml"),
    "tune.json": ("search", "scenario.yaml"), "runs.csv": ("bench", ""),
}  # fmt: skip
MANIFEST, PROVENANCE = "manifest.json", "provenance.json"
UNFINISHED, DAMAGED = "unfinished", "damaged"
STEP = re.compile(r"[^.\[\]]+")
NAME = re.compile(r"^name: *[\"']?([^\"'\n]+)", re.MULTILINE)


@dataclass(frozen=True)
class Found:
    """A run, study, search or bench as its files tell of it."""

    folder: Path
    kind: str
    name: str = ""
    laws: Sequence[str] = ()
    status: str = UNFINISHED
    started: str = ""  # ISO 8601, UTC
    seconds: float = math.nan  # that making it took
    metrics: Mapping[str, float] = field(default_factory=dict)  # of a run
    scenario: str = ""  # the name of its file

    def as_json(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "folder": str(self.folder), "kind": self.kind, "name": self.name,
            "laws": list(self.laws), "status": self.status, "started": self.started,
            "seconds": self.seconds, "metrics": dict(self.metrics),
        }  # fmt: skip


def runs(root: Path, where: Sequence[str] = (), sort: str = "") -> list[Found]:
    """What is below a folder: the latest first, or by a metric, the smallest first.

    `where` are `key=value` of scenarios, all of which have to hold. Raises UsageError for a folder
    that is none, and for a key or metric that nothing here has.
    """
    if not root.is_dir():
        raise UsageError(
            f"{root} is no folder; name the folder of your results: podusv runs FOLDER"
        )
    every = [*_below(root)]
    for condition in where:
        every = _holding(every, condition)
    if not sort:
        return sorted(every, key=lambda one: one.started, reverse=True)
    known = dict.fromkeys(name for one in every for name in one.metrics)
    if not known:
        raise UsageError(f"--sort {sort}: there is no run below {root}, and only runs have metrics")
    if sort not in known:
        raise UsageError(unknown(f"metric {sort!r}", sort, known, "podusv list metrics"))
    measured = (one for one in every if one.kind == "run")
    return sorted(measured, key=lambda one: one.metrics.get(sort, math.inf))


def _below(root: Path) -> Iterator[Found]:
    """Folders of results; links and hidden folders are not followed."""
    for place, inside, names in os.walk(root):
        inside[:] = sorted(name for name in inside if not name.startswith("."))
        mark = next((name for name in KINDS if name in names), None)
        if mark and ({MANIFEST, STUDY, "tune.json"} & {*names}):
            inside.clear()
            yield _read(Path(place), mark)


def _read(folder: Path, mark: str) -> Found:
    kind, scenario = KINDS[mark]
    try:
        told = json_files.read(folder / mark) if mark.endswith(".json") else {}
        ending = json_files.read(folder / MANIFEST) if (folder / MANIFEST).exists() else {}
        origin = json_files.read(folder / PROVENANCE) if (folder / PROVENANCE).exists() else {}
        text = files.read_text(folder / scenario) if scenario else ""
    except StorageError:
        return Found(folder, kind, status=DAMAGED)
    sessions = [*origin.get("sittings", []), origin]
    named = NAME.search(text)
    laws = told.get("laws") or [told[key] for key in ("controller",) if key in told]
    numbers = (
        {n: math.nan if x is None else x for n, x in told.get("metrics", {}).items()}
        if kind == "run"
        else {}
    )
    return Found(
        folder, kind, told.get("name") or (named[1] if named else folder.name), [*map(str, laws)],
        ending.get("status", UNFINISHED), sessions[0].get("started", ""),
        sum(one.get("duration_s", 0.0) for one in sessions), numbers, scenario,
    )  # fmt: skip


def _holding(every: Sequence[Found], condition: str) -> list[Found]:
    """Those whose scenario has this value. Raises UsageError where none has the key."""
    key, equals, text = condition.partition("=")
    if not equals:
        raise UsageError(f"--where {condition}: write key=value, as --where controller.kind=pid")
    wanted, absent = yaml.safe_load(text), object()
    trees = {one.folder: _tree(one) for one in every if one.scenario}
    values = {folder: _at(tree, key, absent) for folder, tree in trees.items()}
    if trees and all(value is absent for value in values.values()):
        known = dict.fromkeys(name for tree in trees.values() for name in _keys(tree))
        wrong = unknown(f"key {key!r}", key, known, "podusv explain")
        raise UsageError(f"--where {condition}: {wrong}")
    return [one for one in every if values.get(one.folder, absent) == wanted]


def _tree(one: Found) -> Any:
    try:
        return yaml.load(
            files.read_text(one.folder / one.scenario),
            getattr(yaml, "CSafeLoader", yaml.SafeLoader),
        )
    except (StorageError, yaml.YAMLError):
        return {}


def _at(tree: Any, key: str, absent: object) -> Any:
    for step in STEP.findall(key):
        if isinstance(tree, Mapping):
            tree = tree.get(step, absent)
        elif isinstance(tree, list) and step.isdigit() and int(step) < len(tree):
            tree = tree[int(step)]
        else:
            return absent
    return tree


def _keys(tree: Any, prefix: str = "") -> Iterator[str]:
    for name, value in tree.items() if isinstance(tree, Mapping) else ():
        yield f"{prefix}{name}"
        yield from _keys(value, f"{prefix}{name}.")
