"""Timing in turns, quartiles, and the facts about a machine that matter."""

from __future__ import annotations

import os
import platform
import subprocess
import time
from collections.abc import Callable, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.c_program import FLAGS, compiler
from podusv_cli.core.kernel import Vector

Timer = Callable[[], float]
LIBRARIES = ("podusv", "numpy", "scipy", "numba", "llvmlite", "h5py", "matplotlib")


def timed(
    work: Callable[[], Any], repeats: int = 3, clock: Callable[[], float] = time.perf_counter
) -> Timer:
    """A function that gives the median time of `work` over a few repeats [s].

    `time.process_time` as the clock leaves out what other programs use of the processor.
    """

    def once() -> float:
        began = clock()
        work()
        return clock() - began

    return lambda: float(np.median([once() for _ in range(repeats)]))


def in_turns(timers: Mapping[str, Timer], rounds: int) -> dict[str, Vector]:
    """Times [s] of all timers, one after another, round by round; a first round is thrown away.

    A machine whose speed drifts, or that does other work at times, treats them alike. Every round
    begins with the next timer, since what comes before leaves its trace in the caches.
    """
    order, times = list(timers), {name: np.zeros(rounds + 1) for name in timers}
    for k in range(rounds + 1):
        for name in order:
            times[name][k] = timers[name]()
        order = [*order[1:], order[0]]
    return {name: values[1:] for name, values in times.items()}


def quartiles(values: Vector) -> list[float]:
    """Lower quartile, median, upper quartile."""
    return [float(q) for q in np.percentile(values, [25, 50, 75])]


def ratio(times: Mapping[str, Vector], above: str, below: str) -> list[float]:
    """Quartiles of the ratio of two timers, round by round."""
    return quartiles(times[above] / times[below])


def machine() -> dict[str, str]:
    """Processor, system, compiler and libraries; nothing that tells whose machine it is."""
    command = [compiler(), "--version"]
    first_line = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    facts = {
        "processor": _processor(),
        "cores": str(os.cpu_count()),
        "system": f"{platform.system()} {platform.machine()}, {' '.join(platform.libc_ver())}",
        "C compiler": first_line.splitlines()[0],
        "C flags": "; ".join(" ".join(flags) for flags in FLAGS.values()),
        "Python": platform.python_version(),
    }
    return facts | {name: _version(name) for name in LIBRARIES}


def _version(name: str) -> str:
    if name == "podusv":  # which may run from its checkout
        from podusv_cli import __version__

        return __version__
    return version(name)


def _processor() -> str:
    listing = Path("/proc/cpuinfo")
    if not listing.exists():
        return platform.processor()
    lines = [line.partition(":") for line in listing.read_text().splitlines()]
    found = {key.strip(): content.strip() for key, _, content in lines}
    family = "family {cpu family} model {model}".format_map(found) if "model" in found else ""
    return f"{found.get('model name', platform.machine())} {family}".strip()
