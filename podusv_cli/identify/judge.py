"""How well a hull predicts a log that it has not seen: free runs from the log's commands."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from podusv_cli.components.estimators.ekf import MOVING
from podusv_cli.core.kernel import Vector
from podusv_cli.core.kinematics import wrap
from podusv_cli.identify.fit.estimate import HullSearch, directions, estimate_hull
from podusv_cli.identify.fit.march import DELIVERED, VALUES
from podusv_cli.identify.fit.problem import FitProblem
from podusv_cli.identify.fit.records import FilterLog
from podusv_cli.identify.logs.reading import Whole

WARM = 20.0  # s, in which the filter finds velocities and load before the first free run
EVERY = 30.0  # s, from one start to the next; more in logs that would have more than MOST starts
MOST = 20
HORIZONS = (5.0, 30.0, np.inf)  # s after a start; infinite: to the end of the log, from the first
NEAR = 0.1  # of a horizon: how far from it a measured value may be
FARTHEST = HORIZONS[-2] * (1.0 + NEAR)  # s after a start: what no score looks beyond
SHOWN = 30.0  # s after a start: the horizon that counts
WORSE = 1.2  # times the prior's error: what is no accident of one log
WHO = ("identified", "prior", "constant velocity")


@dataclass(frozen=True)
class FreeRun:
    """A motion predicted from one instant on, beside what was measured.

    `poses` has an array a way to predict (`WHO`): x, y, psi at each of `times`; `measured` is NaN
    where nothing was delivered.
    """

    times: Vector
    measured: Vector
    poses: Sequence[Vector]

    def errors(self, horizon: float) -> list[tuple[float, float]]:
        """Of each way the error of position [m] and heading [rad] so long after the start.

        With an infinite horizon their root mean squares along the run. NaN where nothing was
        measured then.
        """
        place, heading = (self._rows(columns, horizon) for columns in ([0, 1], [2]))
        offs = [
            (p[place] - self.measured[place], p[heading] - self.measured[heading])
            for p in self.poses
        ]
        return [
            (_rms(np.hypot(*there[:, :2].T)), _rms(_wrap_angles(turned[:, 2])))
            for there, turned in offs
        ]

    def _rows(self, columns: list[int], horizon: float) -> Whole:
        """Rows in which these columns were measured: all, or the one nearest to a horizon."""
        rows = np.flatnonzero(np.all(np.isfinite(self.measured[:, columns]), axis=1))
        if np.isinf(horizon):
            return rows
        late = np.abs(self.times[rows] - self.times[0] - horizon)
        near = np.argsort(late, kind="stable")[:1]
        return np.asarray(rows[near[late[near] <= NEAR * horizon]])


def _rms(errors: Vector) -> float:
    return float(np.sqrt(np.mean(errors**2))) if len(errors) else np.nan


def _wrap_angles(angles: Vector) -> Vector:
    return np.array([wrap(angle) for angle in angles])


@dataclass(frozen=True)
class Score:
    """Root mean square error over the free runs of a log, of one way to predict it."""

    log: str
    role: str
    horizon: float
    who: str
    runs: int
    position: float
    heading: float


def free_runs(problem: FitProblem, log: FilterLog, y: Vector) -> list[FreeRun]:
    """Free runs from several instants of a log: the first to its end, the others to a horizon."""
    last, every = log.times[-1] - HORIZONS[0], max(EVERY, log.duration / MOST)
    starts = np.arange(log.times[0] + min(WARM, 0.5 * log.duration), last, every)
    rows = np.searchsorted(log.times, starts).tolist()
    ends = np.searchsorted(log.times, starts + FARTHEST, "right").tolist()
    ends[:1] = [len(log.times)] * len(ends[:1])
    return [_free_run(problem, log.until(end), y, row) for row, end in zip(rows, ends, strict=True)]


def _free_run(problem: FitProblem, log: FilterLog, y: Vector, first: int) -> FreeRun:
    """From a row to the end of a log: the filter is told nothing from there on."""
    rows = log.record.rows.copy()
    rows[first:, DELIVERED : DELIVERED + MOVING] = 0.0
    cut = log.of(rows)
    points = [y, problem.before(y)]
    seas = [_estimate_sea(problem, cut.until(first), point) for point in points]
    track = problem.follow(cut, points, seas).track[first:]
    measured = np.where(
        log.record.rows[first:, DELIVERED : DELIVERED + 3] != 0.0,
        log.record.rows[first:, VALUES : VALUES + 3],
        np.nan,
    )
    times = log.times[first:]
    drift = (times - times[0])[:, None] * np.array([*seas[0][:2], 0.0])
    still = _turning(times, track[0, :, 0]) + drift
    return FreeRun(times, measured, (track[:, :3, 0], track[:, :3, 1], still))


def _estimate_sea(problem: FitProblem, log: FilterLog, y: Vector) -> list[float]:
    """The sea that a hull meets along a log: a mean load, the current as far as it is determined.

    On a straight track a current along it is the same as a load, and is left to that. An
    interrupt ends it.
    """
    sizes = problem.sea_sd
    if not sizes.any():
        return [0.0] * len(sizes)

    def innovations(points: Sequence[Vector]) -> tuple[Vector, Vector]:
        followed = problem.follow(log, [y] * len(points), [list(sizes * e) for e in points])
        return followed.innovations, followed.variances

    blocks = np.zeros(log.record.delivered, np.int64)
    found = estimate_hull(HullSearch(innovations, len(sizes), blocks), starts=1)
    if found.interrupted:
        raise KeyboardInterrupt
    ways = directions(found.covariance, 2)
    determined = ways.basis[:, : ways.determined_count]
    current = determined @ (determined.T @ found.y[:2])
    return list(sizes * np.append(current, found.y[2:]))


def _turning(times: Vector, state: Vector) -> Vector:
    """Poses where the hull keeps the velocities (u, v, r) through the water that it had."""
    x, y, psi, u, v, r = state[:MOVING]
    since = times - times[0]
    heading = psi + r * since
    # Means of cos and sin of the heading since the start, also for r = 0.
    middle, half = psi + 0.5 * r * since, np.sinc(0.5 * r * since / np.pi)
    c, s = half * np.cos(middle), half * np.sin(middle)
    return np.column_stack([x + since * (u * c - v * s), y + since * (u * s + v * c), heading])


def scores(log: FilterLog, role: str, runs: Sequence[FreeRun]) -> Iterator[Score]:
    """The errors after each horizon, over the runs that reach it."""
    for horizon in HORIZONS:
        chosen = runs[:1] if np.isinf(horizon) else runs
        errors = np.array([run.errors(horizon) for run in chosen]).reshape(len(chosen), len(WHO), 2)
        errors = errors[np.isfinite(errors[:, 0, 0])]
        for i, who in enumerate(WHO):
            if len(errors):
                own = errors[:, i]
                position, heading = _rms(own[:, 0]), _rms(own[np.isfinite(own[:, 1]), 1])
                yield Score(log.name, role, horizon, who, len(own), position, heading)


def scores_worse_than_prior(
    scores: Sequence[Score], noise: float = 0.0
) -> list[tuple[Score, Score]]:
    """Scores of the hull from the logs whose position error is more than WORSE times the prior's.

    Each stands beside the prior's score. An error that the positions' own `noise` [m] explains is
    not worse than another.
    """
    own, prior = ([s for s in scores if s.who == who] for who in WHO[:2])
    return [
        (s, before)
        for s, before in zip(own, prior, strict=True)
        if s.position > WORSE * max(before.position, noise)
    ]


def decisive(scores: Sequence[Score]) -> list[Score]:
    """Those that decide whether a hull is an improvement: of each log at one horizon.

    That is SHOWN, or the longest of a log that has no such run. Logs that were not fitted decide;
    the others do where all were fitted.
    """
    judged = [s for s in scores if s.role == "judge"] or list(scores)
    chosen: list[Score] = []
    for log in dict.fromkeys(s.log for s in judged):
        own = [s for s in judged if s.log == log]
        horizons = {s.horizon for s in own}
        at = SHOWN if SHOWN in horizons else max(horizons)
        chosen += [s for s in own if s.horizon == at]
    return chosen
