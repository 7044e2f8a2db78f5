"""`podusv runs`: what is in a folder of results, by its small files; nothing is executed."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from podusv_cli.core.errors import StorageError, UsageError
from podusv_cli.core.phrases import unknown_word
from podusv_cli.scenario.yaml_text import read
from podusv_cli.scenario.yaml_tree import Node, find, plain, route
from podusv_cli.storage import files, json_files
from podusv_cli.storage.run_folder import STUDY

MANIFEST, PROVENANCE = "manifest.json", "provenance.json"
UNFINISHED, DAMAGED = "unfinished", "damaged"
NAME = re.compile(r"^name: *[\"']?([^\"'\n]+)", re.MULTILINE)


class _Told(BaseModel):
    """What is read of the file that only folders of one kind have."""

    name: str = ""
    laws: list[str] | dict[str, Any] = []
    controller: str | None = None


class _OfRun(_Told):
    metrics: dict[str, float | None] = {}


class _Ending(BaseModel):
    status: str = UNFINISHED


class _Session(BaseModel):
    started: str = ""
    duration_s: float = 0.0


class _RunOrigin(_Session):
    sittings: list[_Session] = []


# A file that only folders of this kind have, the file with their scenario, what is read of it.
KINDS = {
    "metrics.json": ("run", "resolved.yaml", _OfRun),
    STUDY: ("study", "scenario.yaml", _Told),
    "tune.json": ("search", "scenario.yaml", _Told),
    "runs.csv": ("bench", "", None),
}


@dataclass(frozen=True)
class ListedRun:
    """A run, study, search or bench as its files describe it."""

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
            "folder": str(self.folder),
            "kind": self.kind,
            "name": self.name,
            "laws": list(self.laws),
            "status": self.status,
            "started": self.started,
            "seconds": self.seconds,
            "metrics": dict(self.metrics),
        }


def runs(root: Path, where: Sequence[str] = (), sort: str = "") -> list[ListedRun]:
    """What is below a folder: the latest first, or by a metric (`sort`), the smallest first.

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
        return sorted(every, key=lambda run: run.started, reverse=True)
    known = dict.fromkeys(name for run in every for name in run.metrics)
    if not known:
        raise UsageError(f"--sort {sort}: there is no run below {root}, and only runs have metrics")
    if sort not in known:
        raise UsageError(unknown_word(f"metric {sort!r}", sort, known, "podusv list metrics"))
    measured = (run for run in every if run.kind == "run")
    return sorted(measured, key=lambda run: run.metrics.get(sort, math.inf))


def _below(root: Path) -> Iterator[ListedRun]:
    """Folders of results; links and hidden folders are not followed."""
    for place, inside, names in os.walk(root):
        # In place: `os.walk` goes on with this very list.
        inside[:] = sorted(name for name in inside if not name.startswith("."))
        mark = next((name for name in KINDS if name in names), None)
        # A results' folder has a manifest once finished; studies and searches are listed before.
        if mark and ({MANIFEST, STUDY, "tune.json"} & {*names}):
            # Runs inside a result belong to it.
            inside.clear()
            yield _read(Path(place), mark)


def _read(folder: Path, mark: str) -> ListedRun:
    """What `podusv runs` lists of a folder; `mark` is the file that tells its kind."""
    kind, scenario, model = KINDS[mark]
    try:
        about = json_files.read_as(folder / mark, model) if model else _Told()
        ending, origin = (
            _if_there(folder / MANIFEST, _Ending),
            _if_there(folder / PROVENANCE, _RunOrigin),
        )
        text = files.read_text(folder / scenario) if scenario else ""
    except StorageError:
        return ListedRun(folder, kind, status=DAMAGED)
    # A study notes its sessions (sittings), a run has its times at the top.
    sessions = [*origin.sittings, origin]
    named = NAME.search(text)
    metrics = about.metrics if isinstance(about, _OfRun) else {}
    return ListedRun(
        folder,
        kind,
        about.name or (named[1] if named else folder.name),
        [*about.laws] or [*filter(None, [about.controller])],
        ending.status,
        sessions[0].started,
        sum(session.duration_s for session in sessions),
        {name: math.nan if x is None else x for name, x in metrics.items()},
        scenario,
    )


def _if_there(path: Path, model: type[json_files.Model]) -> json_files.Model:
    return json_files.read_as(path, model) if path.exists() else model()


def _holding(every: Sequence[ListedRun], condition: str) -> list[ListedRun]:
    """Those whose scenario has the value of `condition`, as `controller.kind=pid`.

    Raises UsageError where none has the key.
    """
    key, equals, text = condition.partition("=")
    wanted = read(text, condition, [], placed=False) if equals and text else None
    if wanted is None:
        raise UsageError(f"--where {condition}: write key=value, as --where controller.kind=pid")
    trees = {run.folder: tree for run in every if (tree := _tree(run))}
    values = {folder: find(tree, route(key)) for folder, tree in trees.items()}
    if trees and not any(values.values()):
        known = dict.fromkeys(name for tree in trees.values() for name in _keys(tree))
        wrong = unknown_word(f"key {key!r}", key, known, "podusv explain")
        raise UsageError(f"--where {condition}: {wrong}")
    return [
        run for run in every if (node := values.get(run.folder)) and plain(node) == plain(wanted)
    ]


def _tree(run: ListedRun) -> Node | None:
    """Its scenario; None where there is none, or none that can be read."""
    with suppress(StorageError):
        if run.scenario:
            return read(files.read_text(run.folder / run.scenario), str(run.folder), [])
    return None


def _keys(tree: Node, prefix: str = "") -> Iterator[str]:
    """The dotted keys of all values in a tree; `prefix` is the key of the tree with a dot."""
    for name, entry in tree.mapping.items():
        yield f"{prefix}{name}"
        yield from _keys(entry, f"{prefix}{name}.")
