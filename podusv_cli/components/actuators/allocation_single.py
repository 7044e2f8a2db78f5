"""Allocation for one pod on the centre line, in closed form."""

from __future__ import annotations

import math

from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.kinematics import direction

YAW = 0.0


@kernel
def within(number: float, low: float, high: float) -> float:
    """The nearest number between low and high."""
    return min(max(number, low), high)


# Writes out (2): thrust [N], angle [rad]. All is turned by `side` first, so that thrust astern is a
# force ahead in the mirrored plane. Yaw first: across is cut at the most that the sector gives,
# then along follows. Surge first: along is cut at the arc, then across. `priority` is YAW or else
# surge.
@kernel
def one_pod(
    X: float,
    Y: float,
    low: float,
    high: float,
    most_astern: float,
    most_ahead: float,
    priority: float,
    out: Vector,
) -> None:
    """Thrust [N] and angle [rad] for the force (X, Y) [N] at the pod, into `out`.

    Angles reach from `low` to `high`, inside a right angle to either side; thrust from
    -`most_astern` to `most_ahead`. X < 0 is done by thrust astern, not by turning the pod round.
    Out of reach, `priority` says which of Y (the yaw moment) and X is met as far as can be; the
    other comes as near as that leaves it.
    """
    side = 1.0 if X >= 0.0 else -1.0
    most = most_ahead if X >= 0.0 else most_astern
    along, across = side * X, side * Y
    cos_low, sin_low = cos_sin(low)
    cos_high, sin_high = cos_sin(high)
    tan_low, tan_high = sin_low / cos_low, sin_high / cos_high
    if priority == YAW:
        across = within(across, min(0.0, most * sin_low), max(0.0, most * sin_high))
        along = _along_beside(along, across, tan_low, tan_high, most)
    else:
        cosine, _ = cos_sin(within(0.0, low, high))
        along = min(along, most * cosine)
        room = math.sqrt(max(0.0, most * most - along * along))
        least = max(along * tan_low, -room)
        across = within(across, least, min(along * tan_high, room))
    out[0] = side * math.sqrt(along * along + across * across)
    out[1] = within(direction(along, across), low, high)


# Forces in N, ahead of the pod and to starboard, `most` [N] the radius of the sector between the
# edges with these tangents. An edge on the same side as `across` is the steeper bound; where both
# edges lie on the other side of a force of 0 across, only 0 is left.
@kernel
def _along_beside(
    along: float, across: float, tan_low: float, tan_high: float, most: float
) -> float:
    """The nearest force along that the sector allows beside this force across."""
    least, largest = 0.0, math.sqrt(max(0.0, most * most - across * across))
    if across > 0.0:
        least = across / tan_high
        if tan_low > 0.0:
            largest = min(largest, across / tan_low)
    if across < 0.0:
        least = across / tan_low
        if tan_high < 0.0:
            largest = min(largest, across / tan_high)
    if across == 0.0 and (tan_low > 0.0 or tan_high < 0.0):
        largest = 0.0
    return within(along, least, max(least, largest))
