"""`podusv new`: a starting file for a component of one's own, with its test and a scenario."""

from __future__ import annotations

import keyword
import re
from importlib.resources import files
from pathlib import Path
from string import Template

from podusv_cli.core.errors import StorageError, UsageError
from podusv_cli.scenario.phrases import unknown
from podusv_cli.scenario.plugins import kinds_of
from podusv_cli.storage import files as storage

# What there are starting files for, and the scenario's section of each.
SECTIONS = {"law": "controller", "path": "path", "disturbance": "disturbance"}
TEMPLATES = "podusv_cli.workflows"
FOLDER = "starting_files"


def new(what: str, name: str) -> list[Path]:
    """Write NAME.py, test_NAME.py and NAME.yaml into the current folder.

    Raises UsageError for a name that cannot be one, StorageError where a file exists.
    """
    if what not in SECTIONS:
        raise UsageError(unknown(f"part {what!r}", what, SECTIONS))
    _check_name(what, name)
    places = [Path(f"{name}.py"), Path(f"test_{name}.py"), Path(f"{name}.yaml")]
    for place in places:
        if place.exists():
            raise StorageError(f"{place} exists; take another name, or another folder")
    words = _words(what, name)
    texts = [_filled(form, words) for form in (f"{what}.py", "test.py", "scenario.yaml")]
    storage.write_all({p: t.encode() for p, t in zip(places, texts, strict=True)})
    return places


def _check_name(what: str, name: str) -> None:
    if not re.fullmatch("[a-z][a-z0-9_]{0,29}", name) or keyword.iskeyword(name):
        raise UsageError(f"{name!r}: a name here is at most 30 of a-z, 0-9 and _, like my_law")
    from podusv_cli.scenario.model import Scenario

    if name in kinds_of(Scenario, SECTIONS[what]):
        raise UsageError(f"{name!r} is a {what} of podusv; take another name")


def _words(what: str, name: str) -> dict[str, str]:
    parts = {"path": "line", "disturbance": "none", "law": "pid"} | {what: name}
    several = f"controllers: {{{name}: {{}}, pid: {{kind: pid}}}}"
    return parts | {
        "name": name, "what": what, "file": f"{name}.py",
        "Class": "".join(word.capitalize() for word in name.split("_")),
        "sentence": f"A {what} of our own.",
        "several": several if what == "law" else "",
    }  # fmt: skip


def _filled(form: str, words: dict[str, str]) -> str:
    text = files(TEMPLATES).joinpath(FOLDER, f"{form}.txt").read_text("utf-8")
    return Template(text).substitute(words).rstrip() + "\n"
