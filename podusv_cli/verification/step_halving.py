"""A scenario run at a finer step, with all times in seconds unchanged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Status
from podusv_cli.engine.running.simulate import to_end
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.scenario.model import Scenario

Progress = Callable[[float], None]


@dataclass(frozen=True)
class Level:
    """A run at one step: its metrics (empty unless it finished) and the hull's end position."""

    step: float
    status: Status
    message: str
    metrics: dict[str, float]
    position: Vector  # (x, y) [m]


def refine_grid(scenario: Scenario, halvings: int) -> TimeGrid:
    """The scenario's grid with the step halved `halvings` times; only start and end are logged.

    The grid counts control periods in steps, so this count doubles with each halving.
    """
    grid, finer = scenario.time_grid(), 2**halvings
    steps = grid.steps * finer
    return replace(
        grid,
        step=grid.step / finer,
        steps=steps,
        # At least 1, as the march counts instants modulo this
        log_every=max(steps, 1),
        hold_every=grid.hold_every * finer,
    )


def run_level(scenario: Scenario, halvings: int, progress: Progress | None = None) -> Level:
    """Run a scenario of one law with its step halved `halvings` times.

    A run that did not finish has no metrics and NaN for its end; no error is raised.
    """
    plan = scenario.plan(refine_grid(scenario, halvings))
    out = to_end(plan, compiled=scenario.simulation.compiled, progress=progress)
    seen = out.seen if out.status == "finished" else None
    metrics = {} if seen is None else plan.probe.summary(seen)
    position = np.full(2, np.nan) if seen is None else np.array([out["x"][-1], out["y"][-1]])
    return Level(plan.grid.step, out.status, out.message, metrics, position)
