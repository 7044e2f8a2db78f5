"""Metrics gathered while a run goes on, so that they see every step whatever the log keeps.

Integrals are trapezoidal on the grid of steps: the engine hands over the weight of each instant.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from podusv_cli.engine.grid import TimeGrid
from podusv_cli.engine.simulate import ClosedLoop, Observer
from podusv_cli.kernels import Vector, kernel

# What is gathered, by position.
(
    TIME, ABSOLUTE, SQUARE, TIMED, STEADY, STEADY_TIME, OUTSIDE, PEAK_U, PEAK_R, EFFORT_U, EFFORT_R,
    ENERGY, TV_U, TV_R, LAST_U, LAST_R, SATURATED, NOW, SIZE,
) = range(19)  # fmt: skip


@kernel
def _track(t: float, weight: float, z_e: float, k: Any, seen: Vector) -> None:
    seen[TIME] += weight
    seen[ABSOLUTE] += weight * z_e
    seen[SQUARE] += weight * z_e * z_e
    seen[TIMED] += weight * t * z_e
    seen[NOW] = t
    if z_e > k.settling_radius:
        seen[OUTSIDE] = t
    if t >= k.steady_from:
        opens = seen[STEADY_TIME] == 0.0 and t > 0.0  # half a weight where the window begins
        part = 0.5 * weight if opens else weight
        seen[STEADY] += part * z_e
        seen[STEADY_TIME] += part


@kernel
def _spend(weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    tau = int(k.tau)
    seen[EFFORT_U] += weight * row[tau] * row[tau]
    seen[EFFORT_R] += weight * row[tau + 2] * row[tau + 2]
    seen[ENERGY] += weight * (abs(row[tau] * s[3]) + abs(row[tau + 2] * s[5]))
    if k.saturated >= 0.0:
        seen[SATURATED] += weight * row[int(k.saturated)]


@kernel
def _demand(t: float, u: float, r: float, k: Any, seen: Vector) -> None:
    seen[PEAK_U] = max(seen[PEAK_U], abs(u))
    seen[PEAK_R] = max(seen[PEAK_R], abs(r))
    if t > k.steady_from:
        seen[TV_U] += abs(u - seen[LAST_U])
        seen[TV_R] += abs(r - seen[LAST_R])
    seen[LAST_U] = u
    seen[LAST_R] = r


@kernel
def watch(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Take in one instant; the row begins with the target's position."""
    if t == 0.0:
        seen[OUTSIDE] = -1.0  # nowhere outside the settling radius so far
    z_e = math.sqrt((row[0] - s[0]) ** 2 + (row[1] - s[1]) ** 2)
    _track(t, weight, z_e, k, seen)
    _spend(weight, s, row, k, seen)
    _demand(t, row[int(k.demand)], row[int(k.demand) + 1], k, seen)


def observer(
    loop: ClosedLoop, grid: TimeGrid, *, steady_fraction: float, settling_radius: float
) -> Observer:
    """An observer for `engine.simulate` that gathers what `summarise` needs."""
    plan = loop.layout(grid)
    flags = loop.actuator.signals
    constants = {
        "steady_from": grid.last_part(steady_fraction),
        "settling_radius": settling_radius,
        "demand": float(plan.demand),
        "tau": float(plan.tau),
        "saturated": float(plan.flags + flags.index("saturated")) if "saturated" in flags else -1.0,
    }
    return Observer(watch, constants, SIZE)


def summarise(seen: Vector, step: float) -> dict[str, float]:
    """Metrics by name from what was gathered; NaN where a run ended before one is defined."""
    total = float(seen[TIME])
    inside_from = float(seen[OUTSIDE]) + step if seen[OUTSIDE] >= 0.0 else 0.0
    return {
        "iae": float(seen[ABSOLUTE]),
        "ise": float(seen[SQUARE]),
        "itae": float(seen[TIMED]),
        "rmse": math.sqrt(seen[SQUARE] / total) if total else math.nan,
        "z_e_steady": float(seen[STEADY] / seen[STEADY_TIME]) if seen[STEADY_TIME] else math.nan,
        "settling_time": inside_from if inside_from <= seen[NOW] else math.nan,
        "peak_tau_u": float(seen[PEAK_U]),
        "peak_tau_r": float(seen[PEAK_R]),
        "effort_u": float(seen[EFFORT_U]),
        "effort_r": float(seen[EFFORT_R]),
        "energy": float(seen[ENERGY]),
        "tv_tau_u": float(seen[TV_U]),
        "tv_tau_r": float(seen[TV_R]),
        "saturated_fraction": float(seen[SATURATED] / total) if total else math.nan,
    }


def summarise_many(seen: Vector, step: float) -> dict[str, Vector]:
    """Metrics by name, one number a run, from rows of what was gathered (`Batch.seen`).

    NaN where a run ended before a metric is defined, and throughout for one that never began.
    """
    each = [summarise(row, step) for row in seen]
    names = summarise(np.full(SIZE, np.nan), step)
    return {name: np.array([metrics[name] for metrics in each]) for name in names}
