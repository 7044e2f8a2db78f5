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


def estimate_in_sea(problem: FitProblem, tell: Tell) -> tuple[FitProblem, HullEstimate]:
    """The best numbers, and in which sea: loads that wander, or gusts where these are likelier.

    Gusts are tried with the hull of loads that wander: if their own numbers alone make the logs
    likelier, all are looked for again. An interrupt leaves the best so far.
    """
    found = estimate_hull(problem.search, tell)
    if found.interrupted:
        return problem, found
    gusty = replace(problem, gusts=True)
    try:
        start, value = fit_gusts(gusty, _named_alike(problem, gusty, found.y), tell)
        if value > found.value - BETTER:
            return problem, found
        again = estimate_hull(replace(gusty.search, first=start), tell)
    except KeyboardInterrupt:  # before its first round
        return problem, replace(found, interrupted=True)
    return (gusty, again) if again.value < found.value - BETTER else (problem, found)


def _named_alike(problem: FitProblem, gusty: FitProblem, y: Vector) -> Vector:
    """A point's numbers for gusts, whose mean load is the one that a log began with."""
    known = dict(zip((number.name for number in problem.numbers), y.tolist(), strict=True))
    for mean, first in zip(MEAN_LOADS, FIRST_LOADS, strict=True):
        known |= {f"{mean}, {log.name}": known[f"{first}, {log.name}"] for log in problem.logs}
    return np.array([known.get(number.name, 0.0) for number in gusty.numbers])


def fit_gusts(gusty: FitProblem, y: Vector, tell: Tell) -> tuple[Vector, float]:
    """A point with the likeliest gusts beside its other numbers, and -2 log of the posterior there.

    That is infinite where the filter breaks down.
    """
    own = (*WALKS[3:], *GUSTS)
    free = np.array([i for i, number in enumerate(gusty.numbers) if number.name in own])
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
        return y, math.inf
    found = estimate_hull(search, tell, starts=1)
    return point(found.y), float(found.value + held @ held)
