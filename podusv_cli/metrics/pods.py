"""Metrics of pods; their speeds and angles follow the vessel's state."""

from __future__ import annotations

import math
from typing import Any

from podusv_cli.components.actuators.propeller import DELTA, LIMITED
from podusv_cli.core.kernel import Vector, kernel, tail
from podusv_cli.metrics.metric import Accumulator, Measured, Metric, add, gathered, ratio

TIME, ENERGY, SPEED, ANGLE, RATE, INTEGRALS = range(6)
TRAVEL, LAST_DELTA = 2 * INTEGRALS, 2 * INTEGRALS + 1  # the last angle of every pod


# Arguments as those of `spans.all_kernels`; changes `seen`. The states of pods follow the vessel's
# six: speeds, then angles. The energy is one of all pods, so its last amount is added up here.
@kernel
def watch(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Gather energy, the travel of the angles, and the time at each limit."""
    count, flags = int(k.pods), tail(row, int(k.limits))
    add(seen, INTEGRALS, TIME, weight)
    for i in range(3):
        add(seen, INTEGRALS, SPEED + i, weight * flags[i])
    seen[INTEGRALS + ENERGY] = 0.0
    for i in range(count):
        delta = s[6 + count + i]
        if t > 0.0:
            seen[TRAVEL] += abs(delta - seen[LAST_DELTA + i])
        seen[LAST_DELTA + i] = delta
        share = weight * row[int(k.power) + i] if k.power >= 0.0 else math.nan
        seen[ENERGY] += share
        seen[INTEGRALS + ENERGY] += share


def _count(layout: Measured) -> int:
    """How many pods the actuator has."""
    return layout.loop.actuator.states.count(DELTA)


def _size(layout: Measured) -> int:
    """How many numbers are gathered, with the last angle of each pod; none without pods."""
    return LAST_DELTA + _count(layout) if _count(layout) else 0


def _constants(layout: Measured) -> dict[str, float]:
    """The number of pods, and the columns of limits and power, -1 where there is none."""
    limits, power = layout.column(LIMITED[0].name), layout.column("power")
    return {"pods": float(_count(layout)), "limits": float(limits), "power": float(power)}


OF = Accumulator(watch, _size, _constants, INTEGRALS)
at_speed_limit = Metric(
    "at_speed_limit",
    "1",
    "part of the time with a propeller commanded to its speed limit",
    OF,
    ratio(SPEED, TIME),
    place=6,
    words="share of time at a propeller's speed limit",
)
at_angle_limit = Metric(
    "at_angle_limit",
    "1",
    "part of the time with a pod commanded to its angle limit",
    OF,
    ratio(ANGLE, TIME),
    place=6,
    words="share of time at a pod's angle limit",
)
at_rate_limit = Metric(
    "at_rate_limit",
    "1",
    "part of the time in which a pod turns as fast as its drive can",
    OF,
    ratio(RATE, TIME),
    place=6,
    words="share of time at a pod's fastest turning",
)
energy = Metric(
    "energy_pod",
    "J",
    "integral of the propellers' power, where it is known",
    OF,
    gathered(ENERGY),
    place=6,
    words="work of the propellers",
)
travel = Metric(
    "angle_travel",
    "rad",
    "total travel of all pods' angles, a measure of steering wear",
    OF,
    gathered(TRAVEL),
    place=6,
)
