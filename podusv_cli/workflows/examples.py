"""The examples that come with podusv: folders with a README, and notebooks."""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path

from podusv_cli.scenario import shipped

PREFIX, ROOM, README = "example/", "examples", "README.md"
HEADING = re.compile(r"^# (.+)$", re.MULTILINE)
OF_RUNS = ("__pycache__", "results")  # what running an example leaves in a checkout


@cache
def examples() -> dict[str, str]:
    """Every example by the name that `podusv init` takes, and its title."""
    room = shipped.folder(ROOM)
    titles = {path.parent.name: path.read_text("utf-8") for path in room.glob(f"*/{README}")}
    titles |= {path.stem: _first_cell(path) for path in room.glob("*.ipynb")}
    return {f"{PREFIX}{name}": HEADING.findall(titles[name])[0] for name in sorted(titles)}


def _first_cell(notebook: Path) -> str:
    return "".join(json.loads(notebook.read_text("utf-8"))["cells"][0]["source"])


def name_of(place: str) -> str:
    """The example that a file of a checkout begins; "" for any other file."""
    name = place.removeprefix(f"{ROOM}/").removesuffix(f"/{README}").removesuffix(".ipynb")
    return f"{PREFIX}{name}" if f"{PREFIX}{name}" in examples() else ""


def texts(name: str) -> dict[str, str]:
    """The files of an example as they are in a checkout's folder `examples`, README first."""
    room, short = shipped.folder(ROOM), name.removeprefix(PREFIX)
    paths = [room / short / README, *sorted((room / short).rglob("*"))]
    if not paths[0].exists():
        paths = [room / f"{short}.ipynb"]
    named = {path.relative_to(room): path for path in paths if path.is_file()}
    return {
        relative.as_posix(): path.read_text("utf-8")
        for relative, path in named.items()
        if not {*OF_RUNS} & {*relative.parts} and ".egg-info" not in str(relative)
    }
