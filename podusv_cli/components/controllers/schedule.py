"""A demand that is given over time, and a feedback that holds the vessel to the motion it makes."""

from __future__ import annotations

import math
import re
from functools import lru_cache
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import field_validator, model_validator

from podusv_cli.components.actuators.recorded import NOUN, Recorded
from podusv_cli.components.controllers.base import Controller
from podusv_cli.core.component import value
from podusv_cli.core.interpolation import cubic, linear, segment
from podusv_cli.core.kernel import Vector, kernel, tail
from podusv_cli.core.kinematics import wrap
from podusv_cli.core.signal import Signal
from podusv_cli.core.timed_rows import lines_of, named_rows, timed_rows

TIMED, STATES = 3, 6  # numbers of a row: time and demand; then the state, then the gains
WITH_SWAY = TIMED + 1  # or time and a demand with a sway force
WITH_MOTION = TIMED + STATES + 2 * STATES
WITH_BOTH = WITH_SWAY + STATES + 3 * STATES
DEMAND = ("t [s]", "tau_u [N]", "tau_r [N m]")
MOTION = ("x [m]", "y [m]", "psi [rad]", "u [m/s]", "v [m/s]", "r [rad/s]")
LAYOUTS = {
    TIMED: DEMAND,
    WITH_SWAY: (*DEMAND, "tau_v [N]"),
    WITH_MOTION: (*DEMAND, *MOTION, "then the gains of tau_u and tau_r"),
    WITH_BOTH: (*DEMAND, "tau_v [N]", *MOTION, "then the gains of all three"),
}
NUMBERED = re.compile(r".*_[0-9]+( *\[.*\])?")  # a column of one propeller or pod
FULL = 3  # demands of a row with a sway force
HOLD = 1.0  # the place of "hold" among the choices of `between`, as kernels know it
# Numbers of a row of the table: demand, state and its rate, gains (surge, yaw, sway).
FOLLOWING, FOLLOWING_FULL = 2 + 2 * STATES + 2 * STATES, FULL + 2 * STATES + 3 * STATES
FEEDBACK_U = Signal("feedback_u", "N", "surge force that departures from the scheduled motion add")
FEEDBACK_R = Signal("feedback_r", "N m", "yaw moment that departures from the motion add")


@lru_cache(maxsize=4)
def _read_recorded(text: str, *, held: bool) -> Recorded | None:
    """Commands to single propellers, which the header has by number, as `n_1`; None for demands.

    `held`: between rows the last one's commands.
    """
    header, _ = lines_of(text)
    numbered = any(NUMBERED.fullmatch(cell) for cell in header.cells) if header else False
    return Recorded(text, held) if numbered else None


@lru_cache(maxsize=4)  # one schedule is read a dozen times in a run
def _rows(text: str) -> Vector:
    """The numbers in lines with commas (rows, columns), the heading continuous.

    Raises ValueError. Recorded commands are for the actuator to read: their demand is 0.
    """
    if _read_recorded(text, held=False):
        rows = named_rows(text, NOUN).rows[:, [0, 0, 0]] * [1.0, 0.0, 0.0]
    else:
        rows = timed_rows(text, NOUN, LAYOUTS)
    if rows.shape[1] >= WITH_MOTION:
        # The heading, third of the state: a cubic over a jump by 2 pi would turn the vessel round
        psi = (WITH_SWAY if rows.shape[1] == WITH_BOTH else TIMED) + 2
        rows[:, psi] = np.unwrap(rows[:, psi])
    # The cache hands the same rows to every run
    rows.flags.writeable = False
    return rows


class Schedule(Controller):
    """Repeats a motion from a file, with feedback to it where the file has gains.

    tau(t) = tau_s(t) + K(t) (x_s(t) - x), of which the rows give tau_s, x_s and K.

    Rows of three numbers (t, tau_u, tau_r) have no x_s: then there is no feedback. Nor have rows of
    four, which ask for a sway force, too: (t, tau_u, tau_r, tau_v). With x_s and K such rows have
    28 numbers; what the feedback adds to the sway force is no signal. A hull that does
    not keep its course by itself needs feedback to repeat a motion: every rounding error grows.
    Demand and gains are straight lines between rows, x_s a cubic. Before the first and after the
    last row the nearest row holds.

    Rows of t and commands (n_1 or n_cmd_1 [1/s], delta_1 or delta_cmd_1 [rad] and so on: speed and
    angle of every pod) go to the pods themselves, in place of what an allocation makes of a demand.
    Lags, rates and limits act as always, a delay of commands does not; the demand is logged as 0.
    Nothing aims at the target then, so there is no distance to it.
    """

    kind: Literal["schedule"] = "schedule"
    texts_of: ClassVar[dict[str, str]] = {"file": "rows"}
    signals: ClassVar[tuple[Signal, ...]] = (FEEDBACK_U, FEEDBACK_R)
    file: str | None = value(None, "", "CSV file beside the scenario; its text is read into `rows`")
    rows: str = value(
        "",
        "",
        "lines of t [s], tau_u [N], tau_r [N m]; or of these and tau_v [N], of an actuator that "
        "takes a sway force; or of these three or four, the state x, y, psi, u, v, r "
        "and the gains from its errors, six of each force and moment; or of t and the commands "
        "of every pod, such as n_1 [1/s] and delta_1 [rad] of the first",
    )
    between: Literal["linear", "hold"] = value(
        "linear", "", "demand or commands between rows: a straight line, or the last row's"
    )
    minimises: Literal["nothing", "iae", "ise"] = value(
        "nothing", "", "the metric of which the motion is an optimum, where it is one"
    )

    @field_validator("rows")
    @classmethod
    def _readable(cls, rows: str) -> str:
        """The text as it is. Raises ValueError where it cannot be read as rows."""
        _rows(rows)
        return rows

    @model_validator(mode="after")
    def _check_content(self) -> Self:
        """Raises ValueError where no file is named."""
        if not self.rows:
            raise ValueError("file is missing; name a CSV file with columns t, tau_u, tau_r")
        return self

    def asks_sway(self) -> bool:
        """Whether its demand has a sway force: where the rows have one."""
        return _rows(self.rows).shape[1] in (WITH_SWAY, WITH_BOTH)

    def commands(self) -> Recorded | None:
        """The rows, where their columns are commands to propellers; None for demands."""
        return _read_recorded(self.rows, held=self.between == "hold")

    def optimum_of(self) -> str:
        """The metric that its motion minimises, as `minimises` says; empty for `nothing`."""
        return "" if self.minimises == "nothing" else self.minimises

    def constants(self) -> dict[str, float]:
        """The fields' choices, how many rows there are, and how many numbers in each of them."""
        rows, columns = _rows(self.rows).shape
        motion = {WITH_MOTION: FOLLOWING, WITH_BOTH: FOLLOWING_FULL}
        width = motion.get(columns, columns - 1)
        return super().constants() | {"rows_count": float(rows), "row_width": float(width)}

    def table(self) -> Vector:
        """The times (rows,) [s], then flat rows: demand; with a motion also state, rate, gains."""
        times, given = np.split(_rows(self.rows), [1], axis=1)
        if given.shape[1] < WITH_MOTION - 1:
            return np.concatenate([times.ravel(), given.ravel()])
        demand, motion = np.split(given, [FULL if self.asks_sway() else TIMED - 1], axis=1)
        state, gains = np.split(motion, [STATES], axis=1)
        rates = np.gradient(state, times.ravel(), axis=0)  # slopes of the cubics between rows
        return np.concatenate([times.ravel(), np.hstack([demand, state, rates, gains]).ravel()])

    # t [s], x (6), table as `table` lays it out; writes tau (2, or 3 with a sway force) and signals
    # (2). The width of a row tells what it has: demand alone, a motion with gains, either with a
    # sway force. `state` is where a row has the motion, and `g` where the surge gain of state j
    # stands.
    @staticmethod
    @kernel
    def law(t: float, x: Vector, k: Any, table: Vector, tau: Vector, signals: Vector) -> None:
        """The demand at t, and what the state's errors add."""
        count, width = int(k.rows_count), int(k.row_width)
        i = min(segment(t, count, table), count - 2)
        length = table[i + 1] - table[i]
        s = min(max((t - table[i]) / length, 0.0), 1.0)
        a, b = tail(table, count + width * i), tail(table, count + width * (i + 1))
        held = math.floor(s) if k.between == HOLD else s
        tau[0], tau[1] = linear(held, a[0], b[0]), linear(held, a[1], b[1])
        state = 2  # where a row has it, behind the demand
        if width == FULL or width > FOLLOWING:
            state = FULL
            tau[2] = linear(held, a[2], b[2])
        signals[0] = signals[1] = 0.0
        if width >= FOLLOWING:
            for j in range(STATES):
                before, after = tail(a, state + j), tail(b, state + j)
                there = cubic(s, length, before[0], after[0], before[STATES], after[STATES])
                error = wrap(there - x[j]) if j == 2 else there - x[j]
                g = state + 2 * STATES + j
                signals[0] += linear(s, a[g], b[g]) * error
                signals[1] += linear(s, a[g + STATES], b[g + STATES]) * error
                if width > FOLLOWING:
                    tau[2] += linear(s, a[g + 2 * STATES], b[g + 2 * STATES]) * error
        tau[0] += signals[0]
        tau[1] += signals[1]
