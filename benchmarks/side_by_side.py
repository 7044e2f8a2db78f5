"""Runs side by side beside side_by_side.c, which marches eight runs as structure of arrays."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from benchmarks.c_program import TOLERANCE, compiler
from benchmarks.cases import Case, grid, run_probe
from benchmarks.timing import in_turns, quartiles, ratio, timed
from benchmarks.variants import variants
from podusv_cli.core.kernel import LANES, Vector
from podusv_cli.engine.running.batch import simulate_many

SOURCE = Path(__file__).with_name("side_by_side.c")
# Neither flag allows the compiler to change a result.
FLAGS = ("-O3", "-march=native", "-fopenmp-simd", "-fno-math-errno", "-fno-trapping-math")
WIDTHS = (256, 512)  # bits of the registers that the compiler prefers
STEPS = 31_000
CASE = Case("adaptive_neural", "27 grid")
SCALES = np.linspace(0.5, 1.5, LANES)  # of the disturbance


def programs(folder: Path) -> dict[str, Path]:
    """The programs, one for each width of registers, compiled into this folder."""
    made = {f"C, {width} bits": folder / f"side_by_side_{width}" for width in WIDTHS}
    for width, target in zip(WIDTHS, made.values(), strict=True):
        command = [compiler(), *FLAGS, f"-mprefer-vector-width={width}", "-o", str(target)]
        subprocess.run([*command, str(SOURCE), "-lm"], check=True)
    return made


def run(program: Path, repeats: int = 3) -> tuple[float, Vector]:
    """Processor time of all runs [s], and the integral of the distance of each [m s]."""
    command = [str(program), str(repeats), str(STEPS), *map(repr, SCALES.tolist())]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    seconds, *iae = map(float, done.stdout.split())
    return seconds, np.array(iae)


def podusv() -> tuple[Callable[[], Any], Vector]:
    """A function that makes the same runs with all metrics, and their integrals of the distance."""
    over = grid(STEPS, log_every=STEPS + 1)
    loops = variants(CASE.loop(), {"disturbance.scale": SCALES})
    probe = run_probe(loops[0], over)
    many = partial(simulate_many, loops, over, probe=probe, workers=1, side_by_side=True)
    return many, probe.summaries(many().seen)["iae"]


def side_by_side_costs(rounds: int = 7) -> dict[str, Any]:
    """Processor times of eight runs [s] and podusv's relative to C, after the results agreed.

    Raises ValueError where they do not.
    """
    many, iae = podusv()
    with tempfile.TemporaryDirectory() as folder:
        built = programs(Path(folder))
        for name, program in built.items():
            apart = float(np.max(np.abs(run(program, 1)[1] / iae - 1.0)))
            if not apart <= TOLERANCE:
                raise ValueError(f"side by side, podusv and {name} are {apart:.2g} apart")
        timers = {"podusv": timed(many, 3, process_time)}
        timers |= {name: partial(_seconds, program) for name, program in built.items()}
        times = in_turns(timers, rounds)
    return {
        "seconds": {name: quartiles(values / LANES) for name, values in times.items()},
        "ratios": {name: ratio(times, "podusv", name) for name in built},
    }


def _seconds(program: Path) -> float:
    return run(program)[0]
