"""The steady motion of a target: straight on or in a circle, at constant speed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from podusv_cli.components.paths.base import Path
from podusv_cli.core.errors import NotConvergedError
from podusv_cli.core.kernel import Vector
from podusv_cli.core.signal import PSI_D

INSTANTS = 1000  # of a run, among which a steady motion of the target is looked for
NEAR = 1.0  # s before and after an instant, over which the target's motion is compared
ALIKE = 1e-6  # of the target's speed; a larger change is one
STRAIGHT = 1e-9  # rad/s


@dataclass(frozen=True)
class Course:
    """A target's steady motion at a time [s]: position, velocity, rate of turn [rad/s].

    A target with a heading turns it as its course does, and one that stays does not turn.
    """

    time: float
    position: Vector
    velocity: Vector
    turn: float

    @property
    def speed(self) -> float:
        """The target's speed [m/s]."""
        return math.hypot(*self.velocity)


def course(path: Path, duration: float, at: float | None = None) -> Course:
    """The target's steady motion `at` a time [s], or at the last time where there is one.

    `duration` [s] is that of the run. A straight line is preferred to a circle. Raises
    NotConvergedError where there is none.
    """
    times = np.linspace(0.0, duration, INSTANTS + 1)[::-1] if at is None else [at]
    steady = [point for point in (_course(path, float(t)) for t in times) if point]
    straight = [point for point in steady if abs(point.turn) < STRAIGHT]
    if not steady:
        when = "at no time of the run" if at is None else f"not at t = {at:g} s"
        raise NotConvergedError(
            f"the target moves steadily (straight on or in a circle, at constant speed) {when}, "
            "and margins are those of a steady motion; choose another time with --at SECONDS, or "
            f"another path, as with --set path.kind={'hold' if path.heads else 'line'}"
        )
    return (straight or steady)[0]


def _course(path: Path, t: float) -> Course | None:
    """The motion at t [s], where it is steady from NEAR before to NEAR after it, as laws see it.

    None where it is not. A fillet changes what laws see half its duration before and after a
    corner.
    """
    fillet = path.fillet_for_law()
    near = NEAR + (0.5 * fillet.time if fillet else 0.0)
    now, *around = rows = path.whole_targets([t, max(t - near, 0.0), t + near])
    (x, y), (ahead, across) = now[2:4], now[4:6]  # velocity [m/s] and acceleration [m/s2]
    # A target that stays does not turn, and leaves nothing to divide by
    turn = (x * across - y * ahead) / max(x * x + y * y, 1e-300)
    if path.heads and abs(rows[:, PSI_D + 1 :] - (turn, 0.0)).max() > STRAIGHT:
        return None
    for sign, other in zip((-min(t, near), near), around, strict=True):
        angle = turn * sign
        cosine, sine = math.cos(angle), math.sin(angle)
        # What velocity and acceleration are there if the target goes on turning at this rate
        same = (x * cosine - y * sine, y * cosine + x * sine, -turn * y, turn * x)
        changed = [*(other[2:4] - same[:2]), *(now[4:6] - same[2:])]
        if max(map(abs, changed)) > ALIKE * max(math.hypot(x, y), ALIKE):
            return None
    return Course(t, now[:2], now[2:4], turn)
