"""What every control law offers."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar, Literal, NamedTuple, Self

import numpy as np

from podusv_cli.components.actuators.recorded import Recorded
from podusv_cli.components.controllers.velocity_loop import Axis, Loop
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import KernelPart
from podusv_cli.core.kernel import Vector, absent
from podusv_cli.core.signal import Signal

Slots = tuple[tuple[Signal, int], ...]


def each(signals: tuple[Signal, ...], count: int = 1) -> Slots:
    """A part of the memory of `count` numbers for each of these signals."""
    return tuple((signal, count) for signal in signals)


class Approach(NamedTuple):
    """The surge velocity that a law wants grows by `gain` [1/s] with the distance beyond this."""

    gain: float
    standoff: float  # m


class Most(NamedTuple):
    """What a law counts on: a largest speed, and a largest moment that it is to ask for."""

    speed: float = math.inf  # m/s
    creep: float = 0.0  # m/s, by which it nears a target that is as fast
    moment: float = math.inf  # N m


class ManoeuvreTrial(NamedTuple):
    """A manoeuvring trial: which, when it begins [s], and what change of heading reverses it [rad].

    `switch` is 0 where nothing is reversed.
    """

    manoeuvre: Literal["turning circle", "zig-zag", "stopping"]
    execute: float
    switch: float = 0.0


class Controller(KernelPart):
    """A law from (state, target) to a demand (tau_u [N], tau_r [N m]).

    `law(t, x, memory, target, k, table, tau, rate, signals, work)` is a kernel. It takes those of
    these arguments that it names, as the other kernels do. It reads the time
    t [s], the state x = (x, y, psi, u, v, r), its own `memory`, the `target` (see
    `paths.base.TARGET`) and its constants `k`, which hold its fields and the *nominal* vessel's
    coefficients. It writes the demand into `tau`, the rate of its memory into `rate`, and one
    number for each of its `signals`; `work` is scratch of `workspace()` numbers.

    `sample(t, x, memory, target, k, table)` is a kernel that may change `memory`; it is called at
    every multiple of `sample_period()`, before anything else sees that instant; where this is 0 and
    `takes_samples()`, at every step.

    `after_saturation(t, x, memory, demand, tau, k, table, rate)` is a kernel that may change the
    `rate` that `law` wrote from the state x, once the actuator has made loads `tau` of the
    `demand`; it is called where `wants_loads()`.

    A law declares what it logs: `signals`, the parts of its memory in `slots()`, and
    `fixed_signals()`. `explain` finds a signal that is in `signals` or a constant of the module.
    """

    noun: ClassVar[str] = "law"

    signals: ClassVar[tuple[Signal, ...]] = ()

    # Fields that a search for gains leaves alone, although they are numbers above 0
    no_gains: ClassVar[tuple[str, ...]] = ()

    # The field that `sample_period` is taken from, for messages; empty where there is none
    period_key: ClassVar[str] = ""

    # What a finding advises where a saturated actuator winds the law's memory up
    against_windup: ClassVar[str] = "tell it the loads that act (wants_loads, after_saturation)"

    law: ClassVar[Callable[..., None]] = staticmethod(absent("law"))
    sample: ClassVar[Callable[..., None]] = staticmethod(absent("sample"))
    after_saturation: ClassVar[Callable[..., None]] = staticmethod(absent("after_saturation"))

    def asks_sway(self) -> bool:
        """Whether its demand has a sway force [N] behind the yaw moment."""
        return False

    def wants_heading(self) -> bool:
        """Whether it reads a heading behind the target's distance, from a path that `heads`."""
        return False

    def keeps_path_time(self) -> bool:
        """Whether the path is read at the first number of its memory [s], not at the clock's time.

        So the law decides by that number's rate how fast the target goes along its path.
        """
        return False

    def wants_path_speed(self) -> bool:
        """Whether it goes along the path at a speed of its own, where it keeps the path's time."""
        return False

    def wants_loads(self) -> bool:
        """Whether the law has to know the loads that act."""
        return False

    def wants_load_estimate(self) -> bool:
        """Whether the loads that an estimator finds are taken off the law's three demands."""
        return False

    def without_load_estimate(self) -> Self:
        """The law that wants no such loads; itself where it wants none."""
        return self

    def sample_period(self) -> float:
        """Seconds between two calls of `sample`; 0 where the law needs none."""
        return 0.0

    def takes_samples(self) -> bool:
        """Whether `sample` is called; without a period at every step, or once a control period."""
        return self.sample_period() > 0.0

    def slots(self) -> Slots:
        """Signal and length of every part of the memory, in order."""
        return ()

    def velocity_loops(self, axes: tuple[Axis, Axis], nu: Vector) -> list[Loop]:
        """Its fast loops, linearised about the velocity nu = (u, v, r); `axes` are surge and yaw.

        From them findings tell whether the step or the sampling period is too long.
        """
        return []

    def approach(self) -> Approach | None:
        """How a law that points at the target drives towards it; None for any other law."""
        return None

    def most(self) -> Most:
        """The keys U and N_m of laws that have them; without limits for others."""
        return Most()

    def steering(self) -> tuple[str, float]:
        """Key and gain [1/s] with which it turns the hull; "" where it has no such gain."""
        return "", math.nan

    def commands(self) -> Recorded | None:
        """What the actuator obeys in place of the demand; None for laws."""
        return None

    def aims(self) -> bool:
        """Whether it steers for a target; trials and recorded commands do not."""
        return self.trial() is None and self.commands() is None

    def optimum_of(self) -> str:
        """The metric that its motion minimises among all motions of the task; empty for laws."""
        return ""

    def trial(self) -> ManoeuvreTrial | None:
        """The manoeuvring trial that this is, for the metrics of trials; None for a law."""
        return None

    def lyapunov(self) -> Any:
        """The law itself where (46) is its Lyapunov function, see `theory.monitor`; else None."""
        return None

    def workspace(self) -> int:
        """How many numbers of scratch the law needs."""
        return 1

    def start(self, x: Vector, target: Vector, nominal: Vessel) -> Vector:
        """The memory at t = 0 for the state x and the target there; all zero by default."""
        return np.zeros(sum(size for _, size in self.slots()))

    def fixed_signals(self) -> dict[Signal, Vector]:
        """Arrays worth logging that do not change during a run."""
        return {}

    def declared(self) -> tuple[Signal, ...]:
        """Everything that the law adds to a log."""
        return (*self.signals, *(signal for signal, _ in self.slots()), *self.fixed_signals())

    def constants_with(self, nominal: Vessel) -> dict[str, float]:
        """The law's constants together with those of the vessel it is told about."""
        return nominal.constants() | self.constants()
