"""An independent solution of a scenario with scipy's DOP853, adaptive and of order eight.

The integrator restarts wherever the path is not smooth. Scenarios whose right-hand side is not
smooth otherwise are skipped, with the reason.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from podusv_cli.components.paths.base import TARGET
from podusv_cli.core.kernel import Vector, bundle, call
from podusv_cli.engine.running.continuous import Slope, continuous
from podusv_cli.scenario.model import Scenario
from podusv_cli.verification.step_halving import Level, Progress

TOLERANCE = 1e-10  # relative and absolute, of every state
UPDATES = 100  # of the progress display; updating it at every step would be slow
MOST_EVALUATIONS = 500_000


@dataclass(frozen=True)
class Dop853Result:
    """End position [m] and IAE [m s] by DOP853; NaN where it was `skipped`, with the reason."""

    position: Vector = field(default_factory=lambda: np.full(2, np.nan))
    iae: float = math.nan
    evaluations: int = 0
    skipped: str = ""


def why_skipped(scenario: Scenario, levels: list[Level]) -> str:
    """Why an adaptive integrator does not fit the scenario; "" where it does."""
    return next((text for applies, text in REASONS if applies(scenario, levels)), "")


REASONS: tuple[tuple[Callable[[Scenario, list[Level]], bool], str], ...] = (
    (lambda scenario, _: scenario.control.period > 0, "the law's output is held (control.period)"),
    (
        lambda scenario, _: scenario.controller.takes_samples(),
        "the law takes samples (a difference quotient, or a held direction)",
    ),
    (
        lambda scenario, _: scenario.path.follows,
        "the active leg of the path changes at instants",
    ),
    (
        lambda scenario, _: not scenario.measurement.is_exact,
        "the law works with measurements, which come at instants",
    ),
    (
        lambda scenario, _: scenario.actuator.is_relayed,
        "the actuator has a command path (actuator.command) or fails (actuator.failure)",
    ),
    (
        lambda _, levels: any(level.status != "finished" for level in levels),
        "the run does not reach its end",
    ),
    (
        lambda _, levels: any(level.metrics.get("saturated_fraction", 0.0) > 0 for level in levels),
        "the actuator limits the law, which puts kinks into the right-hand side",
    ),
)


def integrate(scenario: Scenario, progress: Progress | None = None) -> Dop853Result:
    """Integrate a scenario for which `why_skipped` has no reason; the IAE is one more state."""
    from scipy.integrate import DOP853  # slow to import

    duration = scenario.time_grid().steps * scenario.simulation.step
    compiled = scenario.simulation.compiled
    slope, start = continuous(scenario.closed_loop(), duration, compiled=compiled)
    f, s, evaluations, shown = _with_iae(scenario, slope), np.append(start, 0.0), 0, 0.0
    for begin, end in _pieces(scenario, duration):
        solver = DOP853(f, begin, s, end, rtol=TOLERANCE, atol=TOLERANCE)
        while solver.status == "running":
            trouble = _step(solver)
            if trouble or evaluations + solver.nfev > MOST_EVALUATIONS:
                why = trouble or f"gave up after {MOST_EVALUATIONS} evaluations"
                return Dop853Result(skipped=f"{why} at t = {solver.t:.6g} s")
            if progress and solver.t > shown:
                progress(solver.t / duration)
                shown = solver.t + duration / UPDATES
        s, evaluations = solver.y, evaluations + solver.nfev
    return Dop853Result(s[:2], float(s[-1]), evaluations)


def _step(solver: object) -> str:
    """Make one step; return an error message, "" without an error."""
    try:
        message: str | None = solver.step()  # type: ignore[attr-defined]
    except ArithmeticError as error:
        return str(error)
    return message or ""


def _pieces(scenario: Scenario, duration: float) -> Iterator[tuple[float, float]]:
    """Intervals between the path's breaks; each but the first starts just after its break."""
    fillet = scenario.path.fillet_for_law()
    breaks = {at.time for at in scenario.path.breaks()} | set(fillet.edges() if fillet else ())
    inner = sorted(time for time in breaks if 0.0 < time < duration)
    for begin, end in pairwise([0.0, *inner, duration]):
        yield (float(np.nextafter(begin, math.inf)) if begin else 0.0), end


def _with_iae(scenario: Scenario, slope: Slope) -> Slope:
    path, target = scenario.path, np.zeros(len(TARGET))
    k, table = bundle(path.constants()), path.table()

    def f(t: float, s: Vector) -> Vector:
        call(path.evaluate, t=t, k=k, table=table, target=target)
        return np.append(slope(t, s[:-1]), math.hypot(target[0] - s[0], target[1] - s[1]))

    return f
