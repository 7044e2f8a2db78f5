"""Corners of a path rounded for the law: it begins its turn before the target does.

The law is shown the mean of the target's positions from T/2 before an instant to T/2 after it.
Where the velocity jumps by dv at t_c, between two straight legs, this differs from the target by

    dv (T/2 - |t - t_c|)^2/(2 T)    for |t - t_c| < T/2

so a corner becomes a parabola. The log, and all that is measured, have the target itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from podusv_cli.core.interpolation import segment
from podusv_cli.core.kernel import Vector, kernel, tail


# t [s]; writes shown (6) from target (6): position [m], velocity, acceleration. Corners of the lap
# are sought half a fillet ahead, so the one just before or after t is found; `s` [s] is the time
# since it. By the module's formula; `side` is the derivative of the square, with its sign.
@kernel
def round_corner(t: float, k: Any, table: Vector, target: Vector, shown: Vector) -> None:
    """shown = the target at t as the law sees it; the path's table ends in `Fillet.rows`."""
    for i in range(6):
        shown[i] = target[i]
    count, corners = int(k.fillet_corners), tail(table, int(k.fillet_place))
    lap = t - k.fillet_period * math.floor(t / k.fillet_period)
    i = segment(lap + 0.5 * k.fillet, count, corners)
    s = lap - corners[i]
    left = 0.5 * k.fillet - abs(s)
    if left > 0.0 and t > s:  # the first lap has no corner at its start
        side = -left if s >= 0.0 else left
        for axis in range(2):
            rate = corners[count + 2 * i + axis] / k.fillet
            shown[axis] += 0.5 * rate * left * left
            shown[2 + axis] += rate * side
            shown[4 + axis] += rate


@dataclass(frozen=True, eq=False)
class Fillet:
    """Corners, each with its time [s] and the jump of the velocity [m/s], rounded over `time` [s].

    They come again after each `period` [s].
    """

    time: float
    period: float
    times: Vector
    jumps: Vector  # a row of north and east a corner

    def rows(self) -> Vector:
        """The corners as the kernel reads them (3 corners,): times [s], two jumps a corner."""
        return np.concatenate([self.times, self.jumps.ravel()])

    def edges(self) -> Vector:
        """Times [s] at which the acceleration that the law sees jumps, in order."""
        half = 0.5 * self.time
        return np.column_stack([self.times - half, self.times + half]).ravel()

    def steps(self) -> Vector:
        """How large the acceleration of each corner is [m/s2]."""
        return np.asarray(np.hypot(*self.jumps.T) / self.time)

    def constants(self, place: int) -> dict[str, float]:
        """What the kernel reads from `k`, where `rows` begin at `place` of the path's table."""
        return {
            "fillet": self.time,
            "fillet_period": self.period,
            "fillet_corners": float(len(self.times)),
            "fillet_place": float(place),
        }
