"""Metrics of the sway force of vessels that can be asked for one."""

from __future__ import annotations

import math
from typing import Any

from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.metrics.metric import Accumulator, Measured, Metric, Result, add, gathered, ratio
from podusv_cli.metrics.spans import ANEW, WITHIN

TIME, EFFORT, USE_U, USE_V, USE_R, INTEGRALS = range(6)
PEAK, TV, LAST, SETTLED = range(2 * INTEGRALS, 2 * INTEGRALS + 4)
SIZE = SETTLED + 1
SWAY = 2  # where a demand has the sway force


# Arguments as those of `spans.all_kernels`; changes `seen`.
@kernel
def watch(weight: float, steady: float, row: Vector, k: Any, seen: Vector) -> None:
    """Gather the largest demand, the sum of its changes, the squared force, and parts of limits."""
    demand, force = row[int(k.demand) + SWAY], row[int(k.tau) + 1]
    add(seen, INTEGRALS, TIME, weight)
    add(seen, INTEGRALS, EFFORT, weight * force * force)
    add(seen, INTEGRALS, USE_U, weight * abs(row[int(k.tau)]) / k.limit_u)
    add(seen, INTEGRALS, USE_V, weight * abs(force) / k.limit_v)
    add(seen, INTEGRALS, USE_R, weight * abs(row[int(k.tau) + 2]) / k.limit_r)
    seen[PEAK] = max(seen[PEAK], abs(demand))
    if steady == ANEW:
        seen[SETTLED] = seen[TV] = 0.0
    if steady >= WITHIN:
        if seen[SETTLED] > 0.0:
            seen[TV] += abs(demand - seen[LAST])
        seen[SETTLED] += 1.0
    seen[LAST] = demand


def _size(layout: Measured) -> int:
    return SIZE if layout.loop.actuator.takes_sway else 0


def _constants(layout: Measured) -> dict[str, float]:
    """Columns of demand and loads, and the actuator's limits, infinite without any."""
    u, r, v = layout.loop.actuator.limits()
    columns = {"demand": float(layout.plan.demand), "tau": float(layout.plan.tau)}
    return columns | {"limit_u": u, "limit_v": v, "limit_r": r}


def _variation(seen: Vector, step: float) -> float:
    """The total variation; NaN with fewer than two steady instants."""
    return float(seen[TV]) if seen[SETTLED] > 1.0 else math.nan


def _use(position: int) -> Result:
    """The mean part of a limit that a load takes; NaN without a limit."""
    mean = ratio(position, TIME)
    return lambda seen, step: mean(seen, step) or math.nan


OF = Accumulator(watch, _size, _constants, INTEGRALS, ("limit_u", "limit_v", "limit_r"))
peak_v = Metric(
    "peak_tau_v",
    "N",
    "largest |tau_v| that the law demanded",
    OF,
    gathered(PEAK),
    place=2,
    symbol=r"\max|\tau_{v,\mathrm{cmd}}|",
    words="largest sway force demanded",
)
effort_v = Metric(
    "effort_v",
    "N2 s",
    "integral of tau_v^2 on the hull",
    OF,
    gathered(EFFORT),
    place=3,
    symbol=r"\int\tau_v^2\,\mathrm{d}t",
    words="squared sway force, integrated",
)
tv_v = Metric(
    "tv_tau_v",
    "N",
    "total variation of the demanded tau_v in the steady window",
    OF,
    _variation,
    place=4,
    symbol=r"\mathrm{TV}(\tau_{v,\mathrm{cmd}})",
    words="variation of the sway demand, steady",
)
use_u = Metric(
    "thrust_use_u",
    "1",
    "mean |tau_u| over the actuator's limit of it",
    OF,
    _use(USE_U),
    place=5,
    words="use of the surge force, mean part of its limit",
)
use_v = Metric(
    "thrust_use_v",
    "1",
    "mean |tau_v| over the actuator's limit of it",
    OF,
    _use(USE_V),
    place=5,
    words="use of the sway force, mean part of its limit",
)
use_r = Metric(
    "thrust_use_r",
    "1",
    "mean |tau_r| over the actuator's limit of it",
    OF,
    _use(USE_R),
    place=5,
    words="use of the yaw moment, mean part of its limit",
)
