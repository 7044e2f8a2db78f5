"""Python and shells in processes of their own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import matplotlib

import podusv_cli

ROOT = Path(podusv_cli.__file__).parents[1]


def python(*words: str, stdout: int = subprocess.PIPE) -> subprocess.CompletedProcess[str]:
    """A Python process of its own."""
    return subprocess.run(
        [sys.executable, *words],
        stdout=stdout,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        text=True,
        check=False,
        timeout=60,
    )


def said(*words: str, home: Path, **more: str) -> str:
    """What a process prints, which has to end well.

    In a new home matplotlib would make its list of fonts anew, and say so where that takes long.
    """
    fonts = {"MPLCONFIGDIR": matplotlib.get_cachedir()}
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "HOME": str(home), **fonts, **more}
    done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    return done.stdout


def offered_for(typed: str, home: Path, script: str) -> list[str]:
    """The lines that a shell gets from a script for what is typed."""
    count = str(typed.count(" "))
    asked = {"_PODUSV_COMPLETE": "complete_bash", "COMP_WORDS": typed, "COMP_CWORD": count}
    script = script.replace("import sys", "import sys\nsys.argv = ['podusv']", 1)
    return said(sys.executable, "-c", script, home=home, **asked).splitlines()
