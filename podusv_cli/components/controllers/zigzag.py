"""The zig-zag: steering is reversed whenever the heading has changed by as much to its side."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

from podusv_cli.components.controllers.base import Slots, Trial
from podusv_cli.components.controllers.manoeuvre import Manoeuvre, steered
from podusv_cli.core.component import value
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal

SIDE = Signal("side", "1", "side to which the trial steers: 1 starboard, -1 port, 0 before it")
HEADING = Signal("psi_0", "rad", "heading at which the trial began", r"\psi_0")
MEMORY = ((SIDE, 1), (HEADING, 1))


class Zigzag(Manoeuvre):
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
        0.01, "s", "time between two looks at the heading, a whole number of steps", gt=0
    )

    def slots(self) -> Slots:
        """The side, and the heading of the approach."""
        return MEMORY

    def trial(self) -> Trial:
        """With the change of heading at which steering is reversed."""
        return Trial(self.execute, self.switch)

    def sample_period(self) -> float:
        """As often as the heading is looked at."""
        return self.check_every

    @staticmethod
    @kernel
    def sample(t: float, x: Vector, memory: Vector, k: Any) -> None:
        """Begin, or reverse."""
        if t >= k.execute and memory[0] == 0.0:
            memory[0], memory[1] = 1.0, x[2]
        if memory[0] * (x[2] - memory[1]) >= k.switch:
            memory[0] = -memory[0]

    @staticmethod
    @kernel
    def law(memory: Vector, k: Any, tau: Vector, rate: Vector, signals: Vector) -> None:
        """At the angle, to the side of the moment."""
        steered(memory[0] * k.angle, k, tau, signals)
        rate[0] = rate[1] = 0.0
