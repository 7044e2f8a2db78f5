"""A solution of a scenario by scipy's DOP853: order eight, restarted at the path's breaks.

It fits scenarios whose right-hand side is smooth between these breaks: a law without samples,
exact measurements, an actuator without limits in reach.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from continuous import Slope, continuous
from scipy.integrate import DOP853

from podusv_cli.core.kernel import Vector, bundle, call
from podusv_cli.core.signal import TARGET_SIZE
from podusv_cli.scenario.model import Scenario

TOLERANCE = 1e-10  # relative and absolute, of every state


class Solution(NamedTuple):
    """End position [m] and IAE [m s]."""

    position: Vector
    iae: float


def integrate(scenario: Scenario) -> Solution:
    """Integrate the scenario; the IAE is one more state."""
    duration = scenario.time_grid().steps * scenario.simulation.step
    compiled = scenario.simulation.compiled
    slope, start = continuous(scenario.closed_loop(), duration, compiled=compiled)
    f, s = _with_iae(scenario, slope), np.append(start, 0.0)
    for begin, end in _pieces(scenario, duration):
        solver = DOP853(f, begin, s, end, rtol=TOLERANCE, atol=TOLERANCE)
        while solver.status == "running":
            assert not solver.step()
        s = solver.y
    return Solution(s[:2], float(s[-1]))


def _pieces(scenario: Scenario, duration: float) -> Iterator[tuple[float, float]]:
    """Intervals between the path's breaks; each but the first starts just after its break."""
    fillet = scenario.path.fillet_for_law()
    breaks = {at.time for at in scenario.path.breaks()} | set(fillet.edges() if fillet else ())
    inner = sorted(time for time in breaks if 0.0 < time < duration)
    for begin, end in pairwise([0.0, *inner, duration]):
        yield (float(np.nextafter(begin, math.inf)) if begin else 0.0), end


def _with_iae(scenario: Scenario, slope: Slope) -> Slope:
    path, target = scenario.path, np.zeros(TARGET_SIZE)
    k, table = bundle(path.constants()), path.table()

    def f(t: float, s: Vector) -> Vector:
        call(path.evaluate, t=t, k=k, table=table, target=target)
        return np.append(slope(t, s[:-1]), math.hypot(target[0] - s[0], target[1] - s[1]))

    return f
