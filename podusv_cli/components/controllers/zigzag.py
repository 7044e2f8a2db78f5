"""The zig-zag: steering is reversed whenever the heading has changed by as much to its side."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

from podusv_cli.components.controllers.base import ManoeuvreTrial, Slots, each
from podusv_cli.components.controllers.manoeuvre import SIDE, Steering, has_begun, steer_thrust
from podusv_cli.core.component import value
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal

HEADING = Signal("psi_0", "rad", "heading at which the trial began", r"\psi_0")
NEXT = Signal("next_side", "1", "side to which the trial steers at the end of the step")
LOOKED = Signal("looked", "s", "when the heading was looked at last")
RATE = Signal("r_looked", "rad/s", "yaw rate at that time")
MEMORY = (SIDE, HEADING, NEXT, LOOKED, RATE)
AT_SIDE, AT_HEADING, AT_NEXT, AT_TIME, AT_RATE, SIZE = range(6)  # positions in the memory


# left [rad], side 1 or -1, r [rad/s], t [s]; memory has time and yaw rate of the last instant. The
# yaw rate is taken to change in the next step as in the last; a first guess of the share, by the
# mean rate, is put in once more.
@kernel
def within(left: float, side: float, r: float, t: float, memory: Vector) -> float:
    """After which share of the step the heading will have turned by `left` more; 1 if not in it."""
    step = t - memory[AT_TIME]
    gained = side * (r - memory[AT_RATE])  # yaw rate to that side, over the last step
    turn = step * (side * r + 0.5 * gained)  # to that side, over the next step
    if not 0.0 < left < turn:
        return 1.0
    share = left / turn
    return float(left / (step * (side * r + 0.5 * gained * share)))


class Zigzag(Steering):
    """The angle/switch zig-zag, first to starboard (IMO MSC.137(76): 10/10 and 20/20 deg)."""

    kind: Literal["zigzag"] = "zigzag"
    period_key: ClassVar[str] = "check_every"
    angle: float = value(
        math.radians(10.0), "rad", "angle of the thrust to either side", gt=0, le=0.5 * math.pi
    )
    switch: float = value(
        math.radians(10.0), "rad", "change of heading at which steering is reversed", gt=0
    )
    check_every: float = value(
        0.0,
        "s",
        "time between two looks at the heading, a whole number of steps; 0: steering is "
        "reversed when the heading has changed by `switch`, also within a step",
        ge=0,
    )

    def slots(self) -> Slots:
        """The memory: side, heading of the approach, side at the end of the step, the last look."""
        return each(MEMORY)

    def trial(self) -> ManoeuvreTrial:
        """The zig-zag, with the change of heading at which steering is reversed."""
        return ManoeuvreTrial("zig-zag", self.execute, self.switch)

    def sample_period(self) -> float:
        """Seconds between two looks at the heading."""
        return self.check_every

    # t [s], x (6); changes memory (5). A look at a period finds the heading past `switch`, and
    # reverses at once.
    @staticmethod
    @kernel
    def sample(t: float, x: Vector, memory: Vector, k: Any) -> None:
        """Begin, or reverse.

        Where the heading will have changed by `switch` within the step, as its rate and
        acceleration say, the side of the step is the mean of both: then the impulse of the
        steering is right.
        """
        side = memory[AT_NEXT]
        if side == 0.0 and has_begun(t, k):
            side, memory[AT_HEADING] = 1.0, x[2]
        memory[AT_SIDE] = memory[AT_NEXT] = side
        left = k.switch - side * (x[2] - memory[AT_HEADING])
        share = within(left, side, x[5], t, memory) if k.check_every == 0.0 else 1.0
        if side != 0.0 and (left <= 0.0 or share < 1.0):
            memory[AT_NEXT] = -side
            memory[AT_SIDE] = side * (2.0 * share - 1.0) if left > 0.0 else -side
        memory[AT_TIME], memory[AT_RATE] = t, x[5]

    # memory and rate (5); writes tau (2) [N, N m] and signals[0], the angle [rad]. The memory
    # changes at samples alone.
    @staticmethod
    @kernel
    def law(memory: Vector, k: Any, tau: Vector, rate: Vector, signals: Vector) -> None:
        """At the angle, to the side of the moment."""
        steer_thrust(k.angle if memory[AT_NEXT] != 0.0 else 0.0, memory[AT_SIDE], k, tau, signals)
        for i in range(SIZE):
            rate[i] = 0.0
