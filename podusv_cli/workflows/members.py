"""The runs that `compare`, `plot`, `rerun` and `diff` are given: scenarios and finished folders."""

from __future__ import annotations

import csv
import os
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from pydantic import BaseModel

from podusv_cli.comparison import stability
from podusv_cli.comparison.measured import Track
from podusv_cli.comparison.outputs import RESERVED, TABLE
from podusv_cli.core.about import RunAbout
from podusv_cli.core.errors import ScenarioError, StorageError, UsageError
from podusv_cli.core.finding import Finding
from podusv_cli.core.plugins import Plugins
from podusv_cli.core.recording import Recording
from podusv_cli.scenario.about import about_of
from podusv_cli.scenario.case import Case
from podusv_cli.scenario.load import load_stored
from podusv_cli.scenario.plugins import continue_with, on_hand, used_of
from podusv_cli.storage import manifest
from podusv_cli.storage.files import read_text
from podusv_cli.storage.json_files import read_as
from podusv_cli.storage.run_folder import (
    ABOUT,
    LOG,
    LOGS,
    PROVENANCE,
    RESOLVED,
    STUDY,
    THEORY,
    RunFolder,
    open_run,
)

# Signals that every log has, as figures and comparisons need them.
NEEDED = (
    "time",
    "x",
    "y",
    "psi",
    "u",
    "v",
    "r",
    "x_d",
    "y_d",
    "tau_u_cmd",
    "tau_r_cmd",
    "tau_u",
    "tau_r",
)
_TERMS = ("z_e", "psi_e", "u_e", "r_e", "y_u", "y_r", "W_u", "W_r", "b_u", "b_r")
_BOUNDS = ("V", "window_start", "V_lambda", "V_Delta", "V_bound", "v_bound")
# Signals that a signal needs beside it.
BESIDE = {
    "V": (*(f"V_{term}" for term in _TERMS), *_BOUNDS),
    "V_dot": _BOUNDS,
    "n": ("delta",),
    "n_part": ("delta",),
    "power": ("delta",),
}
LARGEST = 1e300  # beyond it the engine calls a run diverged and logs no row


class _Repetition(BaseModel):
    runs: list[str] = []


@dataclass(frozen=True)
class Member:
    """One run of several: the `folder` of one that is over, or the `case` of one to be made.

    A `track` is no run: it was measured. `plugins` have figures, metrics and signals for it.
    """

    label: str
    about: RunAbout
    resolved: str  # the text of resolved.yaml
    plugins: Plugins = ()
    folder: RunFolder | None = None
    case: Case | None = None
    text: str = ""  # the scenario's file
    noticed: Sequence[Finding] = ()  # before the run
    track: Track | None = None


def from_folder(path: Path, files: Sequence[str] = ()) -> list[Member]:
    """The finished runs of a folder, as `runs_of` has them; `files` are plug-ins.

    Raises UsageError for one of an older podusv whose scenario cannot be read.
    """
    plugins = on_hand(files)
    return [
        Member(
            run.path.name, run.about or _told_before(run, files), run.resolved_yaml, plugins, run
        )
        for run in runs_of(path)
    ]


def runs_of(path: Path, *, optional: str = "") -> list[RunFolder]:
    """The finished runs of a folder: one run, or all those of a comparison.

    Their logs and theory.json were checked. Raises UsageError for a folder without finished runs,
    StorageError for a damaged one. Files that are called `optional` may be missing.
    """
    if (path / STUDY).is_file():
        raise UsageError(_about_study(path))
    inner = (
        _find_listed(path, optional)
        if os.path.lexists(path / manifest.NAME)
        else _find_unlisted(path)
    )
    if not inner:
        manifest.demand(path)
    return [_check_member(child, optional) for child in (inner or [path])]


def _about_study(path: Path) -> str:
    """What to do instead of taking a study for a run."""
    kept = sorted(run for run in (path / LOGS).glob("*") if (run / LOG).is_file())
    hint = f"name one of the runs that it keeps, such as {kept[0]}, or " if kept else ""
    return (
        f"{path} is a study, not a run; {hint}write any of its runs as a scenario: "
        f"podusv sweep draw {path} --law LAW --draw N"
    )


def _find_unlisted(path: Path) -> list[Path]:
    """Run folders inside a folder that has no manifest; links are not followed."""
    children = sorted(path.iterdir()) if path.is_dir() else ()
    return [c for c in children if not c.is_symlink() and os.path.lexists(c / LOG)]


def _find_listed(path: Path, optional: str) -> list[Path]:
    """The runs of a finished comparison, or of one made again, in its order; none in a run.

    The manifest lists files by name; the comparison's table, or provenance, has the order.
    """
    files = manifest.check(path, optional).files
    runs = sorted(name.removesuffix(f"/{LOG}") for name in files if name.endswith(f"/{LOG}"))
    head = _first_row(path / TABLE) if TABLE in files else _made_again(path, files)
    runs.sort(key=lambda run: head.index(run) if run in head else len(head))
    return [path / run for run in runs]


def _made_again(path: Path, files: Collection[str]) -> Sequence[str]:
    """The order of runs that `podusv rerun` made, which writes no table."""
    return read_as(path / PROVENANCE, _Repetition).runs if PROVENANCE in files else ()


def _first_row(path: Path) -> list[str]:
    """The heads of a CSV file's columns. Raises StorageError."""
    try:
        return next(csv.reader(read_text(path).splitlines()[:1]), [])
    except csv.Error as error:
        raise StorageError(f"cannot read {path}: no CSV ({error})") from error


def _check_member(path: Path, optional: str) -> RunFolder:
    """The finished run in a folder, its log and theory.json checked. Raises StorageError."""
    run = open_run(path, optional=optional)
    if run.has_log and (wrong := _fault(run.recording)):
        raise StorageError(f"{path / LOG}: damaged, or not a log of a run: {wrong}")
    stability.check(run.theory, run.path / THEORY)
    return run


def _told_before(run: RunFolder, files: Sequence[str]) -> RunAbout:
    """What a run says about itself of which an older podusv wrote no about.json.

    It follows from the scenario; `files` are plug-ins. Raises UsageError where that cannot be read.
    """
    source = str(run.path / RESOLVED)
    try:
        given = load_stored(run.resolved_yaml, source, plugged=partial(used_of, files))
    except ScenarioError as error:
        raise UsageError(
            f"{run.path}: an older podusv wrote it without {ABOUT}, and its scenario cannot be "
            f"read: {str(error).splitlines()[0]}; name the files of its plug-ins with --plugin, or "
            f"make the run anew: {continue_with('rerun', run.path)} --out NEW"
        ) from error
    return about_of(given.scenario)


def _fault(log: Recording) -> str:
    """The first fault of a log, in words; empty if there is none."""
    wanted = [*NEEDED, *(name for signal, rest in BESIDE.items() if signal in log for name in rest)]
    lacking = [name for name in wanted if name not in log]
    if lacking:
        return f"it has no {lacking[0]}"
    wild = [name for name in NEEDED if not np.all(np.abs(log[name]) <= LARGEST)]
    if wild:
        return f"{wild[0]} holds something that is no finite number"
    return "" if np.all(np.diff(log["time"]) > 0.0) else "its times do not increase"


def distinct(members: Iterable[Member]) -> list[Member]:
    """The members, in order, each with a label of its own."""
    members = list(members)
    labels = number_names([member.label for member in members], taken=RESERVED)
    return [replace(member, label=label) for member, label in zip(members, labels, strict=True)]


def number_names(names: Iterable[str], taken: Iterable[str] = ()) -> list[str]:
    """The names; repeated ones and those `taken` get a number: pid, pid_2, ...

    Some file systems do not tell upper from lower case, so neither does this.
    """
    labels, used = list[str](), {name.casefold() for name in taken}
    for name in names:
        label, count = name, 1
        while label.casefold() in used:
            count += 1
            label = f"{name}_{count}"
        used.add(label.casefold())
        labels.append(label)
    return labels
