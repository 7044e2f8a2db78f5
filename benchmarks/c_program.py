"""closed_loop.c: compiled, run, and held against podusv's results."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.cases import NETWORKS, Case, grid, run_probe
from podusv_cli.core.kernel import Vector
from podusv_cli.engine.loop.closed_loop import STATE
from podusv_cli.engine.running.simulate import simulate

SOURCE = Path(__file__).with_name("closed_loop.c")
FLAGS = {"O3": ("-O3", "-march=native"), "Ofast": ("-Ofast", "-march=native")}
TOLERANCE = 1e-9  # relative, for every number of the last state and for iae


@dataclass(frozen=True)
class Outcome:
    """Integral of the distance [m s], the last state, and the median CPU time of the loop [s]."""

    iae: float
    state: Vector
    seconds: float = 0.0


@cache
def compiler() -> str:
    """The C compiler. Raises FileNotFoundError where there is none."""
    found = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if found is None:
        raise FileNotFoundError("the benchmarks need a C compiler (cc, gcc or clang) on the PATH")
    return found


def build(folder: Path) -> dict[str, Path]:
    """The programs, one for each set of flags, compiled into this folder."""
    programs = {name: folder / f"closed_loop_{name}" for name in FLAGS}
    for name, target in programs.items():
        command = [compiler(), *FLAGS[name], "-o", str(target), str(SOURCE), "-lm"]
        subprocess.run(command, check=True)
    return programs


def run(program: Path, case: Case, *, repeats: int = 1, steps: int | None = None) -> Outcome:
    """Run a program on a case, `repeats` times over; see closed_loop.c for its arguments."""
    steps = grid().steps if steps is None else steps
    command = [str(program), case.law, str(repeats), "1", str(steps)]
    network = NETWORKS[case.network or "27 grid"]  # a law without one does not look at it
    centers = "\n".join(" ".join(map(repr, center)) for center in network.centers)
    command += ["list"] if centers else ["grid", *map(str, network.nodes)]
    command += [repr(float(width)) for width in network.width_array()]
    done = subprocess.run(command, check=True, capture_output=True, text=True, input=centers)
    seconds, iae, *state = map(float, done.stdout.split())
    return Outcome(iae, np.array(state), seconds)


def podusv_outcome(case: Case, steps: int | None = None) -> Outcome:
    """The same numbers from podusv."""
    loop, over = case.loop(), grid(steps)
    probe = run_probe(loop, over)
    recording = simulate(loop, over, probe=probe)
    if recording.status != "finished" or recording.seen is None:
        raise ValueError(f"{case.label}: {recording.message or recording.status}")
    slots = [part.name for part, _ in loop.controller.slots()]
    slots = [name for name in slots if not name.startswith("psi_d")]
    state = np.concatenate([np.ravel(recording[name][-1]) for name in (*STATE, *slots)])
    return Outcome(probe.summary(recording.seen)["iae"], state)


def difference(a: Outcome, b: Outcome) -> float:
    """The largest relative difference of any number."""
    left, right = np.append(a.state, a.iae), np.append(b.state, b.iae)
    assert left.shape == right.shape, (left.shape, right.shape)
    return float(np.max(np.abs(left - right) / np.maximum(np.abs(right), 1e-300)))


def agreement(programs: Mapping[str, Path], case: Case) -> dict[str, float]:
    """How far podusv and each program are apart. Raises ValueError beyond TOLERANCE."""
    ours = podusv_outcome(case)
    apart = {name: difference(ours, run(program, case)) for name, program in programs.items()}
    for name, relative in apart.items():
        if not relative <= TOLERANCE:
            raise ValueError(
                f"{case.label}: C -{name} and podusv are {relative:.2g} apart; not timed"
            )
    return apart


def timer(program: Path, case: Case, *, repeats: int = 3) -> Callable[[], float]:
    """A function that gives the median time of the loop over a few repeats [CPU s]."""
    return lambda: run(program, case, repeats=repeats).seconds
