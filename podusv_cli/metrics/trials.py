"""Numbers of manoeuvring trials, defined as in the IMO's resolution MSC.137(76), annex 4.2."""

from __future__ import annotations

import math
from typing import Any

from podusv_cli.core.interpolation import linear, passed
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.metrics.metric import Accumulator, Measured, Metric, Result
from podusv_cli.metrics.windows import NEAR

# Positions of what is gathered: where the trial begins, then what it has led to, then the instant
# before: changed heading, way along and across.
BEGUN, X_0, Y_0, PSI_0 = range(4)
ADVANCE, TRANSFER, TACTICAL, STEADY, CHANGED, ALONG, ACROSS, TURNED = range(4, 12)
PHASE, LARGEST, FIRST, SECOND, LATEST, RATE, ZIGZAGGED = range(4, 11)


@kernel
def begin(t: float, s: Vector, k: Any, seen: Vector) -> bool:
    """Whether the trial is under way; notes the state at its start."""
    if t <= k.trial_execute - NEAR:
        return False
    if seen[BEGUN] == 0.0:
        seen[BEGUN], seen[X_0], seen[Y_0], seen[PSI_0] = 1.0, s[0], s[1], s[2]
    return True


@kernel
def watch_turn(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Gather the way along and across the approach at turns by 90 and 180 degrees."""
    if begin(t, s, k, seen):
        cosine, sine = math.cos(seen[PSI_0]), math.sin(seen[PSI_0])
        x, y, changed = s[0] - seen[X_0], s[1] - seen[Y_0], s[2] - seen[PSI_0]
        along, across = x * cosine + y * sine, y * cosine - x * sine
        if changed >= 0.5 * math.pi and seen[ADVANCE] == 0.0:
            share = passed(0.5 * math.pi, seen[CHANGED], changed)
            seen[ADVANCE] = linear(share, seen[ALONG], along)
            seen[TRANSFER] = linear(share, seen[ACROSS], across)
        if changed >= math.pi and seen[TACTICAL] == 0.0:
            share = passed(math.pi, seen[CHANGED], changed)
            seen[TACTICAL] = linear(share, seen[ACROSS], across)
        seen[CHANGED], seen[ALONG], seen[ACROSS] = changed, along, across
        speed = math.sqrt(s[3] * s[3] + s[4] * s[4])
        seen[STEADY] = 2.0 * speed / max(abs(s[5]), 1e-12)


@kernel
def watch_zigzag(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Gather how far the heading goes on after the second and third execute."""
    if begin(t, s, k, seen):
        side = 1.0 if seen[PHASE] % 2.0 == 0.0 else -1.0
        changed = s[2] - seen[PSI_0]
        # What it went beyond the switch before it turned back is the overshoot. It turns back where
        # the yaw rate passes zero, and the rate is a straight line between two instants.
        beyond = -side * changed
        if seen[RATE] * s[5] < 0.0:
            share = passed(0.0, seen[RATE], s[5])
            beyond = max(
                beyond, -side * (changed - 0.5 * (1.0 - share) * s[5] * (t - seen[LATEST]))
            )
        seen[LARGEST] = max(seen[LARGEST], beyond)
        seen[LATEST], seen[RATE] = t, s[5]
        if side * changed >= k.trial_switch:
            if seen[PHASE] == 1.0:
                seen[FIRST] = seen[LARGEST] - k.trial_switch
            if seen[PHASE] == 2.0:
                seen[SECOND] = seen[LARGEST] - k.trial_switch
            seen[PHASE] += 1.0
            seen[LARGEST] = 0.0


def _sizes(turn: int, zigzag: int) -> Any:
    """How many numbers are gathered of each kind of trial."""

    def size(layout: Measured) -> int:
        trial = layout.loop.controller.trial()
        if trial is None:
            return 0
        return zigzag if trial.switch else turn

    return size


def _constants(layout: Measured) -> dict[str, float]:
    trial = layout.loop.controller.trial()
    return {"trial_execute": trial.execute, "trial_switch": trial.switch} if trial else {}


def _reached(position: int) -> Result:
    """The number, NaN where the trial did not get so far."""
    return lambda seen, step: float(seen[position]) or math.nan


OF_TURN = Accumulator(watch_turn, _sizes(TURNED, 0), _constants)
OF_ZIGZAG = Accumulator(watch_zigzag, _sizes(0, ZIGZAGGED), _constants)
advance = Metric(
    "advance", "m", "way along the approach until the heading has changed by 90 deg", OF_TURN,
    _reached(ADVANCE), 8,
)  # fmt: skip
transfer = Metric(
    "transfer", "m", "way across the approach until the heading has changed by 90 deg", OF_TURN,
    _reached(TRANSFER), 8,
)  # fmt: skip
tactical_diameter = Metric(
    "tactical_diameter", "m", "way across the approach until it has changed by 180 deg", OF_TURN,
    _reached(TACTICAL), 8,
)  # fmt: skip
turning_diameter = Metric(
    "turning_diameter", "m", "diameter of the circle at the end, 2 U/|r|", OF_TURN,
    _reached(STEADY), 8,
)  # fmt: skip
overshoot_1 = Metric(
    "overshoot_1", "rad", "first overshoot angle of a zig-zag", OF_ZIGZAG, _reached(FIRST), 8
)
overshoot_2 = Metric(
    "overshoot_2", "rad", "second overshoot angle of a zig-zag", OF_ZIGZAG, _reached(SECOND), 8
)
