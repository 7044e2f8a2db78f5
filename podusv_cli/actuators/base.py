"""What every actuator offers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from podusv_cli.core.component import Component
from podusv_cli.core.kernel import Vector, bundle


class Actuator(Component):
    """What turns a demand (tau_u, tau_r) into loads on the hull.

    `drive(t, x, state, demand, k, table, tau, rate, signals)` is a kernel: from the vessel's state
    x, the actuator's own `state` and the `demand` (tau_u [N], tau_r [N m]) it writes the loads
    (tau_u, tau_v, tau_r) into `tau`, the rate of its state into `rate`, and one number for each
    name in `signals`. Limits act here, inside the right-hand side.

    `states` and `signals` name every number; the numbers of one vector bear the same name.
    """

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the actuator's own states."""
        return ()

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of what `drive` writes into `signals`."""
        return ()

    @staticmethod
    def drive(
        t: float, x: Vector, state: Vector, demand: Vector, k: Any, table: Vector,
        tau: Vector, rate: Vector, signals: Vector,
    ) -> None:  # fmt: skip
        """Write loads, rates and signals; every actuator has its own."""
        raise NotImplementedError

    def rest(self) -> Vector:
        """The state at the start of a run."""
        return np.zeros(len(self.states))

    def shortest_lag(self) -> float:
        """The smallest time constant of its states [s]; infinite without states."""
        return math.inf

    def settled(self, x: Vector, demand: Vector) -> Vector:
        """Loads (tau_u, tau_v, tau_r) once the actuator has followed a constant demand.

        `x` is the vessel's state, which is held; `demand` is (tau_u [N], tau_r [N m]).
        """
        tau, rate, signals = np.zeros(3), np.zeros(0), np.zeros(len(self.signals))
        k, table = bundle(self.constants()), self.table()
        self.drive(0.0, x, self.rest(), demand, k, table, tau, rate, signals)
        return tau

    def input_matrix(self) -> Vector:
        """How loads (tau_u, tau_v, tau_r) follow small demands at rest, shape (3, 2).

        By central differences. A rank below 3 is what the paper's section 2 calls underactuated.
        """
        small, k, table = 1e-3, bundle(self.constants()), self.table()
        loads = np.zeros((2, 2, 3))
        for axis in range(2):
            for side, sign in enumerate((1.0, -1.0)):
                demand = np.zeros(2)
                demand[axis] = sign * small
                rate, signals = np.zeros(len(self.states)), np.zeros(len(self.signals))
                self.drive(
                    0.0, np.zeros(6), self.rest(), demand, k, table,
                    loads[axis, side], rate, signals,
                )  # fmt: skip
        return np.asarray(((loads[:, 0] - loads[:, 1]) / (2.0 * small)).T)
