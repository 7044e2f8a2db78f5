"""`podusv bench`: a folder of laws, tasks, vessels and conditions in, a leaderboard out."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from podusv_cli.optimum.collocation import casadi
from podusv_cli.process.extras import Extras, Failure
from podusv_cli.process.interrupts import interrupts_deferred
from podusv_cli.process.workers import Outcome, Report, run_all
from podusv_cli.storage.run_folder import RunWriter
from podusv_cli.studies.bench import optima, standing
from podusv_cli.studies.bench.bench_folder import draw_figures, write_files
from podusv_cli.studies.bench.cases import BenchCase, Selection, cases
from podusv_cli.studies.bench.optima import Least
from podusv_cli.studies.bench.runs import BenchRun, crashed_run, play
from podusv_cli.workflows.request import Request
from podusv_cli.workflows.run import RESULTS

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Benched:
    """A finished bench: its folder, a row for each run, and what could not be made."""

    folder: Path
    runs: pd.DataFrame
    missing: tuple[Failure, ...] = ()

    @property
    def board(self) -> pd.DataFrame:
        """The leaderboard of each hull, a row for each law."""
        return standing.leaderboards(self.runs)

    @property
    def crashed_count(self) -> int:
        """Runs of laws that raised or hung."""
        return int((self.runs.status == "crashed").sum())

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints."""
        board = self.board.astype(object).where(self.board.notna(), None)
        return {
            "format": 1,
            "folder": str(self.folder),
            "runs": len(self.runs),
            "leaderboard": board.reset_index().to_dict("records"),
            "missing": [str(failure) for failure in self.missing],
        }


def bench(
    wanted: Selection, request: Request, progress: Progress | None = None, *, optimum: bool = False
) -> Benched:
    """Simulate every law in every case and write the leaderboard.

    `optimum` finds that of each case. `progress` is called with what is done and its fraction.
    Raises UsageError (without CasADi, too, if optima are wanted), ScenarioError, LawError before
    anything is simulated, StorageError, and KeyboardInterrupt; then nothing is written.
    """
    if optimum:
        # So that a missing library is reported before hours of runs.
        casadi()
    every = list(cases(wanted))
    folder = request.out or RESULTS / "bench"
    with RunWriter(folder, force=request.force, argv=request.argv) as writer:
        extras = writer.extras
        scenarios = [scenario for case in every for scenario in case.laws.values()]
        for position, scenario in enumerate(scenarios, 1):
            # Before the fork, so that no process compiles it again.
            scenario.ready()
            if progress:
                progress("compiling, once", position / len(scenarios))
        runs = list(_simulate_cases(every, request, progress))
        made = standing.table(runs)
        solved = list(_solve_optima(every, runs, request, progress, extras)) if optimum else []
        made = standing.with_optima(made, solved) if solved else made
        with interrupts_deferred():
            figures = draw_figures(runs, made, extras) if request.figures else []
            plugins = dict.fromkeys(
                p for case in every for law in case.laws.values() for p in law.plugged
            )
            write_files(writer, made, figures, writer.add_origin(plugins), solved)
            return Benched(writer.finish(), made, tuple(extras.missing))


def _simulate_cases(
    every: Sequence[BenchCase], request: Request, progress: Progress | None
) -> Iterator[BenchRun]:
    """The runs of all cases, in order; `progress` is called with the fraction of cases done.

    A case whose process ended is tried again law by law, to find the one that ends it.
    """

    def advance(position: int, fraction: float) -> None:
        if progress:
            progress("cases", (position + fraction) / len(every))

    outcomes = _run_all(every, request, advance)
    for case, outcome in zip(every, outcomes, strict=True):
        if outcome.result:
            yield from outcome.result
        else:  # its process ended: which law was it?
            for law, single in case.laws.items():
                (again,) = _run_all([replace(case, laws={law: single})], request)
                yield from again.result or [crashed_run(case, law, again.failure)]


def _solve_optima(
    every: Sequence[BenchCase],
    runs: Sequence[BenchRun],
    request: Request,
    progress: Progress | None,
    extras: Extras,
) -> Iterator[Least]:
    """The optima of all cases; one that fails is noted in `extras`. Raises KeyboardInterrupt."""
    wanted, refused = optima.wanted_optima(every, runs)
    extras.missing += [Failure("an optimum for some cases", why) for why in refused]

    def advance(position: int, fraction: float) -> None:
        if progress:
            progress("optima", (position + fraction) / len(wanted))

    jobs = [partial(optima.least, problem) for problem in wanted]
    outcomes = run_all(jobs, advance, request.workers)
    for problem, outcome in zip(wanted, outcomes, strict=True):
        if outcome.interrupted:
            raise KeyboardInterrupt("interrupted; nothing was written")
        if outcome.result:
            yield outcome.result
        else:
            place = ", ".join(problem.cases[0].place)
            extras.missing.append(Failure(f"the optimum of {place}", outcome.failure))


def _run_all(
    every: Sequence[BenchCase], request: Request, advance: Report = lambda position, fraction: None
) -> list[Outcome]:
    """Play cases in processes of their own; `advance` is called with a case's place and fraction.

    Raises KeyboardInterrupt.
    """
    outcomes = run_all([partial(_play, case) for case in every], advance, request.workers)
    if any(outcome.interrupted for outcome in outcomes):
        raise KeyboardInterrupt("interrupted; nothing was written")
    return outcomes


def _play(case: BenchCase, tell: Callable[[float], None]) -> list[BenchRun]:
    """The runs of one case, one a law; `tell` hears when they are done."""
    runs = play(case)
    tell(1.0)
    return runs
