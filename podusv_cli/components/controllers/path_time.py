"""The time at which a law reads its path: a timetable taken for a curve, gone along as it wants.

Source: R. Skjetne, T. I. Fossen and P. V. Kokotovic (2005), as in `maneuvering`: the dynamic task
s' -> v_s, and three updates of s. Here s is the time of a timetable, so v_s is 1, or a speed over
that of the timetable.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal, NamedTuple, Self

from pydantic import model_validator

from podusv_cli.components.controllers.base import Controller
from podusv_cli.components.controllers.pose_errors import PoseErrors
from podusv_cli.core.component import value
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal

PATH_TIME, EXTRA, SPEED = range(3)  # positions in the memory
TIMED = (
    Signal("path_time", "s", "the time at which the law reads the path", "s"),
    Signal("path_extra", "1", "filtered part of its rate that shortens the error", r"\omega"),
    Signal("speed_f", "m/s", "wanted speed along the path, filtered"),
)
ALONG_PATH = (
    Signal("path_rate", "1", "rate of the path's time", r"\dot s"),
    Signal("path_rate_d", "1", "its wanted rate", r"\upsilon_s"),
    Signal("across", "m", "vessel to the right of the path's course", "y_e"),
)
GRADIENT, FILTERED = 1.0, 2.0  # places among the choices of `update`
SLOWEST = 1e-9  # m/s; below it a path stands still, and its time runs as the clock does


class PathTimed(Controller):
    """A law that says at which time its path is read."""

    no_gains: ClassVar[tuple[str, ...]] = ("speed", "speed_after", "speed_change", "speed_lag")
    update: Literal["tracking", "gradient", "filtered"] = value(
        "gradient",
        "",
        "what the path's time does beside its wanted rate: nothing (tracking), it follows the "
        "gradient that shortens the error (gradient), or that behind a lag (filtered)",
    )
    mu: float = value(1.0, "1/m", "gain of the gradient: rate of the path's time a metre", ge=0)
    lag: float = value(1.0, "s", "lag of update: filtered", gt=0)
    speed: float = value(0.0, "m/s", "wanted speed along the path; 0: that of its timetable", ge=0)
    speed_after: float = value(
        0.0, "m/s", "wanted speed from `speed_change` on; 0: as before, with a speed alone", ge=0
    )
    speed_change: float = value(0.0, "s", "when the wanted speed changes", ge=0)
    speed_lag: float = value(5.0, "s", "lag of a change of the wanted speed", gt=0)

    @model_validator(mode="after")
    def _check_speeds(self) -> Self:
        """Raises ValueError for a later speed without a first one."""
        if self.speed == 0.0 and (self.speed_after > 0.0 or self.speed_change > 0.0):
            raise ValueError(
                "has speed_after or speed_change, and no speed before; give `speed`, too, in m/s"
            )
        return self

    def keeps_path_time(self) -> bool:
        """Whether the path is read at the law's own time: always."""
        return True

    def wants_path_speed(self) -> bool:
        """Whether it goes along the path at a speed of its own: where one is given."""
        return self.speed > 0.0


class PathPace(NamedTuple):
    """How the path's time goes on."""

    wanted: float  # v_s
    rate: float  # s' = v_s + w
    wanted_rate: float  # of v_s [1/s]
    extra_rate: float  # of the filtered part [1/s]
    speed_rate: float  # of the filtered speed [m/s2]
    across: float  # m


# t [s]; memory begins with TIMED; a_2 and b_2 [m/s2] are the curve's second derivatives along and
# across the bow. `pace` [m/s] is the curve's speed by its own time, 1 where it stands; v_s is the
# wanted speed over it, so it changes with the pace (`by_s`) and with the wanted speed (`by_t`).
@kernel
def path_pace(t: float, e: PoseErrors, a_2: float, b_2: float, memory: Vector, k: Any) -> PathPace:
    """The wanted rate, how it changes, and what the update adds to it, for a curve by its time."""
    square = e.u_d * e.u_d + e.v_d * e.v_d
    moves = square > SLOWEST * SLOWEST
    pace = math.sqrt(square) if moves else 1.0
    asked = k.speed_after if k.speed_after > 0.0 and t >= k.speed_change else k.speed
    speed_rate = (asked - memory[SPEED]) / k.speed_lag
    slope = k.mu * (e.u_d * e.a + e.v_d * e.b + e.r_d * e.psi) / pace if moves else 0.0
    w = memory[EXTRA] if k.update == FILTERED else (slope if k.update == GRADIENT else 0.0)
    free = k.speed > 0.0 and moves
    v_s = memory[SPEED] / pace if free else 1.0
    by_s = -v_s * (e.u_d * a_2 + e.v_d * b_2) / (pace * pace) if free else 0.0
    by_t = speed_rate / pace if free else 0.0
    return PathPace(
        v_s,
        v_s + w,
        by_s * (v_s + w) + by_t,
        (slope - memory[EXTRA]) / k.lag,
        speed_rate,
        (e.u_d * e.b - e.v_d * e.a) / pace if moves else 0.0,
    )
