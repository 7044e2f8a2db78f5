"""The commands of podusv as Python functions."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy.typing as npt
import pandas as pd
from pydantic import BaseModel

from podusv_cli.core.component import Component
from podusv_cli.core.errors import UsageError
from podusv_cli.core.finding import Finding
from podusv_cli.doubt.check import doubt_faults
from podusv_cli.doubt.outputs import table
from podusv_cli.engine.running import batch
from podusv_cli.engine.running.check import check_law
from podusv_cli.interface.border import ParameterError, interrupt_with
from podusv_cli.interface.hulls import IdentifiedHull
from podusv_cli.interface.parameters import check_words, columns, in_si, scenarios
from podusv_cli.interface.results import Comparison, Run
from podusv_cli.interface.scenarios import CHECKS, Changes, Source, load_scenario
from podusv_cli.scenario.load import Loaded
from podusv_cli.scenario.model import Scenario
from podusv_cli.storage import json_files
from podusv_cli.verification import TOLERANCE
from podusv_cli.verification import verify as verification
from podusv_cli.workflows import compare as comparing
from podusv_cli.workflows import doubt as doubting
from podusv_cli.workflows import identify as identifying
from podusv_cli.workflows import run as running
from podusv_cli.workflows.gather import (
    Members,
    from_folder,
    from_scenario,
    gather_logs,
    join_members,
)
from podusv_cli.workflows.in_memory import run_in_memory
from podusv_cli.workflows.measured import is_log
from podusv_cli.workflows.members import Member
from podusv_cli.workflows.members import from_folder as members_of
from podusv_cli.workflows.request import Request


class _Noticed(BaseModel):
    """What metrics.json has of findings."""

    warnings: list[Finding] = []


def simulate(source: Source, changes: Changes | None = None) -> Run:
    """Simulate a scenario in memory; nothing is written.

    A run that diverges is returned like any other, see `Run.status`. Ctrl-C ends the run and
    returns what was computed. Raises ScenarioError, and LawError for a law that fails.

    >>> import podusv
    >>> run = podusv.simulate("podusv:own_vessel.yaml", {"simulation.duration": 30.0})
    >>> run
    <podusv run pid: finished at 30 s>
    >>> float(run.log["z_e"].sel(time=20.0).round(1)), run.log["z_e"].units
    (1.6, 'm')
    >>> float(run.metrics["iae"].round()), run["z_e"].shape
    (71.0, (3001,))
    """
    given = load_scenario(source, changes)
    case = given.case(_single(given))
    return Run(run_in_memory(case), case.scenario)


def run(
    source: Source,
    changes: Changes | None = None,
    *,
    out: str | os.PathLike[str] | None = None,
    force: bool = False,
    figures: bool = True,
) -> Run:
    """Simulate a scenario into a run folder, as `podusv run` does it.

    `out` is the folder, by default `results/<name>/<time>-<digest>`; a finished one is replaced
    only with `force`. Raises ScenarioError, LawError, StorageError.

    >>> import podusv
    >>> run = podusv.run("podusv:own_vessel.yaml", out="mine", figures=False)
    >>> run.status, sorted(path.name for path in run.folder.iterdir())[:3]
    ('finished', ['about.json', 'log.h5', 'manifest.json'])
    """
    given = load_scenario(source, changes)
    single = _single(given)
    done = running.run_loaded(given, request(out, force, figures))
    made = open_run(done.folder).past
    return Run(replace(made, plugins=single.plugged), single)


def open_run(folder: str | os.PathLike[str]) -> Run:
    """A finished run, read from its folder. Raises StorageError where it is damaged.

    >>> import podusv
    >>> _ = podusv.run("podusv:own_vessel.yaml", out="kept", figures=False)
    >>> podusv.open_run("kept")
    <podusv run pid: finished at 120 s, kept>
    """
    members = members_of(Path(folder))
    if len(members) > 1:
        names = ", ".join(f"{folder}/{member.label}" for member in members)
        raise UsageError(f"{folder} is a comparison; open one of its runs: {names}")
    return _open_member(members[0])


def compare(
    sources: Source | Run | Iterable[Source | Run],
    changes: Changes | None = None,
    *,
    out: str | os.PathLike[str] | None = None,
    force: bool = False,
    figures: bool = True,
    align: Literal["", "start", "place"] = "",
) -> Comparison:
    """Simulate scenarios and compare them with finished runs, as `podusv compare` does it.

    One scenario with `controllers`, several scenarios, run folders, runs that have a folder, or any
    mixture; beside them a log of a boat, such as "sea_trial.csv". With `align="start"` its clock
    and place are moved so that its first position is the first run's at the first instant; with
    "place" its place alone, by the first instant that both have. Raises ScenarioError, UsageError,
    StorageError.

    >>> import podusv
    >>> scenario = podusv.load("podusv:own_vessel.yaml", {"simulation.duration": 30.0})
    >>> gains = {"soft": {"K_Pu": 50.0}, "stiff": {"K_Pu": 200.0}}
    >>> comparison = podusv.compare(scenario, {"controllers": gains}, figures=False)
    >>> comparison.table.loc["iae"].round()
    soft     72.0
    stiff    68.0
    Name: iae, dtype: float64
    """
    given = _several(sources)
    files = [_file(source) for source in given]
    items, options = _items(given, files, changes, align), request(out, force, figures)
    runs = join_members(items)
    done = comparing.compare_gathered(runs, [f for f in files if f], options)
    verdicts = [verdict.as_json() for verdict in done.result.verdicts]
    claims = pd.DataFrame(verdicts).set_index("claim") if verdicts else pd.DataFrame()
    failed = {label: text for label, text in done.result.endings.items() if text}
    scenarios = {member.label: member.case.scenario for member in runs.members if member.case}
    compared = _runs_compared(done, scenarios)
    return Comparison(done.folder, compared, done.result.table.frame(), claims, failed)


def optimum(
    source: Source,
    changes: Changes | None = None,
    *,
    minimise: Literal["iae", "ise"] = "iae",
    step: float = 0.1,
    out: str | os.PathLike[str] | None = None,
    force: bool = False,
    figures: bool = True,
) -> Run:
    """The motion of least error, found with everything known beforehand, repeated as a run.

    `step` [s] is that of the finest of three grids. Needs CasADi (podusv[optimum]). Raises
    ScenarioError, UsageError where CasADi is missing or cannot take the scenario,
    NotConvergedError, StorageError.

    >>> import podusv
    >>> short = {"simulation.duration": 10.0}
    >>> best = podusv.optimum("podusv:own_vessel.yaml", short, step=0.5, out="best", figures=False)
    >>> best.scenario.controller.kind
    'schedule'
    """
    from podusv_cli.workflows import optimum as finding

    done = finding.optimum_of(
        load_scenario(source, changes), request(out, force, figures), minimise, step
    )
    return open_run(done.folder)


def simulate_many(
    source: Source,
    parameters: Mapping[str, Sequence[Any] | npt.NDArray[Any]],
    *,
    workers: int = 0,
    side_by_side: bool | None = None,
) -> pd.DataFrame:
    """Simulate a scenario once for each entry of the parameters; a row a run.

    `parameters` are dotted keys of numbers or words, each with one value a run; `vessel.m` changes
    the vessel, not what the controller is told of it (`nominal.m`). The columns are the parameters,
    `status`, `cause` (why a run did not finish), and the metrics, NaN where a run ended
    before one is defined. A run that diverges, hangs or raises an exception costs no other.
    `workers` runs are simulated at a time (0: one a core). No logs are kept.

    By default runs march eight side by side where the code for that is compiled already, or where
    the batch has 20 million steps or more in all. `side_by_side=True` compiles the code, which
    takes 10 to 20 s once and is kept on disk; `False` has runs march one by one. No bit of the
    result depends on it.

    Ctrl-C, SIGTERM and SIGHUP end all runs at their next instant. Then KeyboardInterrupt is raised;
    its attribute `runs` is the table, in which the others are `interrupted`.

    Raises ScenarioError, LawError, and ValueError for unknown keys, unequal lengths, values out of
    range and a negative number of workers.

    >>> import podusv
    >>> scenario = podusv.load("podusv:own_vessel.yaml", {"simulation.duration": 30.0})
    >>> podusv.simulate_many(scenario, {"vessel.m": [50.0, 60.0]})[["vessel.m", "status"]]
       vessel.m    status
    0      50.0  finished
    1      60.0  finished
    """
    base = load_scenario(source)
    scenario = _single(base)
    given = in_si(scenario, columns(parameters))
    if workers < 0:
        raise ParameterError(f"workers = {workers}: must be 0 (one a core) or more")
    plan = base.plan(scenario)
    probe = scenario.metrics_of(plan)
    loops = [drawn.closed_loop() for drawn in scenarios(scenario, given)]
    check_law(plan)
    check_words(scenario, loops, given)
    done = batch.simulate_many(
        loops, plan.grid, probe=probe, workers=workers, side_by_side=side_by_side
    )
    ends = {"status": done.status, "cause": done.cause}
    runs = pd.DataFrame({**given, **ends, **probe.summaries(done.seen)})
    if done.interrupted:
        raise interrupt_with(runs)
    return runs


def verify(
    source: Source, changes: Changes | None = None, *, tolerance: float = TOLERANCE
) -> pd.DataFrame:
    """Whether the numbers of a scenario have converged, as `podusv verify` finds out.

    A row for each run and number: its `value` at the scenario's step, the `order` of convergence
    (NaN where there is none), the `relative_error`, and whether that is within `tolerance`. Raises
    ScenarioError, LawError.

    >>> import podusv
    >>> found = podusv.verify("podusv:own_vessel.yaml", {"simulation.duration": 20.0})
    >>> bool(found.loc[("pid", "iae"), "converged"])
    True
    """
    done = verification.verify(load_scenario(source, changes).scenario, tolerance)
    rows = {
        (label, name): (e.values[0], e.order, e.relative, e.converged(tolerance))
        for label, run in done.runs.items()
        for name, e in run.estimates.items()
    }
    columns = ["value", "order", "relative_error", "converged"]
    frame = pd.DataFrame.from_dict(rows, orient="index", columns=columns)
    frame.index = pd.MultiIndex.from_tuples(list(rows), names=["run", "number"])
    return frame


def doubt(
    source: Source,
    changes: Changes | None = None,
    *,
    out: str | os.PathLike[str] | None = None,
    force: bool = False,
    figures: bool = True,
    workers: int = 0,
) -> pd.DataFrame:
    """What the verdicts on a scenario's claims hang on, as `podusv doubt` finds it.

    A row a claim: `verdict`, the `word` for what it hangs on, how many draws `kept` or `turned` it,
    the `nearest` key that turns it and at which value, and the distance as a share of the key's
    scale. `out` has all turns, all draws and the page. Raises UsageError without claims,
    ScenarioError, StorageError.

    >>> import podusv
    >>> claim = {"says": "It is near.", "expect": "pid.z_e_steady <= 1"}
    >>> short = {"simulation.duration": 10.0, "doubt.draws": 5, "claims": {"A": claim}}
    >>> podusv.doubt("podusv:own_vessel.yaml", short, out="doubts").loc["A", "verdict"]
    'not reproduced'
    """
    given = load_scenario(source, changes, (*CHECKS, doubt_faults))
    done = doubting.doubt_of(given, replace(request(out, force, figures), workers=workers))
    head, *rows = table(done.answers)
    return pd.DataFrame(rows, columns=list(head)).set_index("claim")


def identify(
    source: Source,
    changes: Changes | None = None,
    *,
    out: str | os.PathLike[str] | None = None,
    force: bool = False,
    figures: bool = True,
) -> IdentifiedHull:
    """The hull of a boat from the logs that a scenario names, as `podusv identify` finds it.

    A hull that predicts a log worse than the vessel that was given says why in its `refusal`, and
    no scenario takes it from the folder; `force` writes it all the same.

    Raises UsageError without logs and for logs that cannot be used, ScenarioError, StorageError.

    >>> import podusv
    >>> hull = podusv.identify("otter.yaml", out="hull")  # doctest: +SKIP
    >>> hull.forces[["force", "at", "value", "low", "high"]]  # doctest: +SKIP
    """
    done = identifying.identify_of(load_scenario(source, changes), request(out, force, figures))
    return IdentifiedHull(done)


def _single(given: Loaded) -> Scenario:
    """The scenario of one run. Raises UsageError where a choice among `controllers` is left."""
    scenario = given.scenario
    if scenario.open_choice:
        first, *_ = known = tuple(scenario.controllers)
        raise UsageError(
            f"{scenario.name} has several controllers ({', '.join(known)}); choose one, as "
            f"scenario.singles()[{first!r}], or use compare"
        )
    return scenario.alone()


def request(out: Any, force: bool, figures: bool) -> Request:
    """The options of a run that is written."""
    return Request(out=Path(out) if out is not None else None, force=force, figures=figures)


def _open_member(member: Member) -> Run:
    """The finished run that a `member` of a folder is, with the warnings that it kept."""
    there = member.folder
    assert there is not None  # the members of a folder are finished
    warned = tuple(map(str, json_files.read_as(there.path / "metrics.json", _Noticed).warnings))
    past = there.as_run(there.recording.controller, member.about, member.plugins)
    return Run(replace(past, warnings=warned))


def _runs_compared(done: comparing.Compared, scenarios: Mapping[str, Scenario]) -> dict[str, Run]:
    """The runs of a comparison that have a log, by label.

    `done` is the comparison; `scenarios` are those of runs made now.
    """
    result = done.result
    return {
        run.label: Run(
            replace(
                run,
                metrics=run.compared_metrics(),
                warnings=tuple(map(str, result.warnings[run.label])),
                folder=done.place(run),
            ),
            scenarios.get(run.label),
        )
        for run in result.runs
    }


def _several(sources: Any) -> list[Any]:
    """One source, or several of them, as a list."""
    single = isinstance(sources, (str, os.PathLike, Mapping, Component, Run))
    return [sources] if single else list(sources)


def _file(source: Any) -> Path | None:
    """The file or folder that a source is, None for a scenario in memory. Raises UsageError."""
    if isinstance(source, Run):
        if source.folder is None:
            raise UsageError(
                f"{source!r} has no folder; make it with podusv.run, or compare its scenario"
            )
        return source.folder
    return Path(source) if isinstance(source, (str, os.PathLike)) else None


def _items(
    given: Sequence[Any], files: Sequence[Path | None], changes: Changes | None, align: str
) -> list[Members]:
    """What is compared: runs, then measured logs; `files` has the path of each of `given`, if any.

    Raises UsageError for changes where only finished runs are given.
    """
    logs = [file for file in files if file and is_log(file)]
    others = [(source, f) for source, f in zip(given, files, strict=True) if f not in logs]
    folders = [file if file and file.is_dir() else None for _, file in others]
    if changes and all(folders):
        raise UsageError(f"{', '.join(changes)}: only finished runs are given, which do not change")
    groups = [
        from_folder(folder)
        if folder
        else from_scenario(load_scenario(source, changes), alone=len(others) == 1)
        for (source, _), folder in zip(others, folders, strict=True)
    ]
    return [*groups, *gather_logs(logs, groups, align)]
