"""Metrics of a heading that is asked for, and of poses at which the target stays."""

from __future__ import annotations

import math
from typing import Any

from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.kinematics import wrap
from podusv_cli.core.signal import PSI_D
from podusv_cli.engine.step.layout import DISTANCE
from podusv_cli.metrics.metric import Accumulator, Measured, Metric, add, gathered

TIME, SQUARE, INTEGRALS = range(3)
LARGEST, CIRCLE, STAYED, STAYING, ARRIVED, INSIDE, SINCE, LONGEST, MISSED = range(
    2 * INTEGRALS, 2 * INTEGRALS + 9
)
SIZE = MISSED + 1
STANDS = (2, 3, 4, 5, PSI_D + 1, PSI_D + 2)  # what is 0 of a target that stays


# Arguments as those of `spans.all_kernels`; changes `seen`. A stay begins when all rates of the
# target are 0 and ends when one is not; SINCE is when the vessel last came within the radius. A
# pose that was left before the vessel came counts as MISSED.
@kernel
def watch(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Gather the heading error, and at poses the distance and when it came within the radius."""
    off, z_e = wrap(s[2] - row[PSI_D]), row[DISTANCE]
    add(seen, INTEGRALS, TIME, weight)
    add(seen, INTEGRALS, SQUARE, weight * off * off)
    seen[LARGEST] = max(seen[LARGEST], abs(off))
    moves = 0.0
    for at in STANDS:
        moves += abs(row[at])
    if moves == 0.0:
        if seen[STAYING] == 0.0:
            seen[STAYED], seen[STAYING], seen[ARRIVED], seen[INSIDE] = 1.0, 1.0, t, 0.0
        seen[CIRCLE] = max(seen[CIRCLE], z_e)
        if z_e > k.settling_radius:
            seen[INSIDE] = 0.0
        elif seen[INSIDE] == 0.0:
            seen[INSIDE], seen[SINCE] = 1.0, t
    elif seen[STAYING] > 0.0:
        seen[STAYING] = 0.0
        if seen[INSIDE] > 0.0:
            seen[LONGEST] = max(seen[LONGEST], seen[SINCE] - seen[ARRIVED])
        else:
            seen[MISSED] = 1.0


def _size(layout: Measured) -> int:
    """How many numbers are gathered in a loop: none without poses to go to."""
    loop = layout.loop
    return SIZE if loop.path.heads and loop.has_target else 0


def _constants(layout: Measured) -> dict[str, float]:
    """The radius [m] within which a pose counts as reached."""
    return {"settling_radius": layout.settling_radius}


def _rms(seen: Vector, step: float) -> float:
    """Root of the mean square over the time; NaN before any time is over."""
    return math.sqrt(seen[SQUARE] / seen[TIME]) if seen[TIME] else math.nan


def _circle(seen: Vector, step: float) -> float:
    """The largest distance at a pose; NaN where the target never stayed."""
    return float(seen[CIRCLE]) if seen[STAYED] else math.nan


def _corner_time(seen: Vector, step: float) -> float:
    """The longest time to a pose, the last one included; NaN where one was not reached."""
    if not seen[STAYED] or seen[MISSED] or (seen[STAYING] and not seen[INSIDE]):
        return math.nan
    last = seen[SINCE] - seen[ARRIVED] if seen[STAYING] else 0.0
    return float(max(seen[LONGEST], last))


OF = Accumulator(watch, _size, _constants, INTEGRALS)
watch_circle = Metric(
    "watch_circle",
    "m",
    "largest z_e while the target stays at a pose",
    OF,
    _circle,
    place=0,
    words="watch circle: largest distance at a pose",
    headline=True,
)
heading_rms = Metric(
    "heading_rms",
    "rad",
    "root of the mean of (psi - heading_d)^2, wrapped",
    OF,
    _rms,
    place=0,
    words="heading error, rms",
    headline=True,
)
corner_time = Metric(
    "corner_time",
    "s",
    "longest time from the target's arrival at a pose until the vessel is within the settling "
    "radius and stays there while the target stays",
    OF,
    _corner_time,
    place=0,
    happens=True,
    words="longest time to a pose",
    headline=True,
)
heading_max = Metric(
    "heading_max",
    "rad",
    "largest |psi - heading_d|, wrapped",
    OF,
    gathered(LARGEST),
    place=0,
    words="heading error, largest",
)
