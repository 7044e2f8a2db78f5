"""Nonlinear model-predictive control with an observer of the loads, in plain Python.

Every `period` the law solves an optimal control problem over the next seconds with IPOPT, from the
measured state, with the observed load held and the target going on along its circle. It is a
reference for comparisons: what a causal law can reach with a good model and far too much computing.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, Literal

import casadi as ca
import numpy as np

from podusv_cli.components.controllers.base import Slots
from podusv_cli.components.controllers.observer import B_U, OBSERVED, ObservingController, observe
from podusv_cli.core.component import value
from podusv_cli.core.kernel import Vector, kernel, tail
from podusv_cli.core.signal import Signal
from podusv_cli.optimum.collocation import dynamics

PLAN = Signal(
    "plan", "N", "planned demands: surge [N] and yaw [N m] of each step", axes=("planned",)
)
UNSOLVED = Signal("unsolved", "1", "how many problems IPOPT has not solved so far")
FIRST = len(OBSERVED)  # where the memory has UNSOLVED, and then PLAN
IPOPT = {
    "ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "ipopt.max_iter": 100,
    "ipopt.tol": 1e-5, "ipopt.mu_init": 1e-3,
}  # fmt: skip


class Nmpc(ObservingController):
    """Minimises the distance to the target, predicted with the nominal vessel.

    The cost of a plan is the integral of sqrt(e^2 + smooth^2) and a little for changes of the
    demand. Needs CasADi, and `simulation.compiled: false`.
    """

    kind: Literal["nmpc"] = "nmpc"
    period: float = value(0.1, "s", "time between two plans", gt=0)
    steps: int = value(40, "", "number of demands in a plan", ge=2)
    step: float = value(0.2, "s", "time for which each of them holds in the plan", gt=0)
    surge_limit: float = value(8.0, "N", "largest surge force that a plan has", gt=0)
    yaw_limit: float = value(2.5, "N m", "largest yaw moment that a plan has", gt=0)
    smooth: float = value(0.02, "m", "distance below which the cost becomes a square", gt=0)
    change: float = value(
        0.01, "m s", "cost of a demand that changes from limit to limit in a step of the plan", ge=0
    )

    def slots(self) -> Slots:
        """The observer, the unsolved problems and the plan."""
        return (*super().slots(), (UNSOLVED, 1), (PLAN, 2 * self.steps))

    def sample_period(self) -> float:
        """The time between two plans."""
        return self.period

    @staticmethod
    @kernel
    def sample(t: float, x: Vector, memory: Vector, target: Vector, k: Any, table: Vector) -> None:
        """Plan anew, from the plan before."""
        before = memory[FIRST + 1 : FIRST + 1 + 2 * int(k.steps)]
        plan, solved = planner(k)(x[:6], before, memory[B_U : B_U + 3], predicted(target, k))
        memory[FIRST] += 0.0 if solved else 1.0
        before[:] = plan

    @staticmethod
    @kernel
    def law(
        t: float, x: Vector, memory: Vector, target: Vector, k: Any, table: Vector,
        tau: Vector, rate: Vector, signals: Vector, work: Vector,
    ) -> None:  # fmt: skip
        """The first demand of the plan."""
        tau[0], tau[1] = memory[FIRST + 1], memory[FIRST + 2]
        observe(x, memory, tau, k, rate)
        rest = tail(rate, FIRST)
        for i in range(1 + 2 * int(k.steps)):
            rest[i] = 0.0


def predicted(target: Vector, k: Any) -> Vector:
    """Where the target will be after each step of a plan if it keeps its speed and yaw rate."""
    times = k.step * np.arange(1, int(k.steps) + 1)
    velocity, acceleration = complex(*target[2:4]), complex(*target[4:6])
    squared = abs(velocity) ** 2
    turning = (velocity.conjugate() * acceleration).imag / squared if squared > 0.0 else 0.0
    half = 0.5 * turning * times
    ahead = times * np.sinc(half / np.pi) * np.exp(1j * half) * velocity
    return np.array([target[0] + ahead.real, target[1] + ahead.imag])


@lru_cache(maxsize=8)  # building one takes a second; it keeps nothing of the problems it solves
def planner(k: Any) -> Callable[[Vector, Vector, Vector, Vector], tuple[Vector, bool]]:
    """A function from state, last plan, load and target's places to a new plan."""
    n, ahead = int(k.steps), _ahead(k)
    w, p = ca.MX.sym("w", 8 * n), ca.MX.sym("p", 11 + 2 * n)
    every = ca.reshape(w, 8, n)  # demand of a step, and the state after it
    demands, states = every[:2, :], every[2:, :]
    begin, load, places = p[:6], p[6:9], ca.reshape(p[11:], 2, n)
    before = ca.horzcat(begin, states[:, :-1])
    away = ca.sum1((states[:2, :] - places) ** 2)
    changes = ca.horzcat(demands[:, 0] - p[9:11], demands[:, 1:] - demands[:, :-1])
    scaled = changes / ca.repmat(ca.DM([2.0 * k.surge_limit, 2.0 * k.yaw_limit]), 1, n)
    cost = k.step * ca.sum2(ca.sqrt(away + k.smooth**2)) + k.change * ca.sumsqr(scaled)
    gaps = states - ahead.map(n)(before, demands, ca.repmat(load, 1, n))
    solver = ca.nlpsol("nmpc", "ipopt", {"x": w, "p": p, "f": cost, "g": ca.vec(gaps)}, IPOPT)
    limits = np.array([k.surge_limit, k.yaw_limit])
    high = np.tile([*limits, *[np.inf] * 6], n)

    def plan(x: Vector, last: Vector, b: Vector, there: Vector) -> tuple[Vector, bool]:
        guess, state = np.empty((n, 8)), x
        guess[:, :2] = last.reshape(n, 2)
        for row in guess:
            row[2:] = state = np.array(ahead(state, row[:2], b)).ravel()
        parameters = np.concatenate([x, b, last[:2], there.T.ravel()])
        found = solver(x0=guess.ravel(), p=parameters, lbx=-high, ubx=high, lbg=0.0, ubg=0.0)
        demand = np.array(found["x"]).reshape(n, 8)[:, :2].clip(-limits, limits)
        return demand.ravel(), bool(solver.stats()["success"])

    return plan


def _ahead(k: Any) -> Any:
    """A CasADi function: the state after a step of the plan, by the Runge-Kutta method."""
    x, demand, b = ca.SX.sym("x", 6), ca.SX.sym("demand", 2), ca.SX.sym("b", 3)
    rate, h = dynamics(k), k.step
    k1 = rate(x, demand, b)
    k2 = rate(x + h / 2.0 * k1, demand, b)
    k3 = rate(x + h / 2.0 * k2, demand, b)
    k4 = rate(x + h * k3, demand, b)
    return ca.Function("ahead", [x, demand, b], [x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)])
