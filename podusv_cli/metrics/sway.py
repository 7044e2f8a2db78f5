"""Metrics of the sway force of vessels that can be asked for one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.metrics.metric import Accumulator, Measured, Metric, add, gathered, ratio
from podusv_cli.metrics.spans import ANEW, WITHIN

TIME, EFFORT, INTEGRALS = range(3)
USE_U, USE_V, USE_R, USES = range(1, 5)
PEAK, TV, LAST, SETTLED = range(2 * INTEGRALS, 2 * INTEGRALS + 4)
SIZE = SETTLED + 1
USE, THRUSTS = 1, 2
THRUST = "thrust"  # of each thruster, as actuators log it
SWAY = 2  # where a demand has the sway force


# Arguments as those of `spans.all_kernels`; changes `seen`.
@kernel
def watch(weight: float, steady: float, row: Vector, k: Any, seen: Vector) -> None:
    """Gather the largest demand, the sum of its changes, and the squared force."""
    demand, force = row[int(k.demand) + SWAY], row[int(k.tau) + 1]
    add(seen, INTEGRALS, TIME, weight)
    add(seen, INTEGRALS, EFFORT, weight * force * force)
    seen[PEAK] = max(seen[PEAK], abs(demand))
    if steady == ANEW:
        seen[SETTLED] = seen[TV] = 0.0
    if steady >= WITHIN:
        if seen[SETTLED] > 0.0:
            seen[TV] += abs(demand - seen[LAST])
        seen[SETTLED] += 1.0
    seen[LAST] = demand


# Arguments as those of `spans.all_kernels`; changes `seen`.
@kernel
def watch_use(weight: float, row: Vector, k: Any, seen: Vector) -> None:
    """Gather the parts of limits that loads take."""
    tau = int(k.tau)
    add(seen, USES, TIME, weight)
    add(seen, USES, USE_U, weight * abs(row[tau]) / k.limit_u)
    add(seen, USES, USE_V, weight * abs(row[tau + 1]) / k.limit_v)
    add(seen, USES, USE_R, weight * abs(row[tau + 2]) / k.limit_r)


# Arguments as those of `spans.all_kernels`; changes `seen`.
@kernel
def watch_thrust(weight: float, row: Vector, k: Any, seen: Vector) -> None:
    """Gather the part of full thrust that thrusters give."""
    add(seen, THRUSTS, TIME, weight)
    total = 0.0
    for i in range(int(k.thrusters)):
        total += abs(row[int(k.thrust) + i])
    add(seen, THRUSTS, USE, weight * total / k.full_thrust)


def _size(layout: Measured) -> int:
    """How many numbers are gathered; none without a sway force."""
    return SIZE if layout.loop.actuator.takes_sway else 0


def _constants(layout: Measured) -> dict[str, float]:
    """Where the demand and the loads stand in the row."""
    return {"demand": float(layout.plan.demand), "tau": float(layout.plan.tau)}


def _size_of_use(layout: Measured) -> int:
    """How many numbers are gathered; none without a sway force or a constant limit of a load."""
    limited = np.isfinite(layout.loop.actuator.limits()).all()
    return 2 * USES if layout.loop.actuator.takes_sway and limited else 0


def _limits(layout: Measured) -> dict[str, float]:
    """The column of the loads, and the actuator's limits [N, N, N m]; 1 of a sway force it lacks.

    Limits come in the order of a demand, yaw before sway.
    """
    u, r, v = (*layout.loop.actuator.limits(), 1.0)[:3]
    return {"tau": float(layout.plan.tau), "limit_u": u, "limit_v": v, "limit_r": r}


def _size_of_thrust(layout: Measured) -> int:
    """How many numbers are gathered; none without a sway force or thrusters."""
    actuator = layout.loop.actuator
    return 2 * THRUSTS if actuator.takes_sway and actuator.full_thrust() > 0.0 else 0


def _thrusters(layout: Measured) -> dict[str, float]:
    """How many thrusters there are, the column of the first one's thrust, and full thrust [N]."""
    names = [signal.name for signal in layout.loop.actuator.signals]
    return {
        "thrusters": float(names.count(THRUST)),
        "thrust": float(layout.column(THRUST)),
        "full_thrust": layout.loop.actuator.full_thrust(),
    }


def _variation(seen: Vector, step: float) -> float:
    """The total variation; NaN with fewer than two steady instants."""
    # Over a single instant nothing varies, and 0 would mark a run as the best
    return float(seen[TV]) if seen[SETTLED] > 1.0 else math.nan


OF = Accumulator(watch, _size, _constants, INTEGRALS)
OF_USE = Accumulator(
    watch_use, _size_of_use, _limits, USES, differing=("limit_u", "limit_v", "limit_r")
)
OF_THRUST = Accumulator(
    watch_thrust, _size_of_thrust, _thrusters, THRUSTS, differing=("full_thrust",)
)
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
    OF_USE,
    ratio(USE_U, TIME),
    place=0,
    words="use of the surge force, mean part of its limit",
    headline=True,
)
use_v = Metric(
    "thrust_use_v",
    "1",
    "mean |tau_v| over the actuator's limit of it",
    OF_USE,
    ratio(USE_V, TIME),
    place=0,
    words="use of the sway force, mean part of its limit",
    headline=True,
)
use_r = Metric(
    "thrust_use_r",
    "1",
    "mean |tau_r| over the actuator's limit of it",
    OF_USE,
    ratio(USE_R, TIME),
    place=0,
    words="use of the yaw moment, mean part of its limit",
    headline=True,
)
thrust_use = Metric(
    "thrust_use",
    "1",
    "mean sum of the thrusters' |thrust| over that of all at full thrust, at rest",
    OF_THRUST,
    ratio(USE, TIME),
    place=0,
    words="use of all thrusters, mean part of full thrust",
    headline=True,
)
