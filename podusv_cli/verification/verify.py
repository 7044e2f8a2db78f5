"""Verification of a scenario's numbers: step halving, Richardson's error, rankings."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from podusv_cli.scenario.model import Scenario
from podusv_cli.verification.ranking import Ranking, ranking
from podusv_cli.verification.richardson import FLOOR, StepEstimate, estimate, estimate_position
from podusv_cli.verification.step_halving import Level, Progress, run_level

LEVELS = 3  # steps h, h/2, h/4: the least that tell order and error
POSITION = "end_position"  # verified like a metric
# A distance below this part of the vessel's length is none: laws that are exact on their path leave
# nothing but the integrator's own error, all of which is relative to nothing.
NO_DISTANCE = 1e-9
DISTANCES = {"m": (1, 0), "m s": (1, 1), "m2 s": (2, 1), "m s2": (1, 2)}  # powers of m and s


@dataclass(frozen=True)
class RunVerification:
    """The verification of one run."""

    levels: list[Level]
    estimates: dict[str, StepEstimate]

    def unconverged_numbers(self, tolerance: float) -> list[str]:
        """Names of numbers that are not converged; only `status` where a run did not finish."""
        if any(level.status != "finished" for level in self.levels):
            return ["status"]
        return [n for n, e in self.estimates.items() if not e.converged(tolerance)]

    def as_json(self, tolerance: float) -> dict[str, Any]:
        """The verification as plain data, with NaN and infinity."""
        numbers = {
            name: {
                "values": list(e.values),
                "order": e.order,
                "error": e.error,
                "relative_error": e.relative,
                "converged": e.converged(tolerance),
            }
            for name, e in self.estimates.items()
        }
        return {"status": [level.status for level in self.levels], "numbers": numbers}


@dataclass(frozen=True)
class Verification:
    """The verification of all runs of a scenario, and of their rankings by metric."""

    runs: dict[str, RunVerification]
    rankings: dict[str, Ranking]
    tolerance: float
    units: dict[str, str]  # of the metrics

    @property
    def unconverged_by_run(self) -> dict[str, list[str]]:
        """Names of numbers that are not converged, by run, and of metrics under `ranking`."""
        by_run = {
            label: run.unconverged_numbers(self.tolerance) for label, run in self.runs.items()
        }
        by_run["ranking"] = [name for name, rank in self.rankings.items() if not rank.converged]
        return {label: names for label, names in by_run.items() if names}

    @property
    def sufficient_step(self) -> float | None:
        """The step [s] at which all numbers would be within the tolerance, by their orders.

        None where it is the scenario's own, or where a number has no order or is infinite.
        """
        first = next(iter(self.runs.values()))
        parts = [
            e.sufficient(self.tolerance) for r in self.runs.values() for e in r.estimates.values()
        ]
        # NaN first: where one number has no order, none is known
        least = min(parts, key=lambda part: (not math.isnan(part), part), default=1.0)
        return first.levels[0].step * least if 0.0 < least < 1.0 else None

    def as_json(self) -> dict[str, Any]:
        """The output of `--json`."""
        first = next(iter(self.runs.values()))
        return {
            "format": 1,
            "tolerance": self.tolerance,
            "steps": [level.step for level in first.levels],
            "runs": {label: run.as_json(self.tolerance) for label, run in self.runs.items()},
            "rankings": {
                name: {
                    "orders": [list(order) for order in rank.orders],
                    "too_close": [list(pair) for pair in rank.close],
                    "equal": [list(pair) for pair in rank.equal],
                    "converged": rank.converged,
                }
                for name, rank in self.rankings.items()
            },
            "converged": not self.unconverged_by_run,
        }


def verify(
    scenario: Scenario, tolerance: float, progress: Callable[[str, float], None] | None = None
) -> Verification:
    """Verify every run of a scenario: its one law, or all of `controllers`.

    `tolerance` is that of the relative error; `progress` hears a run's label and the fraction done.
    Raises LawError.
    """
    singles = scenario.singles()
    # Every law is checked before the first of the long runs
    for single in singles.values():
        single.ready()
    runs = {
        label: check(single, progress and partial(progress, label))
        for label, single in singles.items()
    }
    rankings, metrics = {}, scenario.known_metrics()
    for name in metrics:
        of_runs = {label: r.estimates[name] for label, r in runs.items() if name in r.estimates}
        rank = ranking(of_runs)
        if rank:
            rankings[name] = rank
    units = {name: metric.unit for name, metric in metrics.items()}
    return Verification(runs, rankings, tolerance, units)


def check(scenario: Scenario, progress: Progress | None = None) -> RunVerification:
    """Verify the run of a scenario of one law: three runs with ever smaller steps."""
    work = [2.0**n for n in range(LEVELS)]  # a halved step costs twice as much
    levels = [
        run_level(scenario, n, _part(progress, sum(work[:n]), work[n], sum(work)))
        for n in range(LEVELS)
    ]
    # A metric that a level lacks is NaN there: its run did not finish
    positions = [level.position for level in levels]
    estimates = {POSITION: estimate_position(positions, scenario.vessel.length)}
    names = dict.fromkeys(name for level in levels for name in level.metrics)
    known = scenario.known_metrics()
    for name in names:
        floor = floor_of(known[name].unit, scenario.vessel.length, scenario.simulation.duration)
        estimates[name] = estimate([level.metrics.get(name, math.nan) for level in levels], floor)
    return RunVerification(levels, estimates)


def floor_of(unit: str, length: float, duration: float) -> float:
    """The size up to which an error in this unit is none, in that unit.

    `length` [m] is the vessel's, `duration` [s] the run's: integrals grow with it.
    """
    if unit == "rad":
        return NO_DISTANCE  # times the length it is how far the bow is off
    metres, seconds = DISTANCES.get(unit, (0, 0))
    return max((NO_DISTANCE * length) ** metres * duration**seconds, FLOOR) if metres else FLOOR


def _part(progress: Progress | None, begin: float, size: float, whole: float) -> Progress | None:
    """A callback for the progress of one part of the work, which reports that of the whole."""
    return progress and (lambda fraction: progress((begin + fraction * size) / whole))
