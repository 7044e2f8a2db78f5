"""Numbers of manoeuvring trials, defined as in the IMO's resolution MSC.137(76), annex 4.2."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.interpolation import linear, passing_place
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.metrics.metric import Accumulator, Measured, Metric
from podusv_cli.metrics.windows import NEAR

# Positions of what is gathered: where the trial begins, and the way since then with the time, speed
# and place of the instant before; then what the trial has led to, and more of the instant before.
BEGUN, X_0, Y_0, PSI_0, WAY, LATEST, SPEED, X, Y, OWN = range(10)
ADVANCE, TRANSFER, TACTICAL, STEADY, CHANGED, ALONG, ACROSS, TURNED = range(OWN, OWN + 8)
PHASE, LARGEST, INITIAL, FIRST, SECOND, RATE, REACHED, ZIGZAGGED = range(OWN, OWN + 8)
TRACK, HEAD, STOPPED, SURGE, AHEAD, STILL = range(OWN, OWN + 6)


# s (states); seen is laid out as above. WAY [m] is the length of the track since.
@kernel
def begin(t: float, s: Vector, k: Any, seen: Vector) -> bool:
    """Whether the trial is under way; notes the state at its start."""
    if t <= k.trial_execute - NEAR:
        return False
    if seen[BEGUN] == 0.0:
        seen[BEGUN], seen[X_0], seen[Y_0], seen[PSI_0] = 1.0, s[0], s[1], s[2]
    else:
        x, y = s[0] - seen[X], s[1] - seen[Y]
        seen[WAY] += math.sqrt(x * x + y * y)
    seen[SPEED] = math.sqrt(s[3] * s[3] + s[4] * s[4])
    seen[X], seen[Y] = s[0], s[1]
    return True


# share of the step [1], t [s], before [m/s]; seen has the way and time of the last instant. In m.
# The speed changes linearly over a step, so the mean of both ends serves.
@kernel
def last_part(share: float, t: float, before: float, seen: Vector) -> float:
    """Of the way of the last step what lies beyond a share of it; `before` is the speed before."""
    at = linear(share, before, seen[SPEED])
    return float(0.5 * (at + seen[SPEED]) * (1.0 - share) * (t - seen[LATEST]))


# Arguments as those of `spans.all_kernels`; changes `seen`. The numbers at 90 and 180 deg lie on
# straight lines between the two instants around them.
@kernel
def watch_turn(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Gather the way along and across the approach at turns by 90 and 180 degrees."""
    if begin(t, s, k, seen):
        cosine, sine = cos_sin(seen[PSI_0])
        x, y, changed = s[0] - seen[X_0], s[1] - seen[Y_0], s[2] - seen[PSI_0]
        along, across = x * cosine + y * sine, y * cosine - x * sine
        if changed >= 0.5 * math.pi and seen[ADVANCE] == 0.0:
            share = passing_place(0.5 * math.pi, seen[CHANGED], changed)
            seen[ADVANCE] = linear(share, seen[ALONG], along)
            seen[TRANSFER] = linear(share, seen[ACROSS], across)
        if changed >= math.pi and seen[TACTICAL] == 0.0:
            share = passing_place(math.pi, seen[CHANGED], changed)
            seen[TACTICAL] = linear(share, seen[ACROSS], across)
        seen[CHANGED], seen[ALONG], seen[ACROSS] = changed, along, across
        seen[STEADY] = 2.0 * seen[SPEED] / max(abs(s[5]), 1e-12)
        seen[LATEST] = t


# Arguments as those of `spans.all_kernels`; changes `seen`. PHASE counts executes: after an even
# number of reversals the heading goes to starboard.
@kernel
def watch_zigzag(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Gather how far the heading goes on after the second and third execute."""
    before = seen[SPEED]
    if begin(t, s, k, seen):
        side = 1.0 if seen[PHASE] % 2.0 == 0.0 else -1.0
        changed = s[2] - seen[PSI_0]
        # What it went beyond the switch before it turned back is the overshoot. It turns back where
        # the yaw rate passes zero, and the rate is a straight line between two instants.
        beyond = -side * changed
        if seen[RATE] * s[5] < 0.0:
            share = passing_place(0.0, seen[RATE], s[5])
            beyond = max(
                beyond, -side * (changed - 0.5 * (1.0 - share) * s[5] * (t - seen[LATEST]))
            )
        seen[LARGEST] = max(seen[LARGEST], beyond)
        if seen[INITIAL] == 0.0 and changed >= k.trial_switch:
            share = passing_place(k.trial_switch, seen[REACHED], changed)
            seen[INITIAL] = seen[WAY] - last_part(share, t, before, seen)
        seen[LATEST], seen[RATE], seen[REACHED] = t, s[5], changed
        if side * changed >= k.trial_switch:
            if seen[PHASE] == 1.0:
                seen[FIRST] = seen[LARGEST] - k.trial_switch
            if seen[PHASE] == 2.0:
                seen[SECOND] = seen[LARGEST] - k.trial_switch
            seen[PHASE] += 1.0
            seen[LARGEST] = 0.0


# Arguments as those of `spans.all_kernels`; changes `seen`. The hull stops within a step, where the
# surge speed, a straight line over the step, is zero.
@kernel
def watch_stop(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Gather the way until the surge speed passes zero."""
    before, way = seen[SPEED], seen[WAY]
    if begin(t, s, k, seen):
        x, y = s[0] - seen[X_0], s[1] - seen[Y_0]
        cosine, sine = cos_sin(seen[PSI_0])
        ahead = x * cosine + y * sine
        if s[3] <= 0.0 and seen[SURGE] > 0.0:
            share, step = passing_place(0.0, seen[SURGE], s[3]), t - seen[LATEST]
            # The speed is that of sway there, and the way along a parabola between the instants.
            seen[TRACK] = way + 0.5 * share * step * (before + abs(s[4]))
            bend = 0.5 * share * (1.0 - share) * step * (seen[SURGE] - s[3])
            seen[HEAD] = linear(share, seen[AHEAD], ahead) + bend
            seen[STOPPED] = seen[LATEST] + share * step - k.trial_execute
        seen[SURGE] = s[3] if seen[TRACK] == 0.0 else 0.0
        seen[AHEAD], seen[LATEST] = ahead, t


def _sizes(manoeuvre: str, size: int) -> Any:
    """A function of a loop: how many numbers are gathered, `size` in this trial, none in others."""

    def size_of(layout: Measured) -> int:
        """The size in a run of this manoeuvre, else 0."""
        trial = layout.loop.controller.trial()
        return size if trial is not None and trial.manoeuvre == manoeuvre else 0

    return size_of


def _constants(layout: Measured) -> dict[str, float]:
    """When the trial begins [s] and reverses [rad]; {} for no trial."""
    trial = layout.loop.controller.trial()
    return {"trial_execute": trial.execute, "trial_switch": trial.switch} if trial else {}


def _number(
    of: Accumulator, position: int, name: str, unit: str, meaning: str, **words: Any
) -> Metric:
    """The metric `name` [unit] of the number gathered at a position, first in tables.

    NaN where the trial did not get so far: then the number is still 0.
    """
    per = math.degrees(1.0) if unit == "deg" else 1.0
    return Metric(
        name,
        unit,
        meaning,
        of,
        lambda seen, step: per * float(seen[position]) or math.nan,
        place=0,
        headline=True,
        **words,
    )


OF_TURN = Accumulator(watch_turn, _sizes("turning circle", TURNED), _constants)
OF_ZIGZAG = Accumulator(watch_zigzag, _sizes("zig-zag", ZIGZAGGED), _constants)
OF_STOP = Accumulator(watch_stop, _sizes("stopping", STILL), _constants)
_turn, _zigzag, _stop = (partial(_number, of) for of in (OF_TURN, OF_ZIGZAG, OF_STOP))
advance = _turn(
    ADVANCE,
    "advance",
    "m",
    "way along the approach until the heading has changed by 90 deg",
    words="advance",
)
transfer = _turn(
    TRANSFER,
    "transfer",
    "m",
    "way across the approach until the heading has changed by 90 deg",
    words="transfer",
)
tactical_diameter = _turn(
    TACTICAL,
    "tactical_diameter",
    "m",
    "way across the approach until it has changed by 180 deg",
    words="tactical diameter",
)
turning_diameter = _turn(
    STEADY,
    "turning_diameter",
    "m",
    "diameter of the circle at the end, 2 U/|r|",
    words="steady turning diameter",
)
overshoot_1 = _zigzag(
    FIRST, "overshoot_1", "deg", "first overshoot angle of a zig-zag", words="first overshoot"
)
overshoot_2 = _zigzag(
    SECOND, "overshoot_2", "deg", "second overshoot angle of a zig-zag", words="second overshoot"
)
initial_turning = _zigzag(
    INITIAL,
    "initial_turning",
    "m",
    "way until the heading of a zig-zag has first changed by `switch`",
    words="initial turning",
)
track_reach = _stop(
    TRACK,
    "track_reach",
    "m",
    "way from full astern until the surge speed is zero",
    words="track reach",
)
head_reach = _stop(
    HEAD,
    "head_reach",
    "m",
    "way along the approach from full astern until the surge speed is zero",
    words="head reach",
)
stopping_time = _stop(
    STOPPED,
    "stopping_time",
    "s",
    "time from full astern until the surge speed is zero",
    words="stopped after",
)
