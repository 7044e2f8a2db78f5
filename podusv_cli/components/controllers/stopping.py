"""The stopping trial: thrust astern from a straight approach on, until the hull lies still."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from podusv_cli.components import rules as by
from podusv_cli.components.controllers.base import ManoeuvreTrial, Slots, each
from podusv_cli.components.controllers.manoeuvre import Manoeuvre, has_begun
from podusv_cli.core.component import Rule, Ruled, value
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal

STAGE = Signal("stage", "1", "0 on the approach, 1 with thrust astern, 2 once the hull lies still")


class Stopping(Manoeuvre):
    """Full astern from `execute` on (IMO MSC.137(76)); no thrust once the surge speed is zero."""

    kind: Literal["stopping"] = "stopping"
    rules: ClassVar[dict[str, Rule]] = Manoeuvre.rules | {"astern": by.FORCE}
    astern: Ruled = value(2.0, "N", "thrust astern, a positive number", gt=0)

    def slots(self) -> Slots:
        """The memory: the stage of the trial."""
        return each((STAGE,))

    def trial(self) -> ManoeuvreTrial:
        """The stopping trial, in which nothing is steered."""
        return ManoeuvreTrial("stopping", self.execute)

    # t [s], x (6) state; changes memory (1): 0 ahead, 1 astern, 2 when the hull lies still.
    @staticmethod
    @kernel
    def sample(t: float, x: Vector, memory: Vector, k: Any) -> None:
        """Begin, or end where the hull lies still."""
        if has_begun(t, k) and memory[0] == 0.0:
            memory[0] = 1.0
        if memory[0] == 1.0 and x[3] <= 0.0:
            memory[0] = 2.0

    # memory and rate (1); writes tau (2) [N, N m].
    @staticmethod
    @kernel
    def law(memory: Vector, k: Any, tau: Vector, rate: Vector) -> None:
        """Ahead, astern, or nothing."""
        tau[0] = k.thrust if memory[0] == 0.0 else (-k.astern if memory[0] == 1.0 else 0.0)
        tau[1] = 0.0
        rate[0] = 0.0
