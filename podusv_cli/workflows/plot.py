"""`podusv plot`: figures of finished runs, overlaid."""

from __future__ import annotations

import math
import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from podusv_cli.comparison.differences import differences
from podusv_cli.core.errors import StorageError, UsageError
from podusv_cli.core.escaping import visible
from podusv_cli.core.past_run import PastRun
from podusv_cli.core.phrases import unknown_word
from podusv_cli.core.recording import Recording
from podusv_cli.figures import panels
from podusv_cli.figures.animation import animate, file_name
from podusv_cli.figures.drawing import ALL, SCREEN, check_names, draw_in_parallel, figures_of
from podusv_cli.figures.sheet import Sheet
from podusv_cli.figures.shown import Shown, dress_runs
from podusv_cli.figures.style import STYLES, Look
from podusv_cli.process.extras import Extras, Failure
from podusv_cli.storage import files, manifest
from podusv_cli.workflows.members import Member, from_folder
from podusv_cli.workflows.request import Request

NARROW = 5.0  # inches; narrower figures have their panels in one column
LARGEST = 40.0  # inches, of a figure
STAMP = re.compile(r"\d{8}T\d{6}Z-[0-9a-f]{8}(-\d+)?")  # a run folder that nobody named


@dataclass(frozen=True)
class Drawn:
    """The files that were drawn, and what the user has to know about them."""

    files: Sequence[Path]
    replaced: Sequence[Path]  # of `files`, those that existed with other content
    empty: Mapping[str, str]  # runs with nothing to draw, and how they ended
    missing: Sequence[Failure]  # figures that could not be drawn
    differences: Mapping[str, Mapping[str, Any]]  # between the runs, besides the controller


@dataclass(frozen=True)
class PlotChoice:
    """What `plot` draws beside figures by name, of which part of the runs [s], and how.

    `labels` are names of the runs, in their order.
    """

    signals: Sequence[str] = ()
    since: float = -math.inf
    until: float = math.inf
    labels: Sequence[str] = ()
    look: Look = SCREEN
    animated: bool = False


def look_of(columns: int, size: str, style: str) -> Look:
    """The look that is asked for: width in columns of a page, or `size`, and the name of a style.

    `size` is WIDTH or WIDTHxHEIGHT in inches, "" for that of the columns. Raises UsageError.
    """
    if style not in STYLES:
        raise UsageError(unknown_word(f"style {style!r}", style, STYLES))
    if not size:
        return Look(columns, style=STYLES[style])
    numbers = re.fullmatch(r"(\d+(?:\.\d*)?)(?:x(\d+(?:\.\d*)?))?", size)
    width, height = (float(part or 0.0) for part in numbers.groups()) if numbers else (0.0, 0.0)
    if not 1.0 <= width <= LARGEST or (height and not 1.0 <= height <= LARGEST):
        raise UsageError(
            f"--size {size!r}: must be WIDTH or WIDTHxHEIGHT in inches, each from 1 to "
            f"{LARGEST:g}, such as 5 or 5x3; --columns 1 and 2 are those of a journal page"
        )
    return Look(1 if width < NARROW else 2, width, height or None, STYLES[style])


def plot(runs: Sequence[Path], request: Request, choice: PlotChoice = PlotChoice()) -> Drawn:
    """Draw finished runs, overlaid; files of the same names in the folder are replaced.

    Raises UsageError for an unknown figure, signal or format, for a figure that the runs lack the
    signals of, for labels that do not fit the runs, for a time that no run has, and for a file that
    belongs to a finished folder; StorageError.
    """
    out = request.out or Path()
    members = _label_members(run for path in runs for run in from_folder(path, request.plugins))
    members = _name_members(members, choice.labels)
    known = figures_of(member.plugins for member in members)
    check_names(request.names, request.formats, known)
    whole = [m.folder.as_run(m.label, m.about, m.plugins) for m in members if m.folder]
    empty = _empty(whole, dress_runs(whole))
    shown = dress_runs([replace(run, log=_during(run.recording, choice)) for run in whole])
    if not shown:
        ends = ", ".join(f"{run.label} ends at {run.recording['time'][-1]:g} s" for run in whole)
        raise UsageError(
            f"no run has two instants from {choice.since:g} to {choice.until:g} s ({ends})"
        )
    sheets = _choose_sheets(request.names, known, shown, choice.signals)
    planned = [f"{sheet.name}.{form}" for sheet in sheets for form in request.formats]
    # Known before it is drawn, as every file's place is checked first.
    film = file_name()
    planned += [film] * choice.animated
    _check_not_finished(out, planned)
    files.check_places(out / name for name in planned)
    extras = Extras()
    drawn = draw_in_parallel(shown, sheets, request.formats, extras, choice.look)
    if choice.animated:
        drawn |= extras.attempt(film, lambda: {film: animate(shown, film)}) or {}
    if extras.interrupted:
        raise KeyboardInterrupt("interrupted; no figure was written")
    replaced = _put(out, drawn)
    differing = differences({m.label: m.about.values for m in members})
    return Drawn([out / n for n in drawn], replaced, empty, extras.missing, differing)


def _name_members(members: Sequence[Member], labels: Sequence[str]) -> list[Member]:
    """The runs under the names in `labels`, if any. Raises UsageError unless each run has one."""
    if not labels:
        return list(members)
    if len(labels) != len(members) or len({*labels}) < len(labels):
        raise UsageError(
            f"--label: the {len(members)} runs need a name each, no two the same, in their order: "
            f"{', '.join(member.label for member in members)}"
        )
    return [replace(member, label=label) for member, label in zip(members, labels, strict=True)]


def _during(log: Recording, choice: PlotChoice) -> Recording:
    """The part of a log that is asked for.

    A part that ends before the run does counts as finished, so that no figure marks its end as a
    failure.
    """
    t = log["time"]
    # The last instant is included.
    first, last = np.searchsorted(t, [choice.since, np.nextafter(choice.until, math.inf)])
    if (first, last) == (0, len(t)):
        return log
    part = log.part(slice(first, last))
    return part if last == len(t) else replace(part, status="finished")


def _label_members(members: Iterable[Member]) -> list[Member]:
    """Each run folder once, with a label that tells it apart from the others.

    The folder's name, or the scenario's where the folder is named by a time; where several have the
    same, with their scenario's name, else with the folder around them, else with all of it.
    """
    kept = list({_folder(member).resolve(): member for member in members}.values())
    labels = [_short(member) for member in kept]
    for longer in LONGER_NAMES:
        count = Counter(labels)
        labels = [
            longer(member) if count[label] > 1 else label
            for member, label in zip(kept, labels, strict=True)
        ]
    return [replace(member, label=label) for member, label in zip(kept, labels, strict=True)]


def _folder(member: Member) -> Path:
    return member.folder.path if member.folder else Path(member.label)


def _short(member: Member) -> str:
    """A run's label: its scenario's name, where its folder is called by a time."""
    name = _folder(member).resolve().name
    return member.about.name if STAMP.fullmatch(name) else name


def _empty(runs: Sequence[PastRun], shown: Sequence[Shown]) -> dict[str, str]:
    """Runs of which nothing can be drawn, and how they ended; `shown` are those to draw.

    Raises UsageError if none is left.
    """
    drawable = {run.label for run in shown}
    endings = {
        run.label: run.recording.message or "has a single row"
        for run in runs
        if visible(run.label) not in drawable
    }
    if not shown:
        endings_in_words = "; ".join(f"{label}: {ending}" for label, ending in endings.items())
        raise UsageError(f"there is nothing to draw: {endings_in_words}")
    return endings


LONGER_NAMES: tuple[Callable[[Member], str], ...] = (
    lambda member: f"{_short(member)} ({member.about.name})",
    lambda member: f"{_folder(member).parent.name}/{_folder(member).name}",
    lambda member: str(_folder(member)),
)


def _choose_sheets(
    asked: Sequence[str], known: Mapping[str, Sheet], shown: Sequence[Shown], signals: Sequence[str]
) -> list[Sheet]:
    """The figures to draw: those `asked` for and one of `signals`, or all that the runs can fill.

    `known` are all figures by name. Raises UsageError for one that the runs have no signals for.
    """
    fitting = {name: sheet for name, sheet in known.items() if sheet.fits(shown)}
    asked = [*fitting] if ALL in asked else asked
    for name in asked:
        if name not in fitting:
            raise UsageError(
                f"figure {name!r} shows {', '.join(known[name].signals)}, and "
                f"{', '.join(run.label for run in shown)} logged none of these "
                f"(figures there are: {', '.join(fitting)})"
            )
    signals = tuple(dict.fromkeys(signals))
    there = dict.fromkeys(name for run in shown for name in run.signals)
    for name in signals:
        if name not in there:
            raise UsageError(unknown_word(f"signal {name!r}", name, there, "log.h5 of the runs"))
    sheets = [fitting[name] for name in dict.fromkeys(asked)]
    sheets += [panels.signals(*signals)] if signals else []
    return sheets or list(fitting.values())


def _check_not_finished(out: Path, names: Iterable[str]) -> None:
    """Raise UsageError where a file to be written belongs to a finished folder, by its manifest.

    The folder may be `out` or one around it.
    """
    # Where links lead to, as that is where files are written.
    place = Path(os.path.realpath(out))
    for folder in (place, *place.parents):
        listed = _list_folder(folder)
        for name in names:
            inside = (place / name).relative_to(folder).as_posix()
            if inside in listed or inside == manifest.NAME:
                raise UsageError(
                    f"--out {out}: {inside} belongs to the finished folder {folder}, whose files "
                    "stay as they were written; name another folder"
                )


def _list_folder(folder: Path) -> frozenset[str]:
    """The files that a finished folder lists; none where there is no manifest."""
    with suppress(StorageError):
        return frozenset(manifest.read(folder).files)
    return frozenset()


def _put(out: Path, contents: Mapping[str, bytes]) -> list[Path]:
    """Write files into a folder; the paths of those that were there with another content.

    Raises StorageError.
    """
    files.make_folder(out)
    places = {out / name: content for name, content in contents.items()}
    replaced = [path for path, content in places.items() if _differs(path, content)]
    files.write_all(places)
    return replaced


def _differs(path: Path, content: bytes) -> bool:
    """Whether a file is there with another content. Raises StorageError."""
    with files.storage_errors(f"cannot read {path}"):
        return path.is_file() and path.read_bytes() != content
