"""Runs of a study of which a full run folder is kept: which they are, and whether they are equal.

A kept run is made again from its draw, alone, and so has the numbers of runs.h5 to the last bit.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from podusv_cli.core.errors import StorageError
from podusv_cli.core.kernel import Vector
from podusv_cli.process.extras import Extras, Failure
from podusv_cli.storage.run_folder import LOGS, RunFolder, open_run
from podusv_cli.studies.counting.runs_file import RunsTable
from podusv_cli.studies.telling.results import Results

POINTS = 2000  # of a kept run's curve in a figure
DistanceCurve = tuple[Vector, Vector]  # time [s] and distance to the target [m], both (n,)


class KeptRun(NamedTuple):
    """A run that is to be kept, and why."""

    law: str
    cell: int
    draw: int
    why: str

    @property
    def name(self) -> str:
        """Of its folder, and of its scenario's file."""
        return f"{self.law}-{self.cell}-{self.draw}"


@dataclass(frozen=True)
class Kept:
    """A run that is wanted, its folder where it could be made, and how it differs from the table.

    `difference` is "" where all metrics are equal to the last bit.
    """

    wanted: KeptRun
    run: RunFolder | None
    difference: str = ""


def wanted_runs(results: Results) -> list[KeptRun]:
    """The runs that `sweep.keep` asks for, each once, by law.

    Failed runs are the first that diverged or were no success; a run that crashed, hung or was
    invalid has no log. The worst have the largest value of a metric among those that succeeded.
    """
    keep = results.about.keep
    chosen: dict[tuple[str, int, int], KeptRun] = {}
    for law in results.runs.laws:
        for run in (
            *_failed_runs(results.runs, law, keep.failed),
            *(w for name, count in keep.worst.items() for w in _worst(results, law, name, count)),
            *_name_runs(results.runs, law, keep.draws),
        ):
            # Law, cell and draw name a run; of several reasons to keep it, the first counts.
            chosen.setdefault(run[:3], run)
    return list(chosen.values())


def missing_runs(folder: Path, results: Results) -> list[KeptRun]:
    """The runs that are to be kept and are not there yet."""
    return [run for run in wanted_runs(results) if not (folder / LOGS / run.name).exists()]


def _failed_runs(runs: RunsTable, law: str, count: int) -> Iterator[KeptRun]:
    # Transposed, so that the first draws of all cells come, not all draws of the first cell.
    for draw, cell in np.argwhere(runs.failed(law).T)[:count].tolist():
        yield KeptRun(law, cell, draw, "failed")


def _worst(results: Results, law: str, name: str, count: int) -> Iterator[KeptRun]:
    """The `count` successful runs of a law with the largest `name`, over all cells."""
    runs = results.runs
    values = np.where(runs.success(law), runs.metric(law, name), np.nan)
    # NaN sorts last and is not taken.
    order = np.argsort(-values, axis=None, kind="stable")[: min(count, np.isfinite(values).sum())]
    for rank, place in enumerate(order.tolist(), 1):
        cell, draw = divmod(place, runs.wanted)
        yield KeptRun(law, cell, draw, f"{name}: number {rank} of the largest")


def _name_runs(runs: RunsTable, law: str, draws: Iterable[int]) -> Iterator[KeptRun]:
    """The runs of a law in these draws, in each cell, as far as they are made."""
    done = runs.done(law)
    for draw in draws:
        for cell in range(len(runs.cells)):
            if draw < runs.wanted and done[cell, draw]:
                yield KeptRun(law, cell, draw, "named in sweep.keep.draws")


def find_kept(folder: Path, results: Results, extras: Extras) -> list[Kept]:
    """The kept runs, each opened and compared with the table.

    One that cannot be opened or differs is noted in `extras`.
    """
    kept = [
        _open_kept(folder / LOGS / run.name, run, results, extras) for run in wanted_runs(results)
    ]
    extras.missing += [
        Failure(f"{LOGS}/{run.wanted.name}", run.difference, problem="differs from runs.h5")
        for run in kept
        if run.difference
    ]
    return kept


def _open_kept(path: Path, kept_run: KeptRun, results: Results, extras: Extras) -> Kept:
    """A kept run opened and compared with the table; None in it where it cannot be opened."""
    if not path.exists():
        return Kept(kept_run, None)
    try:
        run = open_run(path)
    except StorageError as error:
        extras.missing.append(
            Failure(f"{LOGS}/{kept_run.name}", str(error), problem="could not be read")
        )
        return Kept(kept_run, None)
    return Kept(kept_run, run, difference(run, kept_run, results.runs))


def difference(run: RunFolder, one: KeptRun, runs: RunsTable) -> str:
    """The first metric in which the log of `run` differs from the table, with both values.

    `one` says which run of the table `runs` it is. The text is empty if no metric differs.
    """
    for name in runs.metrics:
        ours, theirs = run.metrics.get(name), float(runs.metric(one.law, name)[one.cell, one.draw])
        # A run's files have None for what is not finite.
        if ours != (theirs if math.isfinite(theirs) else None):
            return f"{name} is {ours!r} in the log and {theirs!r} in the table"
    return ""


def contradiction(kept: Sequence[Kept]) -> str:
    """Why the table is in doubt: how many kept logs differ from it; "" where none does."""
    differing = [run for run in kept if run.difference]
    if not differing:
        return ""
    first = differing[0]
    return (
        f"no claim is judged, since the table of runs is in doubt: {len(differing)} of {len(kept)} "
        f"kept logs differ from it; in that of {first.wanted.name}, {first.difference}"
    )


def distance_curves(kept: Sequence[Kept], extras: Extras) -> dict[str, list[DistanceCurve]]:
    """The distance to the target over time in every kept log that has it, by law.

    Times [s] and distances [m] of a run are (n,), with POINTS rows at most. A curve that cannot be
    read is noted in `extras` and left out.
    """
    by_law: dict[str, list[DistanceCurve]] = {}
    for run in kept:
        name = f"the track of {run.wanted.name}"
        if curve := extras.make_or_record(name, partial(_distance_curve, run)):
            by_law.setdefault(run.wanted.law, []).append(curve)
    return by_law


def _distance_curve(kept: Kept) -> DistanceCurve | None:
    """Times [s] and distances z_e [m] of a kept run, `POINTS` at most; None without them."""
    if kept.run is None or "z_e" not in kept.run.recording:
        return None
    log = kept.run.recording
    rows = np.unique(np.linspace(0, len(log["time"]) - 1, POINTS).astype(int))
    return log["time"][rows], log["z_e"][rows]
