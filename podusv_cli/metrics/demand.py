"""Metrics of the law's demand: peaks, and total variation in the steady window."""

from __future__ import annotations

import math
from typing import Any

from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.metrics.metric import Accumulator, Measured, Metric, Result, gathered
from podusv_cli.metrics.spans import ANEW, WITHIN

PEAK_U, PEAK_R, TV_U, TV_R, LAST_U, LAST_R, SETTLED, SIZE = range(8)


# Arguments as those of `spans.all_kernels`; changes `seen`.
@kernel
def watch(steady: float, row: Vector, k: Any, seen: Vector) -> None:
    """Gather the largest demands, and the sum of their changes."""
    u, r = row[int(k.demand)], row[int(k.demand) + 1]
    seen[PEAK_U] = max(seen[PEAK_U], abs(u))
    seen[PEAK_R] = max(seen[PEAK_R], abs(r))
    if steady == ANEW:
        seen[SETTLED] = seen[TV_U] = seen[TV_R] = 0.0
    if steady >= WITHIN:
        if seen[SETTLED] > 0.0:
            seen[TV_U] += abs(u - seen[LAST_U])
            seen[TV_R] += abs(r - seen[LAST_R])
        seen[SETTLED] += 1.0
    seen[LAST_U] = u
    seen[LAST_R] = r


def _variation(position: int) -> Result:
    """The total variation gathered at this position; NaN with fewer than two steady instants."""
    # Over a single instant nothing varies, and 0 would mark a run as the best
    return lambda seen, step: float(seen[position]) if seen[SETTLED] > 1.0 else math.nan


def _constants(layout: Measured) -> dict[str, float]:
    """Where the demand stands in the row."""
    return {"demand": float(layout.plan.demand)}


OF = Accumulator(watch, lambda layout: SIZE, _constants)
peak_u = Metric(
    "peak_tau_u",
    "N",
    "largest |tau_u| that the law demanded",
    OF,
    gathered(PEAK_U),
    place=2,
    symbol=r"\max|\tau_{u,\mathrm{cmd}}|",
    words="largest surge force demanded",
)
peak_r = Metric(
    "peak_tau_r",
    "N m",
    "largest |tau_r| that the law demanded",
    OF,
    gathered(PEAK_R),
    place=2,
    symbol=r"\max|\tau_{r,\mathrm{cmd}}|",
    words="largest yaw moment demanded",
)
tv_u = Metric(
    "tv_tau_u",
    "N",
    "total variation of the demanded tau_u in the steady window",
    OF,
    _variation(TV_U),
    place=4,
    symbol=r"\mathrm{TV}(\tau_{u,\mathrm{cmd}})",
    words="variation of the surge demand, steady",
)
tv_r = Metric(
    "tv_tau_r",
    "N m",
    "total variation of the demanded tau_r in the steady window",
    OF,
    _variation(TV_R),
    place=4,
    symbol=r"\mathrm{TV}(\tau_{r,\mathrm{cmd}})",
    words="variation of the yaw demand, steady",
)
