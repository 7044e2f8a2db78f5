"""What every disturbance offers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import ClassVar

import numpy as np

from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import KernelPart
from podusv_cli.core.kernel import Vector, absent, bundle, call
from podusv_cli.core.signal import Signal

# First-order motion in waves and its velocity, which sensors see on top of the vessel's state. A
# disturbance that has it declares these six among its `signals`, one behind the other.
WAVE_MOTION = (
    Signal("x_w", "m", "first-order wave motion, north"),
    Signal("y_w", "m", "first-order wave motion, east"),
    Signal("psi_w", "rad", "first-order wave motion in yaw", r"\psi_w"),
    Signal("u_w", "m/s", "velocity of the first-order wave motion, surge"),
    Signal("v_w", "m/s", "velocity of the first-order wave motion, sway"),
    Signal("r_w", "rad/s", "yaw rate of the first-order wave motion"),
)

# The velocity of the water, which actuators receive. A disturbance that has it declares these
# two among its `signals`, one behind the other.
FLOW = (
    Signal("V_c", "m/s", "speed of the current"),
    Signal("beta_c", "rad", "direction that the current flows to", r"\beta_c", wrapped=True),
)


# The arguments of a disturbance's kernel.
ARGUMENTS = ("t", "x", "k", "table", "b", "again", "stage")


class Disturbance(KernelPart):
    """A load on the hull in the body frame.

    `evaluate(t, x, k, table, b, again, stage)` is a kernel and takes those of these arguments that
    it names. It writes (b_u [N], b_v [N], b_r [N m]) at time t [s] and state x = (x, y, psi, u, v,
    r) into `b`, and behind them one number for each of its `signals`. One that does not look at x
    says so with `of_time`, and is not asked twice for the same t. Two numbers that are 0 or 1 say
    what need not be computed: where `again` is 1, `b` still has what it wrote for this t and maybe
    another x; where `stage` is 1, a step is under way, and its signals are not needed.
    """

    noun: ClassVar[str] = "disturbance"
    stands_alone: ClassVar[bool] = True  # a current's speed and direction are not a wind's

    of_time: ClassVar[bool] = False

    # Whether several of this kind may be in a list, and their signals add up as their loads do.
    adds_up: ClassVar[bool] = False

    @property
    def signals(self) -> tuple[Signal, ...]:
        """What `evaluate` writes behind the load."""
        return ()

    evaluate: ClassVar[Callable[..., None]] = staticmethod(absent("evaluate"))

    def told(self) -> Iterator[tuple[Disturbance, tuple[Signal, ...]]]:
        """Each of its parts, with the signals that are logged because of it."""
        yield self, self.signals

    def each(self) -> tuple[Disturbance, ...]:
        """Itself; of a sum, its parts."""
        return (self,)

    def constant_of(self, position: int, name: str) -> str:
        """What `constants_with` calls this constant of the part at this position of `each`."""
        return name

    def loads(self, vessel: Vessel, times: Iterable[float], states: Iterable[Vector]) -> Vector:
        """The loads (b_u, b_v, b_r) on this vessel at these times [s]: (times, 3) [N, N, N m].

        `states` are (x, y, psi, u, v, r), one for each time; at least one.
        """
        times = list(times)
        rows = np.zeros((len(times), 3 + len(self.signals)))
        # The table is made for a run that ends with the last time: it has to reach so far
        k, table = bundle(self.constants_with(vessel)), self.table_for(vessel, max(times))
        evaluate = self.kernel_with(vessel)
        for t, x, b in zip(times, states, rows, strict=True):
            # Each time stands alone: `b` has nothing from before, and it is no stage of a step
            call(evaluate, t=t, x=x, k=k, table=table, b=b, again=0.0, stage=0.0)
        return rows[:, :3]

    def kernel_with(self, vessel: Vessel) -> Callable[..., None]:
        """The kernel for constants of this vessel; the same function for every vessel."""
        return self.evaluate

    def constants_with(self, vessel: Vessel) -> dict[str, float]:
        """Its constants `k`, with those of the simulated vessel that its load depends on."""
        return self.constants()

    def table_for(self, vessel: Vessel, duration: float) -> Vector:
        """Its table (n,), for this vessel and a run of this duration [s].

        What is random in it is a function of (seed, time): a longer run starts with the same
        numbers.
        """
        return self.table()

    def conflicts(self, vessel: Vessel, step: float) -> Iterator[tuple[str, str]]:
        """Key below `disturbance` and message for what does not fit the vessel or the step [s]."""
        return iter(())

    def bounds(self) -> tuple[float, float, float] | None:
        """What |b_u| [N], |b_v| [N], |b_r| [N m] never exceed, at any time and state.

        None where that is unknown. The load need not reach its bounds.
        """
        return None

    def sets_in(self) -> float:
        """Before this time [s] it has no load."""
        return 0.0

    def jumps(self) -> float:
        """The time [s] at which its load jumps, 0 where it does not within the run."""
        return 0.0

    def sea(self) -> tuple[float, float]:
        """Significant height [m] and the peak's angular frequency [rad/s]; no height: no waves."""
        return 0.0, 1.0

    def cosines(self) -> int:
        """How many cosines it sums."""
        return 0

    def resolving(self, duration: float) -> int:
        """How many cosines let the energy of a run of `duration` [s] vary with the seed as a sea's.

        0 where none are summed, and where it is not to vary.
        """
        return 0

    def full_scale(self) -> str:
        """The key of a spectrum that was measured over the open sea; "" without one."""
        return ""

    def shared_places(self) -> list[int]:
        """Places in the table that all runs side by side have to share; its kernel's `shared`."""
        return []
