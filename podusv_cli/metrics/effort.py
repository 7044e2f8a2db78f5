"""Metrics of the loads on the hull, and of the actuator's saturation."""

from __future__ import annotations

from typing import Any

from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.metrics.metric import Accumulator, Measured, Metric, add, gathered, ratio

TIME, EFFORT_U, EFFORT_R, ENERGY, SATURATED, INTEGRALS = range(6)


# Arguments as those of `spans.all_kernels`; changes `seen`.
@kernel
def watch(weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Gather squared loads, their work, and the time in saturation."""
    tau = int(k.tau)
    add(seen, INTEGRALS, TIME, weight)
    add(seen, INTEGRALS, EFFORT_U, weight * row[tau] * row[tau])
    add(seen, INTEGRALS, EFFORT_R, weight * row[tau + 2] * row[tau + 2])
    work = abs(row[tau] * s[3]) + abs(row[tau + 1] * s[4]) + abs(row[tau + 2] * s[5])
    add(seen, INTEGRALS, ENERGY, weight * work)
    if k.saturated >= 0.0:
        add(seen, INTEGRALS, SATURATED, weight * row[int(k.saturated)])


def _constants(layout: Measured) -> dict[str, float]:
    """The columns of the loads, and of the mark of saturation, -1 without one."""
    return {"tau": float(layout.plan.tau), "saturated": float(layout.column("saturated"))}


OF = Accumulator(watch, lambda layout: 2 * INTEGRALS, _constants, INTEGRALS)
effort_u = Metric(
    "effort_u",
    "N2 s",
    "integral of tau_u^2 on the hull",
    OF,
    gathered(EFFORT_U),
    place=3,
    symbol=r"\int\tau_u^2\,\mathrm{d}t",
    words="squared surge force, integrated",
)
effort_r = Metric(
    "effort_r",
    "N2 m2 s",
    "integral of tau_r^2 on the hull",
    OF,
    gathered(EFFORT_R),
    place=3,
    symbol=r"\int\tau_r^2\,\mathrm{d}t",
    words="squared yaw moment, integrated",
)
energy = Metric(
    "energy",
    "J",
    "integral of |tau_u u| + |tau_v v| + |tau_r r|, tau on the hull",
    OF,
    gathered(ENERGY),
    place=3,
    symbol=r"\int|\tau_u u|+|\tau_v v|+|\tau_r r|\,\mathrm{d}t",
    words="effort: work on the hull",
    headline=True,
)
saturated_fraction = Metric(
    "saturated_fraction",
    "1",
    "part of the time in which the actuator limits the law",
    OF,
    ratio(SATURATED, TIME),
    place=5,
    words="share of time at the actuator's limits",
    headline=True,
)
