"""A scenario's numbers at three steps and by another integrator, and what to make of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from podusv_cli.metrics.table import METRICS
from podusv_cli.scenario.model import Scenario
from podusv_cli.verification.dop853 import Independent, integrate, left_out
from podusv_cli.verification.ranking import Ranking, ranking
from podusv_cli.verification.richardson import Estimate, estimate, estimate_position
from podusv_cli.verification.step_halving import Level, run_level

LEVELS = 3
POSITION = "end_position"  # a number of its own beside the metrics
Told = Callable[[str, float], None]


@dataclass(frozen=True)
class Checked:
    """One run's verification. `length` is the hull's, the scale of positions."""

    levels: list[Level]
    estimates: dict[str, Estimate]
    independent: Independent | None
    left_out: str
    length: float

    def distances(self) -> dict[str, float]:
        """How far the run at the scenario's step is from DOP853, relative to length and IAE."""
        if self.independent is None or self.independent.left_out:
            return {}
        first, other = self.levels[0], self.independent
        return {
            POSITION: math.dist(first.position, other.position) / self.length,
            "iae": abs(first.metrics["iae"] - other.iae) / other.iae if other.iae else 0.0,
        }

    def doubtful(self, tolerance: float) -> list[str]:
        """Names of numbers that are not converged; `status` alone where a run did not finish."""
        if any(level.status != "finished" for level in self.levels):
            return ["status"]
        names = [n for n, e in self.estimates.items() if not e.converged(tolerance)]
        apart = [f"{n} (DOP853)" for n, gap in self.distances().items() if not gap <= tolerance]
        return names + apart

    def as_json(self, tolerance: float) -> dict[str, Any]:
        """Plain data; NaN or infinity where there is no number."""
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
        gaps = self.distances()
        reason = self.left_out or (self.independent.left_out if self.independent else "")
        return {
            "status": [level.status for level in self.levels],
            "numbers": numbers,
            "dop853": {"left_out": reason} if reason else {"relative_difference": gaps},
        }


@dataclass(frozen=True)
class Verified:
    """All runs of a scenario verified, and the rankings of a comparison."""

    runs: dict[str, Checked]
    rankings: dict[str, Ranking]
    tolerance: float

    @property
    def doubts(self) -> dict[str, list[str]]:
        """What is not converged: by run, and `ranking` of metrics."""
        found = {label: run.doubtful(self.tolerance) for label, run in self.runs.items()}
        found["ranking"] = [name for name, rank in self.rankings.items() if not rank.converged]
        return {label: names for label, names in found.items() if names}

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints."""
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
            "converged": not self.doubts,
        }


def verify(scenario: Scenario, tolerance: float, progress: Told | None = None) -> Verified:
    """Verify every run of a scenario: its one law, or all of `controllers`."""
    runs = {
        label: check(one, progress and partial(progress, label))
        for label, one in scenario.singles().items()
    }
    rankings = {}
    for name in METRICS:
        of_runs = {label: r.estimates[name] for label, r in runs.items() if name in r.estimates}
        rank = ranking(of_runs)
        if rank:
            rankings[name] = rank
    return Verified(runs, rankings, tolerance)


def check(scenario: Scenario, progress: Callable[[float], None] | None = None) -> Checked:
    """Verify one run."""
    work = [2.0**n for n in range(LEVELS)]  # a halved step costs twice as much
    levels = [
        run_level(scenario, n, _part(progress, sum(work[:n]), work[n], 2 * sum(work)))
        for n in range(LEVELS)
    ]
    length, reason = scenario.vessel.length, left_out(scenario, levels)
    other = None if reason else integrate(scenario, _part(progress, 1.0, 1.0, 2.0))
    estimates = {POSITION: estimate_position([level.position for level in levels], length)}
    names = dict.fromkeys(name for level in levels for name in level.metrics)
    for name in names:
        estimates[name] = estimate([level.metrics.get(name, math.nan) for level in levels])
    return Checked(levels, estimates, other, reason, length)


def _part(
    progress: Callable[[float], None] | None, begin: float, size: float, whole: float
) -> Callable[[float], None] | None:
    """Progress of one part as progress of the whole."""
    return progress and (lambda fraction: progress((begin + fraction * size) / whole))
