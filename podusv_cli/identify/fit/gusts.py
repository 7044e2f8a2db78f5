"""Whether loads along the logs are those of gusts, and the hull that is found where they are."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.identify.fit.estimate import HullEstimate, HullSearch, Tell, estimate_hull
from podusv_cli.identify.fit.march import GUSTS
from podusv_cli.identify.fit.problem import FIRST_LOADS, MEAN_LOADS, WALKS, FitProblem

BETTER = 10.0  # in -2 log of the posterior: what gusts, of two numbers more, have to gain
# What makes the loads of a sea. Their prior counts neither for one sea nor for the other: on calm
# water it says that loads are small, and less so of gusts, which would win by that.
LOADS = (*WALKS[3:], *GUSTS)


def estimate_in_sea(problem: FitProblem, tell: Tell) -> tuple[FitProblem, HullEstimate]:
    """The best numbers, and in which sea: loads that wander, or gusts where these are likelier.

    An interrupt leaves the best so far.
    """
    first = estimate_hull(problem.search, tell, starts=1)
    if first.interrupted:
        return problem, first
    try:
        gusty = _estimate_in_gusts(problem, first, tell)
    except KeyboardInterrupt:
        return problem, replace(first, interrupted=True)
    return gusty or (problem, estimate_hull(problem.search, tell, begun=first))


def _estimate_in_gusts(
    problem: FitProblem, first: HullEstimate, tell: Tell
) -> tuple[FitProblem, HullEstimate] | None:
    """The best numbers in gusts; None where these are no likelier than loads that wander.

    Gusts are tried with the hull of the first search. Where their own numbers alone make the logs
    likelier, all are looked for; and as that search may have ended at a hull that is wrong, which
    looks like gusts, loads that wander have to be less likely with the hull that comes out, too.
    """
    gusty = replace(problem, gusts=True)
    trial = fit_gusts(gusty, same_numbers(problem, gusty, first.y), tell)
    if gain(gusty, trial, problem, first) < BETTER:
        return None
    found = estimate_hull(replace(gusty.search, first=trial.y), tell)
    if found.interrupted:
        return gusty, found
    calm = replace(problem.search, first=same_numbers(gusty, problem, found.y))
    wanders = estimate_hull(calm, tell, starts=1)
    if wanders.interrupted:
        return gusty, replace(found, interrupted=True)
    return (gusty, found) if gain(gusty, found, problem, wanders) >= BETTER else None


def gain(gusty: FitProblem, found: HullEstimate, problem: FitProblem, other: HullEstimate) -> float:
    """In -2 log of the posterior, but for the prior of the loads: of gusts over another sea."""
    values = [
        estimate.value
        - sum(e * e for e, n in zip(estimate.y, sea.numbers, strict=True) if n.name in LOADS)
        for sea, estimate in ((gusty, found), (problem, other))
    ]
    return float(values[1] - values[0])


def same_numbers(problem: FitProblem, other: FitProblem, y: Vector) -> Vector:
    """A point in the numbers of another sea; what a log began with and its mean load are one."""
    known = dict(zip((number.name for number in problem.numbers), y.tolist(), strict=True))
    for log in problem.logs:
        for pair in zip(FIRST_LOADS, MEAN_LOADS, strict=True):
            names = [f"{name}, {log.name}" for name in pair]
            known |= dict.fromkeys(names, next(known[n] for n in names if n in known))
    return np.array([known.get(number.name, 0.0) for number in other.numbers])


def fit_gusts(gusty: FitProblem, y: Vector, tell: Tell) -> HullEstimate:
    """The likeliest gusts beside the other numbers of a point.

    Its value is infinite where the filter breaks down at the point. An interrupt ends it.
    """
    free = np.array([i for i, number in enumerate(gusty.numbers) if number.name in LOADS])
    held = y.copy()
    held[free] = 0.0

    def point(part: Vector) -> Vector:
        whole = held.copy()
        whole[free] = part
        return whole

    def innovations(points: Sequence[Vector]) -> tuple[Vector, Vector]:
        return gusty.innovations([*map(point, points)])

    search = HullSearch(innovations, len(free), gusty.blocks, first=y[free])
    if not math.isfinite(search.values([y[free]])[0]):
        return HullEstimate(y, math.inf, np.eye(len(y)), 0)
    found = estimate_hull(search, tell, starts=1)
    if found.interrupted:
        raise KeyboardInterrupt
    return replace(found, y=point(found.y), value=float(found.value + held @ held))
