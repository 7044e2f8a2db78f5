"""Whether the filter's innovations are white, as they are where model and noise are right."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.signal import STATE
from podusv_cli.identify.fit.problem import FitProblem, channels
from podusv_cli.identify.fit.records import FilterLog

ALIKE = 0.2  # correlation of an innovation with the one before, from which on it is said
CHANCE = 4.0  # over the root of their number: a correlation that white innovations hardly have


@dataclass(frozen=True)
class Whiteness:
    """Innovations of a sensor along a log: mean square over variance, and how like the one before.

    Both say where the model is wrong: the first is 1 and the second 0 where it is right.
    """

    log: str
    measured: str
    count: int
    nis: float
    correlation: float

    @property
    def is_white(self) -> bool:
        """Whether they are correlated by no more than chance makes them."""
        return abs(self.correlation) <= max(ALIKE, CHANCE / math.sqrt(self.count))


def whiteness_of(problem: FitProblem, y: Vector) -> list[Whiteness]:
    """Of every sensor along every log, with the numbers at a point."""
    return [w for log in problem.logs for w in _along(problem, log, y)]


def _along(problem: FitProblem, log: FilterLog, y: Vector) -> Iterator[Whiteness]:
    """Of the sensors along a log that deliver enough values to tell."""
    followed = problem.follow(log, [y])
    normal = followed.innovations[:, 0] / np.sqrt(followed.variances[:, 0])
    of = channels(log)
    for i, signal in enumerate(STATE):
        own = normal[of == i][5:]
        if len(own) > 10:
            alike = float(np.mean(own[1:] * own[:-1]) / np.mean(own**2))
            yield Whiteness(log.name, signal.name, len(own), float(np.mean(own**2)), alike)
