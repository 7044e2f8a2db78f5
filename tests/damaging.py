"""A process that damages a finished run in many ways, one after the other, and opens it each time.

    python damaging.py FOLDER

A way is a line on stdin, `kind argument` out of DAMAGES, with `!` in front where the manifest is
made to fit the damage. What came of it is a line of JSON on stdout: in a word, as an exit code, in
a sentence, and how much work [calls] and memory [MiB] it took.
"""

import hashlib
import json
import os
import resource
import shutil
import stat
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from counting import counted
from damages import DAMAGES

from podusv_cli.core.errors import PodusvError
from podusv_cli.scenario.load import load_stored
from podusv_cli.storage import log_reader
from podusv_cli.workflows import members

HOLE = 2**40  # bytes, none of them on the disk
MEBIBYTE = 1024 if sys.platform == "linux" else 1024**2  # in units of ru_maxrss


def refit(folder: Path) -> None:
    """Make the manifest true of whatever lies in the folder now, as an attacker would."""
    path = folder / "manifest.json"
    told = json.loads(path.read_text())
    for name in told["files"]:
        if os.path.lexists(folder / name):
            told["files"][name] = _entry(folder / name)
    path.write_text(json.dumps(told))


def _entry(path: Path) -> dict[str, Any]:
    found = path.lstat()
    plain = stat.S_ISREG(found.st_mode) and found.st_size < HOLE
    content = path.read_bytes() if plain else b""
    return {"sha256": hashlib.sha256(content).hexdigest(), "bytes": found.st_size}


def opened(folder: Path) -> tuple[Any, ...]:
    """All that plot, compare, rerun and diff take from a run folder."""
    (part,) = members.from_folder(folder)
    assert part.folder
    log = part.folder.recording
    numbers = {name: array.tobytes() for name, array in {**log.signals, **log.fixed}.items()}
    text = log_reader.resolved_yaml(folder / "log.h5")
    again = load_stored(part.resolved, "resolved.yaml").scenario  # as rerun takes it
    told = log.status, log.controller, log.message, part.folder.metrics, part.about
    return numbers, text, again, *told


def damaged(original: Path, folder: Path, way: str) -> None:
    """Put a copy of the run into `folder` and damage it."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(original, folder)
    kind, _, argument = way.removeprefix("!").partition(" ")
    DAMAGES[kind](folder, argument)
    if way.startswith("!"):
        refit(folder)


def verdict(act: Callable[[], object], whole: object) -> tuple[str, int, str]:
    """What comes of opening the folder."""
    try:
        return ("same" if act() == whole else "WRONG"), 0, ""
    except PodusvError as error:
        return "refused", error.exit_code, str(error)
    except Exception as error:
        return "CRASH", 1, repr(error)


def _peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / MEBIBYTE


def main(original: Path) -> None:
    """Go through the ways on stdin."""
    folder = original.with_name("damaged")
    whole = opened(original)
    for way in map(str.strip, sys.stdin):
        damaged(original, folder, way)
        peak = _peak()
        (word, code, said), calls = counted(lambda: verdict(lambda: opened(folder), whole))
        print(json.dumps([word, code, said, calls, _peak() - peak]), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
