"""What every actuator offers."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar, Self

import numpy as np

from podusv_cli.components.actuators.command import (
    GIVEN,
    GIVEN_SWAY,
    Command,
    Drive,
    EffectivenessLoss,
    failing,
    with_command_path,
)
from podusv_cli.components.actuators.recorded import (
    Recorded,
    constants_of,
    obeying,
    rows_of,
    table_of,
)
from podusv_cli.core.component import KernelPart, value
from podusv_cli.core.kernel import Vector, absent, bundle, call, kernel
from podusv_cli.core.signal import DEMAND, DEMAND_SIZE, TAU, Signal
from podusv_cli.core.units import Scales

SMALL = 1e-3  # of a demand or a state, for finite differences
ROUNDS = 20  # of Newton's method
SATURATION = Signal("saturated", "1", "1 while the actuator limits what the law asked for", "sat")


# Changes tau (3) [N, N, N m].
@kernel
def lose_evenly(k: Any, tau: Vector) -> None:
    """The loads that are left of those that `drive` wrote, once the actuator has failed."""
    for i in range(3):
        tau[i] *= k.failure_effectiveness


# Copies demand (3) into tau (3) [N, N, N m].
@kernel
def pass_loads(demand: Vector, tau: Vector) -> None:
    """Loads as they stand in a log."""
    for i in range(3):
        tau[i] = demand[i]


def whole_demand(demand: Vector) -> Vector:
    """A demand (3,) from its first two numbers, with a sway force of 0, or from all of it."""
    return np.concatenate([demand, np.zeros(DEMAND_SIZE - len(demand))])


class Actuator(KernelPart):
    """What turns a demand (tau_u, tau_r), or (tau_u, tau_r, tau_v), into loads on the hull.

    `drive(t, x, state, demand, k, table, tau, rate, signals)` is a kernel: from the vessel's state
    x, whose u and v are relative to the water, the actuator's own `state` and the `demand` (tau_u
    [N], tau_r [N m]) it writes the loads (tau_u, tau_v, tau_r) into `tau`, the rate of its state
    into `rate`, and one number for each of its `signals`. Limits act here, inside the right-hand
    side.

    `lose(state, k, table, tau, signals)` is a kernel that leaves a part of the loads and signals
    that `drive` wrote, once the actuator has failed; by default `k.failure_effectiveness` times the
    loads. Kernels take those of their arguments that they name.

    `obey(t, x, state, demand, k, table, tau, rate, signals)` is a kernel as `drive`, but that the
    `demand` has a command for each of the signals `replayed`, which is asked for as it is; an
    actuator without it takes no recorded commands.

    `replay(x, demand, k, table, tau)` is a kernel that writes the loads again that a log tells of:
    `demand` has the numbers of the signals `replayed`.

    `lag(state, command, k, table, rate)` is a kernel that writes the rates of what is `replayed`
    from the commands `lagged`; an actuator without such commands has none.

    `states` and `signals` declare every number; the numbers of one vector have the same signal,
    which has an axis.

    Every actuator has a `command` path and a `failure`, none by default. They lie around `drive`:
    `drive_with` and `signals_with` are with them, all other methods are about the healthy actuator
    alone.
    """

    noun: ClassVar[str] = "actuator"

    feels_motion: ClassVar[bool] = True  # False: `drive` does not look at x, nor in a subclass
    cuts: ClassVar[bool] = False  # True: loads are the demand cut at `limits()`, in a subclass, too
    command: Command | None = value(
        None, "", "how the law's demand reaches the actuator; at once and as it is by default"
    )
    failure: EffectivenessLoss | None = value(None, "", "loss of effectiveness at a time")

    @property
    def takes_sway(self) -> bool:
        """Whether the demand has a sway force behind the yaw moment."""
        return False

    @property
    def states(self) -> tuple[Signal, ...]:
        """The actuator's own states."""
        return ()

    @property
    def signals(self) -> tuple[Signal, ...]:
        """What `drive` writes into `signals`."""
        return ()

    drive: ClassVar[Callable[..., None]] = staticmethod(absent("drive"))

    obey: ClassVar[Callable[..., None] | None] = None

    lose: ClassVar[Callable[..., None]] = staticmethod(lose_evenly)

    @property
    def replayed(self) -> tuple[Signal, ...]:
        """What `replay` makes loads of, as a log has it: by default the loads themselves."""
        return TAU

    @property
    def zero_where_missing(self) -> tuple[str, ...]:
        """Names of signals `replayed` that a log need not have: without them they are 0."""
        return (TAU[1].name,)

    replay: ClassVar[Callable[..., None]] = staticmethod(pass_loads)

    @property
    def lagged(self) -> tuple[Signal, ...]:
        """Commands that the signals `replayed` follow, one each, as a log has them; or none."""
        return ()

    lag: ClassVar[Callable[..., None]] = staticmethod(absent("lag"))

    @property
    def reach(self) -> dict[str, float]:
        """Of signals `replayed` the largest size that they can have, where one is known."""
        return {}

    @property
    def full_speeds(self) -> tuple[tuple[float, float], ...]:
        """Of signals `replayed` that are propeller speeds the largest ahead and astern; else 0."""
        return tuple((0.0, 0.0) for _ in self.replayed)

    def with_thrust(self, factor: float, dead_band: float, exponent: float) -> Self | None:
        """The actuator with thrust times a factor; None where it has no propellers.

        Thrust at n of full N, over that at N, is ((n/N - dead_band)/(1 - dead_band))^exponent,
        where it was (n/N)^2, and goes likewise where it was another.
        """
        return None

    @property
    def scales(self) -> Scales:
        """Units beside podusv's that signals `replayed` and `lagged` may have, by signal."""
        return {}

    def commands(self, recorded: Recorded) -> Vector:
        """The rows of recorded commands: t [s] and one for each of `replayed`.

        Columns are called as these, or as the commands `lagged`. Raises ValueError.
        """
        if self.obey is None:
            raise ValueError(
                f"gives commands to propellers, and {self.label} takes surge force and yaw moment; "
                "write columns t, tau_u, tau_r, or choose the actuator that had these commands"
            )
        return rows_of(
            recorded.rows,
            self.replayed,
            self.lagged,
            self.zero_where_missing,
            tuple(
                (name, unit, scale)
                for name, own in self.scales.items()
                for unit, scale in own.items()
            ),
        )

    def constants_with(self, recorded: Recorded | None) -> dict[str, float]:
        """The constants, with those of recorded commands where there are any."""
        if not recorded:
            return self.constants()
        rows, first = self.commands(recorded), len(self.table())
        return self.constants() | constants_of(rows, first, held=recorded.held)

    def table_with(self, recorded: Recorded | None) -> Vector:
        """The table, with recorded commands behind it where there are any."""
        own = self.table()
        return np.concatenate([own, table_of(self.commands(recorded))]) if recorded else own

    def drive_with(self, recorded: Recorded | None = None) -> Drive:
        """`drive` with command path and failure; `drive` itself where it has neither.

        Recorded commands are obeyed in place of the demand. The `demand` has one more number, when
        the present step began [s].
        """
        drive: Drive = obeying(self.obey) if recorded and self.obey else self.drive
        if self.failure:
            drive = failing(drive, self.lose)
        return with_command_path(drive, sway=self.takes_sway) if self.command else drive

    @property
    def signals_with(self) -> tuple[Signal, ...]:
        """What `drive_with` writes into `signals`."""
        if not self.command:
            return self.signals
        return (*GIVEN, *((GIVEN_SWAY,) if self.takes_sway else ()), *self.signals)

    @property
    def by_delay_line(self) -> bool:
        """Whether demands reach it by the delay line: with a command path or a failure."""
        return bool(self.command or self.failure)

    @property
    def only_cuts(self) -> bool:
        """Whether the loads are always the demand of the same instant, cut at `limits()`."""
        return self.cuts and not self.by_delay_line

    def delay(self) -> float:
        """How long the law's demand takes to the actuator [s]."""
        return self.command.delay if self.command else 0.0

    def rest(self) -> Vector:
        """The state at the start of a run."""
        return np.zeros(len(self.states))

    def limits(self) -> tuple[float, ...]:
        """Largest loads both ways, in the order of a demand; infinite where not constant.

        Surge force [N] and yaw moment [N m], then the sway force [N] of one that `takes_sway`.
        """
        return (math.inf,) * (DEMAND_SIZE if self.takes_sway else len(DEMAND))

    def full_thrust(self) -> float:
        """The largest thrusts at rest of all its thrusters, `thrust` in its signals, summed [N].

        0 for an actuator that has no thrusters.
        """
        return 0.0

    def shortest_lag(self) -> float:
        """The smallest time constant of its states [s]; infinite without states."""
        return math.inf

    def lags(self) -> tuple[float, float]:
        """How late force and moment follow a demand [s]."""
        lag = self.shortest_lag()
        return (lag, lag) if math.isfinite(lag) else (0.0, 0.0)

    def settled(self, x: Vector, demand: Vector) -> Vector:
        """Loads (tau_u, tau_v, tau_r) once the actuator has followed a constant demand.

        `x` is the vessel's state, which is held; `demand` is (tau_u [N], tau_r [N m]), with a sway
        force [N] behind them where it `takes_sway`. By Newton's method from rest, for the state
        that does not change any more.
        """
        state = self.rest()
        for _ in range(ROUNDS):
            tau, rate = self._drive_once(x, state, demand)
            if np.allclose(rate, 0.0):
                break
            shifts = SMALL * np.eye(len(state))
            slopes = [(self._drive_once(x, state + d, demand)[1] - rate) / SMALL for d in shifts]
            # Least squares: a rate at its limit has no slope, and no equation could be solved
            state = state - np.linalg.lstsq(np.array(slopes).T, rate, rcond=None)[0]
        return tau

    def _drive_once(self, x: Vector, state: Vector, demand: Vector) -> tuple[Vector, Vector]:
        """Loads (3,) [N, N, N m] and rate of the state (states,) for x (6,), demand (2 or 3,)."""
        tau, rate, signals = np.zeros(3), np.zeros(len(state)), np.zeros(len(self.signals))
        demand = whole_demand(demand)
        call(
            self.drive,
            t=0.0,
            x=x,
            state=state,
            demand=demand,
            k=bundle(self.constants()),
            table=self.table(),
            tau=tau,
            rate=rate,
            signals=signals,
        )
        return tau, rate

    def without_each(self) -> dict[str, Self | None]:
        """The actuator without each of its thrusters, by the thruster's key; none by default.

        The allocation knows what is left, other than that of a `failure`. None where what is left
        cannot be steered.
        """
        return {}

    def input_matrix(self) -> Vector:
        """How loads (tau_u, tau_v, tau_r) follow small demands at rest, shape (3, 2) or (3, 3).

        By central differences, of what has settled. A rank below 3 is what the paper's section 2
        calls underactuated.
        """
        columns = [
            (self.settled(np.zeros(6), demand) - self.settled(np.zeros(6), -demand)) / (2.0 * SMALL)
            for demand in SMALL * np.eye(DEMAND_SIZE if self.takes_sway else len(DEMAND))
        ]
        return np.array(columns).T

    def input_rank(self) -> int:
        """Rank of `input_matrix`; below 3 the vessel is underactuated."""
        return int(np.linalg.matrix_rank(self.input_matrix()))
