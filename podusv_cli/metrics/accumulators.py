"""Metrics gathered while a run goes on, so that they see every step whatever the log keeps.

Integrals are trapezoidal on the grid of steps: the engine hands over the weight of each instant.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from podusv_cli.actuators.propeller import DELTA
from podusv_cli.core.kernel import Vector, kernel, tail
from podusv_cli.engine.grid import TimeGrid
from podusv_cli.engine.simulate import ClosedLoop, Observer

# Integrals over time, by position; those of pods last.
(
    TIME, ABSOLUTE, SQUARE, TIMED, STEADY, STEADY_TIME, EFFORT_U, EFFORT_R, ENERGY, SATURATED,
    ENERGY_POD, SPEED, ANGLE, RATE, LAST,
) = range(15)  # fmt: skip
# From LAST on, what the last instant added to each of them; then what is no integral.
NOW, OUTSIDE, PEAK_U, PEAK_R, TV_U, TV_R, LAST_U, LAST_R, SIZE = range(2 * LAST, 2 * LAST + 9)
TRAVEL, LAST_DELTA = SIZE, SIZE + 1  # of pods: way of the angles, every pod's last angle
LIMITS = ("speed_limited", "angle_limited", "rate_limited")


@kernel
def _add(seen: Vector, integral: int, part: float) -> None:
    seen[integral] += part
    seen[LAST + integral] = part


@kernel
def _track(t: float, weight: float, z_e: float, k: Any, seen: Vector) -> None:
    _add(seen, TIME, weight)
    _add(seen, ABSOLUTE, weight * z_e)
    _add(seen, SQUARE, weight * z_e * z_e)
    _add(seen, TIMED, weight * t * z_e)
    seen[NOW] = t
    if z_e > k.settling_radius:
        seen[OUTSIDE] = t
    if t >= k.steady_from:
        opens = seen[STEADY_TIME] == 0.0 and t > 0.0  # half a weight where the window begins
        part = 0.5 * weight if opens else weight
        _add(seen, STEADY, part * z_e)
        _add(seen, STEADY_TIME, part)


@kernel
def _spend(weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    tau = int(k.tau)
    _add(seen, EFFORT_U, weight * row[tau] * row[tau])
    _add(seen, EFFORT_R, weight * row[tau + 2] * row[tau + 2])
    _add(seen, ENERGY, weight * (abs(row[tau] * s[3]) + abs(row[tau + 2] * s[5])))
    if k.saturated >= 0.0:
        _add(seen, SATURATED, weight * row[int(k.saturated)])


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


@kernel
def watch_pods(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """`watch`, and what pods take and do; the vessel's state is followed by speeds and angles."""
    watch(t, weight, s, row, k, seen)
    count, flags = int(k.pods), tail(row, int(k.limits))
    for i in range(3):
        _add(seen, SPEED + i, weight * flags[i])
    seen[LAST + ENERGY_POD] = 0.0
    for i in range(count):
        delta = s[6 + count + i]
        if t > 0.0:
            seen[TRAVEL] += abs(delta - seen[LAST_DELTA + i])
        seen[LAST_DELTA + i] = delta
        part = weight * row[int(k.power) + i] if k.power >= 0.0 else math.nan
        seen[ENERGY_POD] += part
        seen[LAST + ENERGY_POD] += part


def observer(
    loop: ClosedLoop, grid: TimeGrid, *, steady_fraction: float, settling_radius: float
) -> Observer:
    """An observer for `engine.simulate` that gathers what `summarise` needs."""
    plan = loop.layout(grid)
    columns = {
        name: plan.flags + i
        for i, name in reversed([*enumerate(part.name for part in loop.actuator.signals)])
    }
    constants = {
        "steady_from": grid.last_part(steady_fraction),
        "settling_radius": settling_radius,
        "demand": float(plan.demand),
        "tau": float(plan.tau),
        "saturated": float(columns.get("saturated", -1)),
    }
    pods = loop.actuator.states.count(DELTA)
    if not pods:
        return Observer(watch, constants, SIZE)
    constants |= {
        "pods": float(pods),
        "limits": float(columns[LIMITS[0]]),
        "power": float(columns.get("power", -1)),
    }
    return Observer(watch_pods, constants, LAST_DELTA + pods)


def summarise(seen: Vector, step: float) -> dict[str, float]:
    """Metrics by name from what was gathered; NaN where a run ended before one is defined."""
    if seen[LAST + TIME] == 0.0:  # no instant at all
        seen = np.full_like(seen, math.nan)
    whole = _closed(seen, step)
    total, steady = float(whole[TIME]), float(whole[STEADY_TIME])
    inside_from = float(seen[OUTSIDE]) + step if seen[OUTSIDE] >= 0.0 else 0.0
    return {
        "iae": float(whole[ABSOLUTE]),
        "ise": float(whole[SQUARE]),
        "itae": float(whole[TIMED]),
        "rmse": math.sqrt(whole[SQUARE] / total) if total else math.nan,
        "z_e_steady": float(whole[STEADY] / steady) if steady else math.nan,
        "settling_time": inside_from if inside_from < seen[NOW] + 0.5 * step else math.nan,
        "peak_tau_u": float(seen[PEAK_U]),
        "peak_tau_r": float(seen[PEAK_R]),
        "effort_u": float(whole[EFFORT_U]),
        "effort_r": float(whole[EFFORT_R]),
        "energy": float(whole[ENERGY]),
        "tv_tau_u": float(seen[TV_U]) if steady else math.nan,
        "tv_tau_r": float(seen[TV_R]) if steady else math.nan,
        "saturated_fraction": float(whole[SATURATED] / total) if total else math.nan,
    } | (_of_pods(seen, whole) if len(seen) > LAST_DELTA else {})


def _closed(seen: Vector, step: float) -> Vector:
    """The integrals up to the last instant, which counts half.

    The engine gives half a weight at the end of the grid only, so where a run was cut short the
    other half of what its last instant added is taken out again.
    """
    integrals, added = seen[:LAST], seen[LAST : 2 * LAST]
    if seen[NOW] > 0.0 and added[TIME] == 0.5 * step:
        return integrals
    surplus = np.full(LAST, 0.5 * step / added[TIME])
    if added[STEADY_TIME]:  # the settled part may have begun with this instant
        surplus[[STEADY, STEADY_TIME]] = 0.5 * step / added[STEADY_TIME]
    with np.errstate(all="ignore"):  # a run that diverges leaves all numbers
        return np.asarray(integrals - surplus * added)


def _of_pods(seen: Vector, whole: Vector) -> dict[str, float]:
    total = float(whole[TIME])
    parts = [float(whole[i] / total) if total else math.nan for i in (SPEED, ANGLE, RATE)]
    names = ("at_speed_limit", "at_angle_limit", "at_rate_limit")
    return dict(zip(names, parts, strict=True)) | {
        "energy_pod": float(whole[ENERGY_POD]), "angle_travel": float(seen[TRAVEL]),
    }  # fmt: skip


def summarise_many(seen: Vector, step: float) -> dict[str, Vector]:
    """Metrics by name, one number a run, from rows of what was gathered (`Batch.seen`).

    NaN where a run ended before a metric is defined, and throughout for one that never began.
    """
    each = [summarise(row, step) for row in seen]
    names = summarise(np.full(max(SIZE, seen.shape[1]), np.nan), step)
    return {name: np.array([metrics[name] for metrics in each]) for name in names}
