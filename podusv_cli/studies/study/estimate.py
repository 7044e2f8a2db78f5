"""How long a study takes and how much disk it needs, from a few of its runs."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from podusv_cli.core.errors import StorageError
from podusv_cli.core.kernel import LANES
from podusv_cli.core.quantities import bytes_in_words, time_in_words
from podusv_cli.process.workers import run_all
from podusv_cli.scenario.limits import estimate as size_of_run
from podusv_cli.storage.run_folder import check_free_space
from podusv_cli.studies.study import runs_writer
from podusv_cli.studies.study.plan import LawInCell, Plan
from podusv_cli.studies.study.unit import Unit, make, prepare

PILOT = 0.2  # s of processor time that the first runs of a law in a cell are to take
MOST_RUNS = 32  # of a pilot
MOST_STEPS = 100_000  # of a run of a pilot
MOST_PLACES = 40  # laws and cells of which runs are timed
# Rough costs (s of processor time, bytes), which matter in small studies only.
REPORT, FIGURES, LOG, LOG_FIGURES = 2.0, 2.0, 0.5, 1.2
HELD_BYTES = 32  # of a run in memory while tables are made: four numbers
REPORT_BYTES, FIGURES_BYTES, LOG_BYTES, LOG_FIGURES_BYTES = 3.5e5, 1.2e6, 2e4, 3.5e5


@dataclass(frozen=True)
class Estimate:
    """What a study needs. The ends of a pair are without and with logs of failed runs, of which
    nobody knows how many there will be.

    `march` and `after` (report and kept logs) are processor time [s]. `untimed` are laws whose
    first runs end their process.
    """

    runs: int
    workers: int
    march: float
    after: tuple[float, float]
    table: float  # bytes of runs.h5
    kept: tuple[int, int]  # logs
    others: tuple[float, float]  # bytes of report, figures and kept logs
    untimed: tuple[str, ...] = ()

    @property
    def disk(self) -> tuple[float, float]:
        """Bytes of the finished study."""
        return self.table + self.others[0], self.table + self.others[1]

    def in_words(self) -> list[str]:
        """Time and disk of the runs, then of what is made from them."""
        cores = f"{self.workers} core{'s' if self.workers > 1 else ''}"
        pace = f"{1e3 * self.march / max(self.runs, 1):.3g} ms of computing a run"
        march = f"{self.runs:,} runs: about {time_in_words(self.march / self.workers)} on {cores}"
        after = _between([seconds / self.workers for seconds in self.after], time_in_words)
        logs = _between(self.kept, str)
        without = f", without {', '.join(self.untimed)}, which ended its process"
        told = f"{march} ({pace}{without if self.untimed else ''})"
        report = f"the report and {logs} kept logs" if self.kept[1] else "the report"
        return [
            f"{told}; {bytes_in_words(self.table)} in runs.h5",
            f"then {report}: about {after}, {_between(self.others, bytes_in_words)}",
        ]


def _between(ends: Sequence[float], words: Callable[[float], str]) -> str:
    low, high = map(words, ends)
    return low if low == high else f"{low} to {high}"


def pilot(
    plan: Plan, compiling: Callable[[str], Callable[[float], None] | None] = lambda law: None
) -> dict[LawInCell, float]:
    """Processor time of a run [s] of every law and cell, of the first draws.

    Of many cells some are timed, and the others take the mean of the law. The runs are made in a
    process of their own, since a law may end it or never return. A law that ends it in all cells
    is left out. `compiling` gives for a law what `prepare` calls. Raises LawError, and
    KeyboardInterrupt.
    """
    most = max(1, MOST_PLACES // len(plan.laws))
    cells = np.unique(np.linspace(0, len(plan.cells) - 1, most).astype(int)).tolist()
    places = [(law, cell) for law in plan.laws for cell in cells]
    for law, cell in places:
        prepare(plan, law, cell, compiling=compiling(law))
    outcomes = run_all([partial(_timed, plan, *place) for place in places], workers=1)
    if any(outcome.interrupted for outcome in outcomes):
        raise KeyboardInterrupt
    found = {
        place: float(one.result) for place, one in zip(places, outcomes, strict=True) if one.result
    }
    for law in plan.laws:
        if own := [seconds for (name, _), seconds in found.items() if name == law]:
            for cell in range(len(plan.cells)):
                found.setdefault((law, cell), float(np.mean(own)))
    return found


def _timed(plan: Plan, law: str, cell: int, progress: Callable[[float], None]) -> float:
    """Processor time of a run [s]: of as many as take long enough to be measured.

    Runs of one step come first and are not timed, since a process loads machine code then.
    """
    whole = plan.single(law, cell).time_grid()
    grid = replace(whole, steps=min(whole.steps, MOST_STEPS))
    make(plan, Unit(law, cell, 0, min(LANES, plan.sweep.draws)), grid=replace(whole, steps=1))
    count, spent = 1, 0.0
    while True:
        began = time.process_time()
        make(plan, Unit(law, cell, 0, count), grid=grid)
        spent = time.process_time() - began
        if spent >= PILOT or count >= min(MOST_RUNS, plan.sweep.draws):
            return spent / count * whole.steps / grid.steps
        count = min(2 * count, MOST_RUNS, plan.sweep.draws)


def estimate(
    plan: Plan, paces: Mapping[LawInCell, float], missing: Mapping[LawInCell, int], workers: int, *,
    figures: bool = True,
) -> Estimate:  # fmt: skip
    """What so many runs of every law and cell need that are still missing, at these paces."""
    kept = _kept(plan)
    logs = [sum(counts) for counts in zip(*kept.values(), strict=True)]
    sizes = {law: size_of_run(plan.single(law, 0)).disk for law in plan.laws}
    report, each = REPORT + FIGURES * figures, LOG + LOG_FIGURES * figures
    page, beside = REPORT_BYTES + FIGURES_BYTES * figures, LOG_BYTES + LOG_FIGURES_BYTES * figures
    others = [
        page + sum(counts[end] * (sizes[law] + beside) for law, counts in kept.items())
        for end in (0, 1)
    ]
    shape = (len(plan.laws), len(plan.cells), plan.sweep.draws)
    return Estimate(
        runs=sum(missing.values()), workers=workers,
        march=sum(count * paces[place] for place, count in missing.items() if place in paces),
        after=(report + each * logs[0], report + each * logs[1]),
        table=runs_writer.bytes_of(shape, len(plan.metrics), len(plan.sweep.vary)),
        kept=(logs[0], logs[1]), others=(others[0], others[1]),
        untimed=tuple(sorted({law for law, cell in missing if (law, cell) not in paces})),
    )  # fmt: skip


def check_fits(plan: Plan, folder: Path, parts: int = 1) -> None:
    """Raise StorageError where the runs of one of so many parts surely do not fit.

    They need their table on the disk, and a few numbers a run in memory.
    """
    shape = (len(plan.laws), len(plan.cells), plan.sweep.draws)
    runs, told = math.prod(shape), f"{math.prod(shape):,} runs (sweep.draws: {shape[2]:,})"
    fewer = (
        f"{told} were asked for; ask for fewer draws, or name a folder on a larger disk with --out"
    )
    table = runs_writer.bytes_of(shape, len(plan.metrics), len(plan.sweep.vary))
    check_free_space(folder, table / parts, fewer)
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if (held := HELD_BYTES * runs) > memory:
        raise StorageError(
            f"cannot make {folder}: its tables take {bytes_in_words(held)} of memory or more, and "
            f"this machine has {bytes_in_words(memory)}; {told} were asked for; ask for fewer draws"
        )


def _kept(plan: Plan) -> dict[str, tuple[int, int]]:
    """The least and the most logs that are kept of every law: without failed runs, and with."""
    keep, runs = plan.sweep.keep, len(plan.cells) * plan.sweep.draws
    least = sum(keep.worst.values()) + len(keep.draws) * len(plan.cells)
    return dict.fromkeys(plan.laws, (min(least, runs), min(least + keep.failed, runs)))
