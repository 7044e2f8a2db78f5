"""Studies, searches for gains and benches from Python: tables of pandas, datasets of xarray."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from podusv_cli.core.errors import UsageError
from podusv_cli.interface.results import NO_XARRAY
from podusv_cli.interface.scenarios import Changes, Source, assignments, load_scenario
from podusv_cli.scenario.plugins import continue_with
from podusv_cli.studies.counting.runs import STATUSES
from podusv_cli.studies.making.store import RUNS
from podusv_cli.studies.telling.outputs import as_frame
from podusv_cli.studies.telling.results import Results, judge_study
from podusv_cli.workflows import studies as folders
from podusv_cli.workflows import sweep as sweeping
from podusv_cli.workflows.many_runs import Config
from podusv_cli.workflows.request import Request

if TYPE_CHECKING:
    import xarray

    from podusv_cli.studies.bench.cases import Selection

Place = str | os.PathLike[str]
REPORT = "report.html"


class Folder:
    """What has a folder, perhaps with a report in it."""

    folder: Path

    @property
    def report(self) -> Path | None:
        """The HTML page, None where it was not made."""
        page = self.folder / REPORT
        return page if page.exists() else None


@dataclass(frozen=True, eq=False, repr=False)
class Study(Folder):
    """Many draws of a scenario: every run, and what all of them say.

    `table` has a row a run; `data` the same over (law, draw). `summary`, `pairs`, `sensitivity`
    and `claims` are what `podusv sweep report` writes.
    """

    folder: Path
    results: Results

    @cached_property
    def table(self) -> pd.DataFrame:
        """A row a run: law, cell, draw, what was drawn, status, success, metrics."""
        return as_frame(self.results.runs)

    @cached_property
    def data(self) -> xarray.Dataset:
        """The metrics over `law` and `draw`, and over `cell` where the study has a grid.

        What was drawn has no `law`: all laws meet the same draws. `status` is "not made" and a
        metric NaN where a run is missing. Raises ImportError where xarray is not installed.
        """
        try:
            import xarray
        except ImportError as error:
            raise ImportError(NO_XARRAY) from error
        runs, known = self.results.runs, self.results.known_metrics
        by_law = ("law", "cell", "draw")

        def whole(read: Callable[[str], Any]) -> Any:
            return np.array([read(law) for law in runs.laws])

        units = {name: {"units": m.unit, "long_name": m.meaning} for name, m in known.items()}
        metrics = {
            name: (by_law, whole(partial(_metric, runs, name)), units.get(name, {}))
            for name in runs.metrics
        }
        words = np.array(STATUSES, dtype=object)
        ends = {
            "status": (by_law, words[whole(runs.status)]),
            "success": (by_law, whole(runs.success)),
        }
        drawn = {name: ("draw", values) for name, values in runs.drawn_quantities.items()}
        axes = {"law": list(runs.laws), "cell": list(runs.cells), "draw": np.arange(runs.wanted)}
        dataset = xarray.Dataset({**metrics, **ends, **drawn}, coords=axes)
        return dataset if len(runs.cells) > 1 else dataset.squeeze("cell", drop=True)

    @property
    def summary(self) -> pd.DataFrame:
        """A row for each law, cell and metric: failures, quantiles, intervals."""
        return self.results.summary

    @property
    def pairs(self) -> pd.DataFrame:
        """A row for each pair of laws, cell and metric: how often the first is better."""
        return self.results.pairs

    @property
    def sensitivity(self) -> pd.DataFrame:
        """How much each metric depends on each quantity that was drawn."""
        return self.results.sensitivity

    @property
    def claims(self) -> pd.DataFrame:
        """A row for each claim of the study."""
        return pd.DataFrame([verdict.as_json() for verdict in self.results.verdicts])

    def __repr__(self) -> str:
        """One line: the laws, how many runs there are, where they are."""
        runs = f"{self.results.made_runs} of {self.results.wanted_runs} runs"
        return f"<podusv study of {', '.join(self.results.runs.laws)}: {runs}, {self.folder}>"

    def _repr_html_(self) -> str:
        """The table of the answer."""
        head, rows = self.results.cells()
        return escape(repr(self)) + pd.DataFrame(rows, columns=head).to_html(border=0, index=False)


def _metric(runs: Any, name: str, law: str) -> Any:
    return runs.metric(law, name)


def sweep(
    source: Source,
    changes: Changes | None = None,
    *,
    out: Place | None = None,
    workers: int = 0,
    figures: bool = True,
    trust: bool = False,
) -> Study:
    """Simulate all draws of a scenario with the key `sweep`, as `podusv sweep run` does it.

    `source` may be the folder of a study, which is continued; `trust` executes the plug-in files in
    it. `out` is the study's folder, by default `results/<name>-sweep`. Every run that is finished
    is kept when Ctrl-C ends it. Raises ScenarioError, UsageError, StorageError.

    >>> import podusv
    >>> draws = {"draws": 4, "seed": 1, "vary": {"vessel.m": {"uniform": [50.0, 70.0]}}}
    >>> short = {"simulation.duration": 20.0, "sweep": draws}
    >>> study = podusv.sweep("podusv:own_vessel.yaml", short, out="hulls", figures=False)
    >>> study
    <podusv study of pid: 4 of 4 runs, hulls>
    >>> study.table[["law", "draw", "status"]].head(2)
       law  draw    status
    0  pid     0  finished
    1  pid     1  finished
    >>> dict(study.data["iae"].sizes)
    {'law': 1, 'draw': 4}
    """
    config, overrides = _config(source, changes)
    request = Request(overrides, _path(out), workers=workers, figures=figures, trust=trust)
    done = sweeping.run(config, request, lambda tally: None)
    if done.results is None:
        raise UsageError(f"{done.folder} is not whole: {continue_with('sweep run', done.folder)}")
    return Study(done.folder, done.results)


def open_study(folder: Place) -> Study:
    """A study, read from its folder; nothing is simulated, and no plug-in file is executed.

    Of an unfinished study, the runs that `podusv sweep report` has put together. Raises UsageError
    where this is no study or has no runs yet, StorageError where it is damaged.

    >>> import podusv
    >>> draws = {"draws": 2, "seed": 1, "vary": {"vessel.m": {"uniform": [50.0, 70.0]}}}
    >>> short = {"simulation.duration": 2.0, "sweep": draws}
    >>> _ = podusv.sweep("podusv:own_vessel.yaml", short, out="kept", figures=False)
    >>> podusv.open_study("kept").summary.set_index("metric").loc["iae", "n"].item()
    2
    """
    place = Path(folder)
    store = folders.open_store(place)
    if not (place / RUNS).exists():
        report = continue_with("sweep report", place)
        raise UsageError(f"{place} has no {RUNS} yet; it is made by: {report}")
    return Study(place, judge_study(store.about, store.runs()))


@dataclass(frozen=True, eq=False, repr=False)
class Tuning(Folder):
    """A finished search for gains.

    `laws` has a row a law: ranks and objectives before and after on fresh draws. `gains` has a
    column a law, NaN where it has no such gain. `remarks` are sentences about them. `tuned.yaml` in
    `folder` has the gains as a scenario.
    """

    folder: Path
    laws: pd.DataFrame
    gains: pd.DataFrame
    remarks: tuple[str, ...]

    def __repr__(self) -> str:
        """One line: the laws, and where the search is."""
        return f"<podusv search for gains of {', '.join(self.gains.columns)}: {self.folder}>"


def tune(
    source: Source,
    changes: Changes | None = None,
    *,
    out: Place | None = None,
    workers: int = 0,
    figures: bool = True,
    trust: bool = False,
) -> Tuning:
    """Search gains for every law with equal budgets, as `podusv tune` does it.

    `source` has the keys `sweep` and `tune`, or is the folder of a search, which is continued.
    Needs Optuna (podusv[tune]). Raises ScenarioError, UsageError, StorageError.

    >>> import podusv
    >>> small = {"tune.budget": 8, "tune.repeats": 1, "tune.validate": 4}
    >>> found = podusv.tune("podusv:studies/tune_small.yaml", small, out="gains", figures=False)
    ... # doctest: +SKIP
    """
    from podusv_cli.workflows import tune as searching

    config, overrides = _config(source, changes)
    request = Request(overrides, _path(out), workers=workers, figures=figures, trust=trust)
    done = searching.tune(config, request, lambda tally, text: None)
    answer = done.as_json()
    return Tuning(
        done.folder,
        done.results.laws,
        pd.DataFrame(answer["gains"]).rename_axis("gain"),
        tuple(answer["remarks"]),
    )


@dataclass(frozen=True, eq=False, repr=False)
class Bench(Folder):
    """Laws over standard tasks: `runs` has a row a run, `board` those of each hull, best first."""

    folder: Path
    runs: pd.DataFrame
    board: pd.DataFrame
    missing: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """One line: how many runs there are, and where."""
        laws = self.runs.law.nunique()
        return f"<podusv bench of {laws} laws: {len(self.runs)} runs, {self.folder}>"

    def _repr_html_(self) -> str:
        """The leaderboard."""
        return escape(repr(self)) + self.board.to_html(border=0, float_format="{:.3g}".format)


def bench(
    folder: Place | None = None,
    changes: Changes | None = None,
    *,
    laws: Sequence[Place] = (),
    tasks: Sequence[str] = (),
    vessels: Sequence[str] = (),
    conditions: Sequence[str] = (),
    out: Place = "results/bench",
    force: bool = False,
    workers: int = 0,
    figures: bool = True,
    optimum: bool = False,
) -> Bench:
    """Run every law over every task, vessel and condition, as `podusv bench` does it.

    `folder` is podusv's bench by default; `laws` are scenarios with further `controllers`; `tasks`,
    `vessels` and `conditions` choose some. Raises UsageError, ScenarioError, LawError,
    StorageError.

    >>> import podusv
    >>> chosen = {"tasks": ["line"], "vessels": ["paper_nonlinear"], "conditions": ["calm"]}
    >>> board = podusv.bench(**chosen, figures=False).board  # doctest: +SKIP
    """
    from podusv_cli.studies.bench.cases import Selection, shipped_bench
    from podusv_cli.workflows import bench as benching

    axes = {"tasks": tasks, "vessels": vessels, "conditions": conditions}
    place = Path(folder) if folder else shipped_bench()
    wanted: Selection = Selection(place, [Path(law) for law in laws], assignments(changes), axes)
    request = Request(out=Path(out), force=force, figures=figures, workers=workers)
    done = benching.bench(wanted, request, optimum=optimum)
    return Bench(done.folder, done.runs, done.board, tuple(map(str, done.missing)))


def _config(source: Source, changes: Changes | None) -> tuple[Config, Sequence[str]]:
    """What a workflow loads, and the changes that it still has to make.

    A scenario in memory is loaded with its changes, when the workflow asks for it.
    """
    if isinstance(source, (str, os.PathLike)):
        return Path(source), assignments(changes)
    return partial(load_scenario, source, changes), ()


def _path(out: Place | None) -> Path | None:
    return Path(out) if out is not None else None
