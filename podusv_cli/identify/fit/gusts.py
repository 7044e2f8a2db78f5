"""Whether loads along the logs are those of gusts, and the hull that is found where they are."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.identify.fit.estimate import (
    SETTLED,
    STARTS,
    HullEstimate,
    HullSearch,
    Tell,
    estimate_hull,
)
from podusv_cli.identify.fit.march import GUSTS
from podusv_cli.identify.fit.problem import FIRST_LOADS, MEAN_LOADS, WALKS, FitProblem

# What gusts have to gain, in -2 log of the posterior without the prior of the loads. They gained 7
# to 9 on ten calm logs of the model ship: that prior still moves the optimum of either sea.
BETTER = 10.0
# What makes the loads of a sea. Their prior does not count between seas: on calm water it says that
# loads are small, and less so of gusts, which would win by that.
LOADS = (*WALKS[3:], *GUSTS)


def estimate_in_sea(problem: FitProblem, tell: Tell) -> tuple[FitProblem, HullEstimate]:
    """The best numbers, and in which sea: loads that wander, or gusts where these are likelier.

    What `identify.gusts` asks for is not looked for. An interrupt leaves the best so far.
    """
    asked = problem.wanted.gusts
    if asked is None:
        return SeaSearch(problem, tell).estimate()
    given = replace(problem, gusts=asked)
    return given, estimate_hull(given.search, tell)


@dataclass(frozen=True)
class SeaSearch:
    """What is looked for, in loads that wander; `gusty` is the same in gusts."""

    problem: FitProblem
    tell: Tell

    @cached_property
    def gusty(self) -> FitProblem:
        """The problem in gusts."""
        return replace(self.problem, gusts=True)

    def estimate(self) -> tuple[FitProblem, HullEstimate]:
        """The best numbers, and in which sea.

        Gusts are looked for where their own numbers alone make the logs likelier, with the hull of
        the first search, or of the best if the first was stuck; and where searches in loads that
        wander do not settle.
        """
        search = self.problem.search
        found = first = estimate_hull(search, self.tell, starts=1)
        try:
            begin, starts = self._begin(first), STARTS
            if begin is None:
                found, starts = estimate_hull(search, self.tell, begun=(first,)), 2
                begin = self._begin(found) if found.value < first.value - SETTLED else None
            if found.interrupted or (begin is None and found.settled):
                return self.problem, found
            return self._choose(found, begin, starts)
        except KeyboardInterrupt:
            return self.problem, replace(found, interrupted=True)

    def _begin(self, found: HullEstimate) -> Vector | None:
        """Where a search in gusts begins: at the likeliest for a hull. None if they gain little."""
        if found.interrupted:
            return None
        trial = self.fit_gusts(self.to_gusts(found.y))
        return trial.y if self.gain(trial, found) >= BETTER else None

    def _choose(
        self, found: HullEstimate, begin: Vector | None, starts: int
    ) -> tuple[FitProblem, HullEstimate]:
        """The best numbers in gusts, looked for from a point on, if they are likelier than `found`.

        A wrong hull looks like gusts. So loads that wander are tried with the hull of gusts, too,
        and have to be less likely. Otherwise searches in loads that wander go on, up to `starts`.
        """
        swings = self._look(self.gusty, begin, STARTS)
        if swings is None:
            return self.problem, found
        wanders, stopped = None, True
        with suppress(KeyboardInterrupt):  # before its first round
            if not swings.interrupted:
                wanders = self._look(self.problem, self.from_gusts(swings.y), 1)
                stopped = wanders is not None and wanders.interrupted
        rivals = [e for e in (found, wanders) if e is not None]
        if min(self.gain(swings, rival) for rival in rivals) >= BETTER:
            return self.gusty, replace(swings, interrupted=stopped)
        if stopped:
            return self.problem, replace(min(rivals, key=lambda e: e.value), interrupted=True)
        return self.problem, estimate_hull(
            self.problem.search, self.tell, starts=starts, begun=rivals
        )

    def _look(self, sea: FitProblem, begin: Vector | None, starts: int) -> HullEstimate | None:
        """The best of so many searches, the first from a point; None if the filter breaks there."""
        first = np.zeros(len(sea.numbers)) if begin is None else begin
        if not math.isfinite(sea.search.values([first])[0]):
            return None
        return estimate_hull(replace(sea.search, first=first), self.tell, starts=starts)

    def fit_gusts(self, y: Vector) -> HullEstimate:
        """The likeliest gusts beside the other numbers of a point.

        Its value is infinite where the filter breaks down at the point. An interrupt ends it.
        """
        gusty = self.gusty
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
        found = estimate_hull(search, self.tell, starts=1)
        if found.interrupted:
            raise KeyboardInterrupt
        return replace(found, y=point(found.y), value=float(found.value + held @ held))

    def gain(self, swings: HullEstimate, wanders: HullEstimate) -> float:
        """Of gusts, in -2 log of the posterior, but for the prior of the loads."""
        return _value_without_loads(self.problem, wanders) - _value_without_loads(
            self.gusty, swings
        )

    def to_gusts(self, y: Vector) -> Vector:
        """The point in gusts that has the numbers of a point in loads that wander."""
        return _same_numbers(self.problem, self.gusty, y)

    def from_gusts(self, y: Vector) -> Vector:
        """The point in loads that wander that has the numbers of a point in gusts."""
        return _same_numbers(self.gusty, self.problem, y)


def _same_numbers(one: FitProblem, other: FitProblem, y: Vector) -> Vector:
    """The point with the same numbers; what a log began with and its mean load are one."""
    known = dict(zip((number.name for number in one.numbers), y.tolist(), strict=True))
    for log in one.logs:
        for pair in zip(FIRST_LOADS, MEAN_LOADS, strict=True):
            names = [f"{name}, {log.name}" for name in pair]
            known |= dict.fromkeys(names, next(known[n] for n in names if n in known))
    return np.array([known.get(number.name, 0.0) for number in other.numbers])


def _value_without_loads(sea: FitProblem, found: HullEstimate) -> float:
    """-2 log of the posterior without what the prior of the loads adds to it."""
    numbers = zip(found.y.tolist(), sea.numbers, strict=True)
    spent = sum(e * e for e, number in numbers if number.name in LOADS)
    return float(found.value - spent)
