"""`podusv optimum`: the motion that minimises a scenario's error, repeated as a run of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from podusv_cli.components.controllers.schedule import Schedule
from podusv_cli.components.controllers.velocity_vector import VelocityVector
from podusv_cli.core.errors import UsageError
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import SWAY_DEMAND
from podusv_cli.engine.running.simulate import to_end
from podusv_cli.findings.finding import preflight, unknown_codes
from podusv_cli.optimum import collocation
from podusv_cli.optimum.collocation import Stage
from podusv_cli.optimum.feedback import schedule
from podusv_cli.optimum.problem import Minimised, Motion, OptimumProblem, problem
from podusv_cli.scenario.limits import estimate, limits
from podusv_cli.scenario.load import Loaded
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.resolved import resolved_yaml
from podusv_cli.scenario.sections import Control
from podusv_cli.storage.run_folder import RunWriter, free_folder, open_run
from podusv_cli.workflows.execute import Finished, RunTask, check_figures, execute
from podusv_cli.workflows.request import Request
from podusv_cli.workflows.run import RESULTS, open_scenario, single

BESIDE = VelocityVector()  # a law from which the search begins, too: it turns the bow into the load
Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Optimum:
    """Optima from several beginnings and on finer grids, and the run that repeats the last one.

    `departures` are the largest differences between run and optimum: of the position [m], and what
    the feedback added in surge [N], yaw [N m] and, where there is a sway force, sway [N].
    """

    minimised: Minimised
    stages: Sequence[Stage]
    run: Finished
    departures: dict[str, float]

    @property
    def folder(self) -> Path:
        """Where the run lies."""
        return self.run.folder

    @property
    def tolerance(self) -> float:
        """Up to which the solver found each optimum."""
        return collocation.TOLERANCE

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints of it."""
        stages = [
            {
                "start": s.start,
                "step": s.step,
                "integral": s.integral,
                "iterations": s.iterations,
                "s": s.seconds,
            }
            for s in self.stages
        ]
        return {
            **self.run.as_json(),
            "minimised": self.minimised,
            "grids": stages,
            "tolerance": self.tolerance,
            "departures": self.departures,
        }


def optimum(
    config: Path,
    request: Request,
    minimised: Minimised,
    step: float,
    progress: Progress | None = None,
) -> Optimum:
    """Find the optimum of a scenario from runs of its laws, and write a run that repeats it.

    `minimised` is what is least, `step` [s] that of the finest grid. Raises UsageError without
    CasADi and for a scenario that it cannot take, ScenarioError, LawError, NotConvergedError,
    StorageError.
    """
    # A missing library is told before the scenario is loaded.
    collocation.casadi()
    checks = (unknown_codes, limits(request.allow_large))
    loaded = open_scenario(config, request, checks)
    return optimum_of(loaded, request, minimised, step, progress)


def optimum_of(
    loaded: Loaded,
    request: Request,
    minimised: Minimised,
    step: float,
    progress: Progress | None = None,
) -> Optimum:
    """Find and write the optimum as `optimum` does, for a scenario that is loaded already.

    `step` [s] is that of the finest grid.
    """
    collocation.casadi()
    scenario = single(loaded, request.controller) if request.controller else loaded.scenario
    wanted = problem(scenario, minimised)
    # Names of figures and the place are checked before minutes of computing.
    check_figures(scenario)
    target = request.out or free_folder(RESULTS / scenario.name / "optimum")
    size = estimate(scenario, loaded.plan(scenario))
    with RunWriter(target, force=request.force, needed=size.bytes_needed):
        pass  # fails before anything is computed where the place cannot be written to
    guesses = _guesses(scenario)
    stages, motion = collocation.search_optima(wanted, guesses, step, progress)
    repeated = _repeating(scenario, wanted, motion)
    task = RunTask(
        repeated,
        resolved_yaml(repeated),
        target,
        request.force,
        request.out is not None,
        request.figures,
        argv=request.argv,
        label="optimum",
        noticed=preflight(repeated),
    )
    done = execute(task, progress and (lambda fraction: progress("repeating", fraction)))
    return Optimum(minimised, stages, done, _departures(done.folder, motion))


def _guesses(scenario: Scenario) -> dict[str, Motion]:
    """Runs from which the search may begin: of the scenario's laws, and of velocity_vector.

    They are listed by label. A law that diverges is left out. Raises LawError, and UsageError where
    all diverge.
    """
    singles = scenario.singles()
    if not any(single.controller.label == BESIDE.label for single in singles.values()):
        singles[BESIDE.label] = scenario.alone().model_copy(update={"controller": BESIDE})
    runs = {label: _run(single) for label, single in singles.items()}
    ended = {label: run for label, run in runs.items() if run.status == "finished"}
    if not ended:
        label, run = next(iter(runs.items()))
        raise UsageError(
            f"{scenario.name}: the search begins from runs of laws, and all of these diverge "
            f"({label}: {run.message}); choose another law, as with --set controller.kind=pid"
        )
    return {label: Motion.of(run) for label, run in ended.items()}


def _run(scenario: Scenario) -> Recording:
    scenario.ready()
    return to_end(scenario.plan(), compiled=scenario.simulation.compiled)


def _repeating(scenario: Scenario, wanted: OptimumProblem, motion: Motion) -> Scenario:
    """The scenario with the optimum's demands in place of its law, which acts continuously."""
    law = Schedule(rows=schedule(wanted, motion), minimises=wanted.minimised)
    description = f"A motion of least {wanted.minimised}, found by podusv optimum."
    changes = {"controller": law, "control": Control(), "description": description}
    return scenario.alone().model_copy(update=changes)


def _departures(folder: Path, motion: Motion) -> dict[str, float]:
    """The largest differences between the run in `folder` and the motion that it repeats, by name.

    Position [m], and what feedback added in surge [N], yaw [N m] and sway [N]; {} without a log.
    """
    log = open_run(folder).recording
    if not len(log["time"]):
        return {}
    away = [np.interp(motion.times, log["time"], log[name]) for name in ("x", "y")]
    position = np.hypot(away[0] - motion.states[:, 0], away[1] - motion.states[:, 1])
    added = {name: float(abs(log[name]).max()) for name in ("feedback_u", "feedback_r")}
    # A column only where the actuator takes a sway force.
    for sway in motion.demands[:, 2:].T:
        asked = np.interp(motion.times, log["time"], log[SWAY_DEMAND.name])
        added["feedback_v"] = float(abs(asked - sway).max())
    return {"position": float(position.max()), **added}
