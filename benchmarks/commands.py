"""Whole commands, from the shell's point of view: time, memory, and where the time goes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.cases import ROOT, SCENARIO
from benchmarks.timing import quartiles

REPEATS = 3
COMPARED = SCENARIO.with_name("corrected_compare.yaml")  # four laws
PODUSV = ("-m", "podusv_cli")
LIBRARIES = ("-c", "import numpy, h5py, pydantic, typer, yaml, llvmlite")
RUN = ("run", str(SCENARIO), "--json")
LATER = {
    "podusv --help": ("--help",),
    "podusv validate": ("validate", str(SCENARIO)),
    "podusv run --no-figures": (*RUN, "--no-figures"),
    "podusv run": RUN,
    "podusv compare": ("compare", str(COMPARED), "--json"),
}
# Runs the command that its arguments make. A process of its own, since memory that a child has
# in common with a large parent when it is started counts as the child's.
MEASURE = """
import os, resource, sys, time
began = time.perf_counter()
code = os.spawnv(os.P_WAIT, sys.argv[1], sys.argv[1:])
took = time.perf_counter() - began
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(code, took, used.ru_utime + used.ru_stime, used.ru_maxrss, file=sys.stderr)
"""


def spent(
    arguments: Sequence[str], folder: Path, program: Sequence[str] = PODUSV
) -> dict[str, Any]:
    """Seconds, those that processors were busy, peak memory in MB and output of podusv.

    Or of another program of Python's. It runs in `folder` with its cache there. Raises RuntimeError
    where the command fails.
    """
    paths = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))
    command = [sys.executable, "-S", "-c", MEASURE, sys.executable, *program, *arguments]
    environment = os.environ | {"PODUSV_CACHE": str(folder / "cache"), "PYTHONPATH": paths}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # an installed podusv has its byte code
    done = subprocess.run(
        command, check=True, capture_output=True, text=True, cwd=folder, env=environment
    )
    code, seconds, busy, peak = done.stderr.splitlines()[-1].split()
    if code != "0":
        raise RuntimeError(f"podusv {' '.join(arguments)} failed: {done.stderr}")
    unit = 1 if sys.platform == "darwin" else 1024  # of ru_maxrss in bytes
    megabytes = int(peak) * unit / 1e6
    return {
        "seconds": float(seconds), "busy": float(busy), "megabytes": megabytes,
        "output": done.stdout,
    }  # fmt: skip


def commands() -> dict[str, dict[str, Any]]:
    """Quartiles of time and memory; the first run finds no compiled code, the later ones do.

    Processors' time also beside that of importing podusv's libraries, measured in turn. Runs also
    say where the time of the last of them went.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        first = spent((*RUN, "--no-figures", "--out", "first"), folder)
        found = {"podusv run --no-figures, for the first time": _summary(RUN, [first])}
        for label, arguments in LATER.items():
            several, imports = [], []
            for _ in range(REPEATS):
                imports.append(spent((), folder, LIBRARIES)["busy"])
                several.append(spent(_apart(arguments, folder), folder))
            ratios = np.array([one["busy"] for one in several]) / imports
            found[label] = _summary(arguments, several) | {"ratio": quartiles(ratios)}
        report = next(folder.glob("*/report.html"))
        found["podusv compare"]["report_megabytes"] = report.stat().st_size / 1e6
    return found


def _apart(arguments: Sequence[str], folder: Path) -> Sequence[str]:
    if arguments[0] not in ("run", "compare"):
        return arguments
    return (*arguments, "--out", f"{arguments[0]}-{len(list(folder.iterdir()))}")


def _summary(arguments: Sequence[str], several: list[dict[str, Any]]) -> dict[str, Any]:
    parts = json.loads(several[-1]["output"])["timing"] if arguments[0] == "run" else {}
    return {
        "seconds": quartiles(np.array([one["seconds"] for one in several])),
        "busy": quartiles(np.array([one["busy"] for one in several])),
        "megabytes": quartiles(np.array([one["megabytes"] for one in several])),
        "parts": parts,
    }
