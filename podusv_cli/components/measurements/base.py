"""What every kind of measurement offers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import ClassVar

import numpy as np

from podusv_cli.core.component import KernelPart
from podusv_cli.core.kernel import Vector, absent
from podusv_cli.core.signal import STATE, Signal

# Where `seen` has, for each of the six quantities of the vessel's state: the value that was
# delivered last, whether one was delivered at this instant, whether it is measured at all.
VALUE, FRESH, KNOWN, OWN = 0, len(STATE), 2 * len(STATE), 3 * len(STATE)


class Measurement(KernelPart):
    """What is measured of the vessel's state, and how well.

    `sense(t, instant, x, b, k, table, seen)` is a kernel that is called at every instant of the
    run: at time t [s], the instant's number, the true state x = (x, y, psi, u, v, r) and the
    disturbance's numbers b. It updates `seen`: six values, six marks of those delivered at this
    instant, six marks of those measured at all, then whatever it has to remember.
    """

    noun: ClassVar[str] = "measurement"

    is_exact: ClassVar[bool] = False  # the law is given the state itself, and nothing is called

    @property
    def signals(self) -> tuple[Signal, ...]:
        """The measured values that are logged, in the order of the state."""
        return ()

    sense: ClassVar[Callable[..., None]] = staticmethod(absent("sense"))

    def measured(self) -> tuple[bool, ...]:
        """Which of x, y, psi, u, v, r are measured."""
        return (True,) * len(STATE)

    def outages_of_each(self) -> tuple[tuple[tuple[float, float], ...], ...]:
        """Times [from, to] [s] without samples, of each of x, y, psi, u, v, r."""
        return ((),) * len(STATE)

    def noise_of_each(self) -> tuple[float, ...]:
        """Standard deviation of the errors of each of x, y, psi, u, v, r."""
        return (0.0,) * len(STATE)

    def delay_of_position(self) -> float:
        """Age of a position when it is delivered [s]."""
        return 0.0

    def age(self) -> float:
        """Mean age of the heading that the law sees [s]."""
        return 0.0

    def constants_with(self, step: float, motion: int) -> dict[str, float]:
        """Its constants `k`, for a run with this step [s].

        `motion` is where `b` has the wave motion that sensors see on top of each of the six
        quantities of the state; 0: nowhere.
        """
        return self.constants()

    def table_for(self, step: float, steps: int) -> Vector:
        """Its table, for a run of so many steps; noise is a function of seed and sample."""
        return self.table()

    def shared_places(self) -> list[int]:
        """Places in the table that all runs side by side have to share; its kernel's `shared`."""
        return []

    def first(self, start: Vector, step: float) -> Vector:
        """What is seen before anything has been delivered: the state `start` (6,), then marks.

        Laid out as `VALUE`, `FRESH`, `KNOWN`: nothing is fresh.
        """
        marks = np.concatenate([np.zeros(len(STATE)), np.array(self.measured(), float)])
        return np.concatenate([start, marks])

    def conflicts(self, step: float) -> Iterator[tuple[str, str]]:
        """Key below `measurement` and message for what does not fit the step [s]."""
        return iter(())
