"""`podusv new`: a starting file for a part of one's own, with its test and a scenario."""

from __future__ import annotations

import keyword
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from importlib.resources import files
from pathlib import Path
from string import Template

from podusv_cli.components.vessels.vessel import VESSELS
from podusv_cli.core.errors import StorageError, UsageError
from podusv_cli.core.phrases import unknown_word
from podusv_cli.metrics.table import METRICS
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.plugins import kinds_of
from podusv_cli.scenario.presets import preset_names
from podusv_cli.storage import files as storage

TEMPLATES = "podusv_cli.workflows"
FOLDER = "starting_files"
TESTED = "python -m pytest test_$name.py"
DEFAULTS = {"path": "line", "disturbance": "none", "law": "pid", "more": ""}


def _figures() -> Iterable[str]:
    """The names of all figures of podusv."""
    from podusv_cli.figures.drawing import FIGURES  # matplotlib is slow to import

    return FIGURES


@dataclass(frozen=True)
class StartingFiles:
    """What there is a starting file for: the names that are taken, files, and commands to try.

    `files` are templates by name; `words` are for templates.
    """

    taken: Callable[[], Iterable[str]]
    files: Mapping[str, str]
    commands: tuple[str, ...]
    words: Mapping[str, str] = field(default_factory=dict)


def _plugin(
    what: str, taken: Callable[[], Iterable[str]], command: str, **words: str
) -> StartingFiles:
    made = {"$name.py": f"{what}.py", "test_$name.py": "test.py", "$name.yaml": "scenario.yaml"}
    return StartingFiles(taken, made, (f"podusv {command} $name.yaml", TESTED), words)


PARTS = {
    "law": _plugin(
        "law",
        partial(kinds_of, Scenario, "controller"),
        "compare",
        law="$name",
        more="controllers: {$name: {}, pid: {kind: pid}}",
    ),
    "path": _plugin("path", partial(kinds_of, Scenario, "path"), "run", path="$name"),
    "disturbance": _plugin(
        "disturbance", partial(kinds_of, Scenario, "disturbance"), "run", disturbance="$name"
    ),
    "measurement": _plugin(
        "measurement",
        partial(kinds_of, Scenario, "measurement"),
        "run",
        more="measurement: {kind: $name}",
    ),
    "estimator": _plugin(
        "estimator",
        partial(kinds_of, Scenario, "estimator"),
        "run",
        more="measurement: {kind: sensors}\nestimator: {kind: $name}",
    ),
    "metric": _plugin("metric", lambda: METRICS, "run"),
    "figure": _plugin("figure", _figures, "compare"),
    "vessel": StartingFiles(
        partial(preset_names, VESSELS),
        {"$name.yaml": "vessel.yaml", "$name_line.yaml": "vessel_task.yaml"},
        ("podusv run $name_line.yaml",),
    ),
    "paper": StartingFiles(
        partial(kinds_of, Scenario, "controller"),
        {
            "$name/$name.py": "law.py",
            "$name/test_$name.py": "test.py",
            "$name/vessel.yaml": "vessel.yaml",
            "$name/base.yaml": "paper_base.yaml",
            "$name/task.yaml": "paper_task.yaml",
            "$name/starts.yaml": "paper_starts.yaml",
            "$name/README.md": "paper_page.md",
        },
        ("podusv compare $name/task.yaml", "python -m pytest $name/test_$name.py"),
    ),
}


@dataclass(frozen=True)
class WrittenFiles:
    """The files that were written, and commands to try them with."""

    files: tuple[Path, ...]
    commands: tuple[str, ...]


def new(what: str, name: str) -> WrittenFiles:
    """Write the starting files of a part (`what`, one of PARTS) into the current folder.

    Raises UsageError for a name that cannot be one, StorageError where a file exists.
    """
    if what not in PARTS:
        raise UsageError(unknown_word(f"part {what!r}", what, PARTS))
    part = PARTS[what]
    _check_name(what, name)
    words = _words(what, name)
    places = {Path(file.replace("$name", name)): form for file, form in part.files.items()}
    for place in places:
        if place.exists():
            raise StorageError(f"{place} exists; take another name, or another folder")
    storage.write_texts(Path(), {str(at): _fill_form(form, words) for at, form in places.items()})
    return WrittenFiles(
        tuple(places), tuple(command.replace("$name", name) for command in part.commands)
    )


def _check_name(what: str, name: str) -> None:
    """Raises UsageError for a name that is no identifier, or taken by a part of podusv."""
    if not re.fullmatch("[a-z][a-z0-9_]{0,29}", name) or keyword.iskeyword(name):
        raise UsageError(f"{name!r}: a name here is at most 30 of a-z, 0-9 and _, like my_law")
    if name in PARTS[what].taken():
        raise UsageError(f"{name!r} is a {what} of podusv; take another name")


def _words(what: str, name: str) -> dict[str, str]:
    """What stands for each placeholder in the template of a part.

    `what` is the kind of the part, as `law`, and `name` its own name.
    """
    own = {word: text.replace("$name", name) for word, text in PARTS[what].words.items()}
    return (
        DEFAULTS
        | own
        | {
            "name": name,
            "what": what,
            "file": f"{name}.py",
            "Class": "".join(word.capitalize() for word in name.split("_")),
            "sentence": f"{'An' if what[0] in 'aeiou' else 'A'} {what} of our own.",
        }
    )


def _fill_form(form: str, words: dict[str, str]) -> str:
    text = files(TEMPLATES).joinpath(FOLDER, f"{form}.txt").read_text("utf-8")
    return Template(text).substitute(words).rstrip() + "\n"
