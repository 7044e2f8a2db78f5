"""What is to be minimised, for which scenario; and what the solver cannot take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import SWAY_DEMAND
from podusv_cli.engine.loop.closed_loop import STATE, ClosedLoop
from podusv_cli.scenario.model import Scenario

Minimised = Literal["iae", "ise"]


@dataclass(frozen=True)
class Motion:
    """States (a row of x, y, psi, u, v, r each) and demands at these times [s].

    Demands are (tau_u, tau_r), or (tau_u, tau_r, tau_v) of an actuator that takes a sway force.
    """

    times: Vector
    states: Vector
    demands: Vector

    @classmethod
    def of(cls, log: Recording) -> Motion:
        """The motion of a run: its states, and what acted on the hull as demands."""
        loads = ("tau_u", "tau_r", *(("tau_v",) if SWAY_DEMAND.name in log.signals else ()))
        states, demands = ([log[name] for name in names] for names in (STATE, loads))
        return cls(log["time"], np.column_stack(states), np.column_stack(demands))

    def at(self, times: Vector) -> Motion:
        """The motion at other `times` (n,) [s], on straight lines between its own."""

        def between(rows: Vector) -> Vector:
            """Rows (times, numbers) at the new times (n,): (n, numbers)."""
            return np.column_stack([np.interp(times, self.times, column) for column in rows.T])

        return Motion(times, between(self.states), between(self.demands))


@dataclass(frozen=True)
class OptimumProblem:
    """The integral that is minimised over the motions of a closed loop's vessel."""

    loop: ClosedLoop
    duration: float
    minimised: Minimised

    @property
    def demands(self) -> int:
        """How many loads the actuator is asked for: three where it takes a sway force."""
        return len(self.loop.actuator.limits())

    def loads(self, times: Sequence[float]) -> Vector:
        """The disturbance (b_u, b_v, b_r) at these times [s], (times, 3) [N, N, N m].

        The states are zeros: `problem` lets only loads pass that depend on time alone.
        """
        return self.loop.disturbance.loads(self.loop.vessel, times, np.zeros((len(times), 6)))

    def places(self, times: Sequence[float]) -> Vector:
        """Where the target is at these times [s], (times, 2) [m], north and east."""
        return self.loop.path.targets(times)[:, :2]


def problem(scenario: Scenario, minimised: Minimised) -> OptimumProblem:
    """The problem of a scenario. Raises UsageError for one that cannot be solved here."""
    loop = scenario.closed_loop()
    kinds = {
        "path": (not loop.path.follows, "targets with a timetable, from which z_e is measured"),
        "disturbance": (
            loop.disturbance.of_time,
            "loads that depend on time alone (a disturbance that does declares `of_time`)",
        ),
        "actuator": (
            _passes_on(loop),
            "actuators that deliver the demand up to constant limits: ideal, saturated, "
            "ideal_full, saturated_full",
        ),
    }
    if loop.actuator.by_delay_line:
        raise UsageError(
            f"{scenario.name}: actuator has a command or a failure; podusv optimum knows actuators "
            "without them: leave actuator.command and actuator.failure out"
        )
    for key, (fits, known) in kinds.items():
        if not fits:
            parts = getattr(loop, key).each() if key == "disturbance" else (getattr(loop, key),)
            kind = ", ".join(part.kind for part in parts)
            raise UsageError(
                f"{scenario.name}: {key}.kind: {kind} does not fit; podusv optimum knows {known}"
            )
    return OptimumProblem(loop, scenario.simulation.duration, minimised)


def _passes_on(loop: ClosedLoop) -> bool:
    """Whether the actuator has no state, and delivers demands within its limits as they are.

    Tried at one demand, half the limits or half a unit where these are larger.
    """
    actuator = loop.actuator
    if actuator.states:
        return False
    half = 0.5 * np.minimum(actuator.limits(), 1.0)
    given = actuator.settled(np.zeros(len(loop.start)), half)
    asked = loads_of(list(half))
    return bool(np.allclose(given, asked, rtol=1e-12, atol=0.0))


def loads_of(demand: Sequence[Any]) -> list[Any]:
    """Loads (tau_u, tau_v, tau_r) of a demand (tau_u, tau_r) or (tau_u, tau_r, tau_v)."""
    surge, yaw, *sway = demand
    return [surge, *(sway or [0.0]), yaw]
