"""The paper's path (53): a straight line, then a curve that can be read in three ways."""

from __future__ import annotations

import math
from typing import Any, Literal

from podusv_cli.components.paths.base import Break, Path
from podusv_cli.components.paths.circle import on_circle
from podusv_cli.core.component import value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel

LITERAL, VELOCITY, SINE = range(3)


# The line up to the switch; writes target (6), as `circle.on_circle` does.
@kernel
def _straight(t: float, k: Any, target: Vector) -> None:
    target[0] = k.speed * t
    target[1] = 0.0
    target[2] = k.speed
    target[3] = target[4] = target[5] = 0.0


# Path (53) as printed, `s` [s] after the switch: a circle about the line's end, onto which the
# target jumps. Writes target (6).
@kernel
def _literal(s: float, k: Any, target: Vector) -> None:
    on_circle(k.amplitude, k.rate * s, k.rate, target)
    target[0] += k.speed * k.switch


# Path (53) read as the target's velocity; `s` [s] is the time since the switch. Writes target (6).
@kernel
def _velocity(s: float, k: Any, target: Vector) -> None:
    # The printed cosine and sine taken as speeds: a circle of radius amplitude/rate to port or
    # starboard of the line's end, which it leaves in the line's direction.
    radius = k.amplitude / k.rate
    on_circle(radius, k.rate * s - 0.5 * math.pi, k.rate, target)
    target[0] += k.speed * k.switch
    target[1] += radius


# Only the second printed component, as a swing across the line that goes on; `s` [s] as above.
# Writes target (6).
@kernel
def _sine(s: float, k: Any, target: Vector) -> None:
    _straight(k.switch + s, k, target)
    cosine, sine = cos_sin(k.rate * s)
    target[1] = k.amplitude * sine
    target[3] = k.amplitude * k.rate * cosine
    target[5] = -k.amplitude * k.rate * k.rate * sine


class LineCircle(Path):
    """North along the x-axis until `switch`, then the second branch of (53) in one `reading`.

    literal: the printed positions, a jump to a circle of radius `amplitude` that is crept along;
    velocity: the printed terms are the target's velocity, a circle of radius amplitude/rate;
    sine: the x-speed stays constant, as the paper's text says, and y is a sine.
    """

    kind: Literal["line_circle"] = "line_circle"
    reading: Literal["literal", "velocity", "sine"] = value(
        "velocity", "", "how the second branch of (53) is read"
    )
    speed: float = value(0.5, "m/s", "speed on the straight part", ge=0)
    switch: float = value(100.0, "s", "end of the straight part", ge=0)
    amplitude: float = value(
        0.5, "m or m/s", "the factor 0.5 of the second branch: m/s in `velocity`, else m", gt=0
    )
    rate: float = value(0.03, "rad/s", "angular rate of the second branch", gt=0)

    # t [s]; writes target (6), as `circle.on_circle` does.
    @staticmethod
    @kernel
    def evaluate(t: float, k: Any, target: Vector) -> None:
        """Path (53)."""
        if t <= k.switch:
            _straight(t, k, target)
        elif k.reading == LITERAL:
            _literal(t - k.switch, k, target)
        elif k.reading == VELOCITY:
            _velocity(t - k.switch, k, target)
        else:
            _sine(t - k.switch, k, target)

    def breaks(self) -> tuple[Break, ...]:
        """The switch, with the lowest derivative that jumps there.

        Read as a velocity of the line's own size, the target only begins to turn.
        """
        smooth = self.reading == "velocity" and self.amplitude == self.speed
        gentle: Literal["velocity", "acceleration"] = "acceleration" if smooth else "velocity"
        return (Break(self.switch, "position" if self.reading == "literal" else gentle),)
