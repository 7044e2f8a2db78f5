"""Whole commands, from the shell's point of view: time, memory, and where the time goes.

`python -m benchmarks.commands` measures them alone, and prints processors' time in units of T, the
time that importing podusv's libraries takes.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.cases import ROOT, SCENARIO
from benchmarks.timing import quartiles

REPEATS = 5
COMPARED = SCENARIO.with_name("corrected_compare.yaml")  # four laws
PODUSV = ("-m", "podusv_cli")
LIBRARIES = ("-c", "import numpy, h5py, pydantic, typer, yaml, llvmlite.binding")
RUN = ("run", str(SCENARIO), "--json")
FIRST = "podusv run --no-figures, for the first time"
BOAT = (
    "start",
    "boat",
    "--length",
    "2",
    "--beam",
    "0.8",
    "--mass",
    "60",
    "--thrusters",
    "2x50N@0.3",
)
# What somebody does first, each with nothing compiled.
FIRST_RUNS = {
    "podusv run podusv:own_vessel.yaml --no-figures": (
        "run",
        "podusv:own_vessel.yaml",
        "--no-figures",
    ),
    "podusv run podusv:mu_2017/corrected.yaml --no-figures": (
        "run",
        "podusv:mu_2017/corrected.yaml",
        "--no-figures",
    ),
    "podusv demo": ("demo", "--no-browser"),
    "podusv compare of a scenario of podusv start": ("compare", "boat.yaml"),
}
# podusv as a checkout without kernels.xz has it: numba compiles.
BY_NUMBA = """
from pathlib import Path
from podusv_cli.engine.machine import shipped
shipped.FILE = Path("none")
from podusv_cli.__main__ import main
main()
"""
STUDY, SHORT = (
    "podusv sweep run of {} draws, --no-figures",
    "a run of 1000 steps of a study, 1000 T",
)
FEW, MANY = 8, 1008  # draws, of which the difference is what a run costs
LATER = {
    "podusv --help": ("--help",),
    "podusv validate": ("validate", str(SCENARIO)),
    "podusv run --no-figures": (*RUN, "--no-figures"),
    "podusv run": RUN,
    "podusv compare": ("compare", str(COMPARED), "--json"),
    **{
        STUDY.format(draws): (
            "sweep",
            "run",
            "short.yaml",
            "--force",
            "--no-figures",
            "--workers",
            "1",
            "--set",
            f"sweep.draws={draws}",
        )
        for draws in (FEW, MANY)
    },
}
# Drawn hulls and seas with one law, ten seconds each; no log is kept.
STUDIED = f"""
extends: {ROOT / "configs/studies/hull_and_sea.yaml"}
name: short
simulation: {{duration: 10.0}}
sweep:
  laws: [adaptive_neural]
  keep: {{failed: 0, worst: {{iae: 0}}, draws: []}}
  claims: {{S1: null, S2: null, S3: null, S4: null}}
"""
# Has the code for eight runs side by side compiled, as a study of 20 000 such runs has.
SIDE_BY_SIDE = """
import podusv
podusv.simulate_many("short.yaml", {"start.x": [0.0] * 8}, side_by_side=True)
"""
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
        "seconds": float(seconds),
        "busy": float(busy),
        "megabytes": megabytes,
        "output": done.stdout,
    }


def commands() -> dict[str, dict[str, Any]]:
    """Quartiles of time and memory; the first run finds no compiled code, the later ones do.

    Processors' time also in units of that of importing podusv's libraries, measured in turn:
    quartiles of the ratios, and the ratio of the least times, which other programs disturb least.
    Runs also say where the time of the last of them went.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "short.yaml").write_text(STUDIED)
        imports = [spent((), folder, LIBRARIES)["busy"]]
        first = spent((*RUN, "--no-figures", "--out", "first"), folder)
        measured: dict[str, tuple[Sequence[str], list[dict[str, Any]]]] = {FIRST: (RUN, [first])}
        spent((), folder, ("-c", SIDE_BY_SIDE))
        spent(LATER[STUDY.format(FEW)], folder)
        found: dict[str, dict[str, Any]] = {}
        for label, arguments in LATER.items():
            several, before = [], len(imports)
            for _ in range(REPEATS):
                imports.append(spent((), folder, LIBRARIES)["busy"])
                several.append(spent(_apart(arguments, folder), folder))
            measured[label] = (arguments, several)
            ratios = np.array([one["busy"] for one in several]) / imports[before:]
            found[label] = {"ratio": quartiles(ratios)}
        for label, (words, several) in measured.items():
            least = min(one["busy"] for one in several) / min(imports)
            found[label] = _summary(words, several) | {"least": least} | found.get(label, {})
        report = next(folder.glob("*/report.html"))
        found["podusv compare"]["report_megabytes"] = report.stat().st_size / 1e6
        return found


def first_runs() -> dict[str, tuple[float, float, float]]:
    """Processors' seconds of first runs: kernels shipped, by numba, and once more thereafter.

    The least of three each, measured in turn.
    """
    found = {}
    for label, arguments in FIRST_RUNS.items():
        rounds = [_first_run(arguments) for _ in range(3)]
        found[label] = tuple(map(min, zip(*rounds, strict=True)))
    return found


def _first_run(arguments: Sequence[str]) -> tuple[float, float, float]:
    busy = []
    for program in (PODUSV, ("-c", BY_NUMBA)):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            if arguments[-1] == "boat.yaml":
                spent(BOAT, folder)
            busy.append(spent((*arguments, "--out", "first"), folder, program)["busy"])
            if program is PODUSV:
                later = spent((*arguments, "--out", "later"), folder)["busy"]
    return busy[0], busy[1], later


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


def short_run(found: Mapping[str, Mapping[str, Any]]) -> float:
    """What one more run of a study of short runs takes, in thousandths of T."""
    more = found[STUDY.format(MANY)]["least"] - found[STUDY.format(FEW)]["least"]
    return float(1000.0 * more / (MANY - FEW))


def main() -> None:
    """Print the table."""
    found = commands()
    rows = [
        [name, f"{measured['least']:.2f}", f"{measured['megabytes'][1]:.0f}"]
        for name, measured in found.items()
    ]
    for cells in (["command", "T", "peak memory, MB"], ["---"] * 3, *rows):
        print(f"| {' | '.join(cells)} |")
    print("\n| first run, processors' seconds | kernels shipped | by numba | once more |")
    print("| --- | --- | --- | --- |")
    for label, times in first_runs().items():
        print(f"| {label} | {' | '.join(f'{seconds:.2f}' for seconds in times)} |")
    print(f"\none more run of 1000 steps in a study: {short_run(found):.2f} thousandths of T")


if __name__ == "__main__":
    main()
