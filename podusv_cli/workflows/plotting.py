"""What `plot` is asked for, checked against what the runs have: names, figures, places."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from podusv_cli.core.errors import StorageError, UsageError
from podusv_cli.core.escaping import visible
from podusv_cli.figures.drawing import FIGURES
from podusv_cli.figures.style import FORMATS, Shown
from podusv_cli.scenario.words import unknown
from podusv_cli.storage import files as atomic
from podusv_cli.storage import manifest
from podusv_cli.workflows.comparing import Part

STAMP = re.compile(r"\d{8}T\d{6}Z-[0-9a-f]{8}(-\d+)?")  # a run folder that nobody named


def named(parts: Iterable[Part]) -> list[Part]:
    """Each run folder once, with a label that tells it apart from the others.

    The folder's name, or the scenario's where the folder has none of its own; where several have
    the same, with their scenario's name, else with the folder around them, else with all of it.
    """
    kept = list({_folder(part).resolve(): part for part in parts}.values())
    labels = [_short(part) for part in kept]
    for longer in LONGER_NAMES:
        count = Counter(labels)
        labels = [
            longer(part) if count[label] > 1 else label
            for part, label in zip(kept, labels, strict=True)
        ]
    return [replace(part, label=label) for part, label in zip(kept, labels, strict=True)]


def _folder(part: Part) -> Path:
    return part.run.folder if part.run else Path(part.label)


def _short(part: Part) -> str:
    name = _folder(part).resolve().name
    return part.scenario.name if STAMP.fullmatch(name) else name


def empty(parts: Sequence[Part], shown: Sequence[Shown]) -> dict[str, str]:
    """Runs of which nothing can be drawn, and how they ended; UsageError where those are all."""
    drawable = {run.label for run in shown}
    endings = {
        part.label: part.run.recording.message or "has a single row"
        for part in parts
        if part.run and visible(part.label) not in drawable
    }
    if not shown:
        told = "; ".join(f"{label}: {ending}" for label, ending in endings.items())
        raise UsageError(f"there is nothing to draw: {told}")
    return endings


LONGER_NAMES: tuple[Callable[[Part], str], ...] = (
    lambda part: f"{_short(part)} ({part.scenario.name})",
    lambda part: f"{_folder(part).parent.name}/{_folder(part).name}",
    lambda part: str(_folder(part)),
)


def chosen(asked: Sequence[str], shown: Sequence[Shown]) -> tuple[str, ...]:
    """The figures to draw: those that are asked for, or all that the runs have signals for.

    Raises UsageError for one that they have no signals for.
    """
    fitting = tuple(name for name, sheet in FIGURES.items() if sheet.fits(shown))
    for name in asked:
        if name not in fitting:
            raise UsageError(
                f"figure {name!r} shows {', '.join(FIGURES[name].signals)}, and "
                f"{', '.join(run.label for run in shown)} logged none of these "
                f"(figures there are: {', '.join(fitting)})"
            )
    return tuple(dict.fromkeys(asked)) or fitting


def check_names(figures: Sequence[str], formats: Sequence[str]) -> None:
    """UsageError for a figure or format that there is not."""
    for what, names, known in (("figure", figures, tuple(FIGURES)), ("format", formats, FORMATS)):
        for name in names:
            if name not in known:
                raise UsageError(unknown(f"{what} {name!r}", name, known))


def spared(out: Path, names: Iterable[str]) -> None:
    """UsageError where a file to be written belongs to a finished folder, by its manifest."""
    place = Path(os.path.realpath(out))
    for folder in (place, *place.parents):
        listed = _listed(folder)
        for name in names:
            inside = (place / name).relative_to(folder).as_posix()
            if inside in listed or inside == manifest.NAME:
                raise UsageError(
                    f"--out {out}: {inside} belongs to the finished folder {folder}, whose files "
                    "stay as they were written; name another folder"
                )


def _listed(folder: Path) -> frozenset[str]:
    with suppress(StorageError):
        return frozenset(manifest.read(folder).files)
    return frozenset()


def put(out: Path, contents: Mapping[str, bytes]) -> list[Path]:
    """Write files into a folder; those that were there with another content. StorageError."""
    atomic.make_folder(out)
    files = {out / name: content for name, content in contents.items()}
    replaced = [path for path, content in files.items() if _differs(path, content)]
    atomic.write_all(files)
    return replaced


def _differs(path: Path, content: bytes) -> bool:
    with atomic.explained(f"cannot read {path}"):
        return path.is_file() and path.read_bytes() != content
