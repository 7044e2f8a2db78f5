"""The finding that a vessel swings about its target by itself, for ever."""

from __future__ import annotations

import numpy as np

from podusv_cli.core.finding import Mask, Sentences, warn_after_run
from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording
from podusv_cli.core.spectrum import periodogram
from podusv_cli.findings.span import steady_rows
from podusv_cli.scenario.model import Scenario

VISIBLE = 0.01  # hull lengths; a smaller swing is no finding
PERIODS = 3  # fewer of them in the steady window do not show that a swing goes on
PURE = 0.5  # share of a swing's mean square at one frequency
DECAY = 0.95  # of the amplitude from one half of the window to the other; less is dying away
FORCED = 0.1  # of the accelerations; loads of that size may drive them
SPREAD = 2  # harmonics to either side of a line that Hann's window and a broken period reach


@warn_after_run(
    "limit-cycle",
    about="controller",
    meaning="the vessel swings about its target for ever",
    condition=f"{PERIODS} periods or more of a swing above {VISIBLE:.0%} of a hull length in the "
    "steady window, which neither dies away nor follows a load or the target",
    remedy="take smaller gains; see whether a delay, a limit or the hull's sway drives it",
)
def limit_cycle(scenario: Scenario, log: Recording) -> Sentences:
    """The distance along or across the target's course swings at one frequency, and goes on."""
    late = steady_rows(scenario, log)
    # Fewer rows than eight a period show no frequency.
    if log.status != "finished" or late.sum() < 8 * PERIODS or not scenario.controller.aims():
        return
    time, x, y = (log[name][late] for name in ("time", "x", "y"))
    errors = _rotate_to_course(x - log["x_d"][late], y - log["y_d"][late], _course(log, late))
    # The direction in which it swings more.
    name, swing = max(
        zip(("along", "across"), errors, strict=True), key=lambda part: float(part[1].std())
    )
    _, power = periodogram(time, swing)
    at, half = int(np.argmax(power)), len(swing) // 2
    near = slice(max(0, at - SPREAD), at + SPREAD + 1)
    earlier, size = (0.5 * float(np.ptp(part)) for part in (swing[:half], swing[half:]))
    # The n-th harmonic has n periods in the window.
    pure = at >= PERIODS and power[near].sum() >= PURE * power.sum()
    visible = size >= VISIBLE * scenario.vessel.length
    if pure and visible and size >= DECAY * earlier and not _is_forced(scenario, log, late, near):
        # Two crossings of the mean a period, more exact than the harmonic's frequency.
        crossings = time[np.flatnonzero(np.diff(np.signbit(swing - swing.mean())))]
        period = 2.0 * (crossings[-1] - crossings[0]) / (len(crossings) - 1)
        yield (
            f"the vessel swings {name} the target's course with an amplitude of {size:.3g} m and a "
            f"period of {period:.3g} s over the whole steady window; no load has that period, so "
            "this is a limit cycle; take smaller gains, and see whether a delay, a limit or the "
            "hull's sway drives it"
        )


def _is_forced(scenario: Scenario, log: Recording, rows: Mask, near: slice) -> bool:
    """Whether loads, or turns of the target, at these harmonics are large enough for the swing.

    `rows` (n,) are those of the steady window, `near` the harmonics around the swing's. Mean
    squares of b/sqrt(m), for loads b and inertias m of the three axes, are compared with those of
    sqrt(m) a for the accelerations a: a free hull would answer the loads with just these. Loads
    that follow from the swing itself, as in a current, are far smaller.
    """
    hull, time = scenario.vessel, log["time"][rows]

    def mean_square(numbers: Vector) -> float:
        return float(periodogram(time, numbers)[1][near].sum())

    axes = zip((hull.m11, hull.m22, hull.m33), ("u", "v", "r"), strict=True)
    motion = load = 0.0
    for inertia, axis in axes:
        motion += inertia * mean_square(np.gradient(log[axis][rows], time))
        load += mean_square(log[f"b_{axis}"][rows]) / inertia
    x, y = (np.gradient(np.gradient(log[name][rows], time), time) for name in ("x_d", "y_d"))
    load += hull.m11 * sum(map(mean_square, _rotate_to_course(x, y, _course(log, rows))))
    return load > FORCED**2 * motion


def _course(log: Recording, rows: Mask) -> Vector:
    """The target's course [rad] in these rows; 0 where it stands still."""
    return np.arctan2(np.gradient(log["y_d"][rows]), np.gradient(log["x_d"][rows]))


def _rotate_to_course(x: Vector, y: Vector, course: Vector) -> tuple[Vector, Vector]:
    """A vector (x, y) in the earth's frame as along and across a course [rad]; each (rows,)."""
    cosine, sine = np.cos(course), np.sin(course)
    return x * cosine + y * sine, y * cosine - x * sine
