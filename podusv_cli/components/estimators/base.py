"""What every estimator offers."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import ClassVar

import numpy as np

from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import KernelPart
from podusv_cli.core.kernel import Vector, absent
from podusv_cli.core.signal import STATE, Signal

# Not `u_hat`: laws with an observer of their own log that.
ESTIMATE = tuple(
    Signal(f"{q.name}_est", q.unit, f"estimated {q.meaning}", rf"{q.symbol}_{{est}}") for q in STATE
)
# What the nominal vessel does not explain, as two of the estimators know it.
LOADS = (
    Signal("b_est_x", "N", "estimated load, north", r"b_{est,x}"),
    Signal("b_est_y", "N", "estimated load, east", r"b_{est,y}"),
    Signal("b_est_psi", "N m", "estimated load, about the vertical", r"b_{est,\psi}"),
)
POSE_ALONE = (True, True, True, False, False, False)  # x, y, psi have to be measured


def mean_squared_innovation(squares: Vector, counts: Vector) -> float:
    """NIS: the mean squared innovation over its variance; NaN where nothing was measured.

    `squares` (quantities,) are sums of squared innovations over their variances, and `counts`
    (quantities,) how many are in each sum, as `Estimator.covariance` lays them out.
    """
    count = float(counts.sum())
    return float(squares.sum()) / count if count else math.nan


class Estimator(KernelPart):
    """From measurements to the state that the law works with.

    Its own state is part of the closed loop's, and its first six numbers are the estimate. Two
    kernels move it. `correct(t, seen, state, k, table)` is called at every instant, after the
    measurement: it may change the state where something was delivered. `follow(t, seen, tau,
    state, k, table, rate)` writes the state's rate, between the instants too; `tau` are the loads
    (surge, sway, yaw) that the actuator produces. `seen` is laid out as in `measurements.base`.
    """

    noun: ClassVar[str] = "estimator"

    @property
    def states(self) -> tuple[Signal, ...]:
        """Every number of its state, in order; the estimate first."""
        return ESTIMATE

    @property
    def covariance(self) -> tuple[int, int]:
        """Where in its state the covariance of its errors begins, and the matrix's order.

        The upper triangle by rows, the six of the estimate first; behind it, for each of x, y, psi,
        u, v, r, the sum of all squared innovations over their variances, then their numbers. 0, 0
        without one.
        """
        return 0, 0

    @property
    def load_at(self) -> int:
        """Where in its state the estimated loads `LOADS` begin; 0 where it finds none."""
        return self.states.index(LOADS[0]) if LOADS[0] in self.states else 0

    def assumed_noise(self) -> tuple[tuple[str, float], ...]:
        """For each of x, y, psi, u, v, r the key and value of the noise assumed; "" without one."""
        return (("", 0.0),) * len(ESTIMATE)

    def assumed_delay(self) -> tuple[str, float]:
        """The key and value [s] of the age that positions are taken to have; "" where none is."""
        return "", 0.0

    correct: ClassVar[Callable[..., None]] = staticmethod(absent("correct"))
    follow: ClassVar[Callable[..., None]] = staticmethod(absent("follow"))

    def needs(self) -> tuple[bool, ...]:
        """Which of x, y, psi, u, v, r have to be measured."""
        return (True,) * len(ESTIMATE)

    def lacking(self, measured: tuple[bool, ...]) -> str:
        """What it needs and is not measured, in a sentence; "" where nothing is missing.

        `measured` says it of x, y, psi, u, v, r.
        """
        pairs = zip(STATE, self.needs(), measured, strict=True)
        missing = [state.name for state, needed, known in pairs if needed and not known]
        if not missing:
            return ""
        text = f"needs {', '.join(missing)} measured; give a sensor, or an estimator that can"
        return f"{text} do without"

    def constants_with(self, nominal: Vessel) -> dict[str, float]:
        """Its constants `k`, with those of the vessel that the law is told about."""
        return nominal.constants() | self.constants()

    def start(self, x: Vector, nominal: Vessel) -> Vector:
        """Its state (states,) at t = 0, where the vessel's is x (6,): the truth, then zeros."""
        return np.concatenate([x, np.zeros(len(self.states) - len(ESTIMATE))])

    def shortest_lag(self) -> float:
        """The smallest time constant of its continuous part [s]; infinite without one."""
        return float("inf")
