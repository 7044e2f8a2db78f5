"""Pods: propellers that turn with their axis, from a demand to propeller speeds and angles."""

from __future__ import annotations

import math
from typing import Any, Literal, Self

import numpy as np
from pydantic import model_validator

from podusv_cli.actuators.base import Actuator
from podusv_cli.actuators.one_pod import one_pod, within
from podusv_cli.actuators.propeller import (
    ANGLE,
    DELTA_LAG,
    DELTA_RATE,
    N_AHEAD,
    N_ASTERN,
    N_LAG,
    N_RATE,
    POWER,
    WIDTH,
    X,
    Y,
    speed_for,
    speed_gain,
    thrust,
)
from podusv_cli.kernels import Vector, kernel, scratch, tail
from podusv_cli.registry import Component, value

MOST_PODS = 4
AT_LIMIT = 1e-9  # relative


class Pod(Component):
    """One propeller and the pod that turns it; `n` counts turns a second."""

    x: float = value(..., "m", "position ahead of the body origin; negative at the stern")
    y: float = value(0.0, "m", "position to starboard of the body origin")
    T_nn: float = value(..., "N s2", "thrust over |n|n ahead, at rest", gt=0)
    T_nn_astern: float = value(..., "N s2", "thrust over |n|n astern, at rest", gt=0)
    T_nV: float = value(0.0, "N s2/m", "change of thrust over |n| times speed", ge=0)
    n_max: float = value(..., "1/s", "largest propeller speed ahead", gt=0)
    n_max_astern: float = value(..., "1/s", "largest propeller speed astern", ge=0)
    n_rate: float = value(..., "1/s2", "fastest change of the propeller's speed", gt=0)
    n_lag: float = value(..., "s", "time constant of the propeller's speed", gt=0)
    angle_limit: float = value(
        math.radians(35.0), "rad", "largest angle, both ways; 0 for a fixed propeller",
        ge=0, le=0.5 * math.pi,
    )  # fmt: skip
    angle_rate: float = value(..., "rad/s", "fastest change of the angle", gt=0)
    angle_lag: float = value(..., "s", "time constant of the angle", gt=0)
    power_nnn: float | None = value(
        None, "W s3", "power over |n|^3; without it neither power nor energy is logged", ge=0
    )

    def numbers(self) -> list[float]:
        """The pod's row in the actuator's table, see `propeller`."""
        return [
            self.x, self.y, self.T_nn, self.T_nn_astern, self.T_nV, self.n_max, self.n_max_astern,
            self.angle_limit, self.n_rate, self.angle_rate, self.n_lag, self.angle_lag,
            self.power_nnn or 0.0,
        ]  # fmt: skip


@kernel
def act(x: Vector, state: Vector, k: Any, table: Vector, tau: Vector, thrusts: Vector) -> None:
    """Loads (9) of all pods as they stand, and the thrust of each."""
    count = int(k.count)
    tau[0] = tau[1] = tau[2] = 0.0
    for i in range(count):
        pod, n, delta = tail(table, i * WIDTH), state[i], state[count + i]
        T = thrust(n, speed_gain(x, pod, delta, k), pod, k)
        along, across = T * math.cos(delta), T * math.sin(delta)
        thrusts[i] = T
        tau[0] += along
        tau[1] += 0.0 if k.neglect_sway_force > 0.0 else across
        tau[2] += pod[X] * across - pod[Y] * along


@kernel
def follow(state: Vector, command: Vector, k: Any, table: Vector, rate: Vector) -> float:
    """Rates of speeds and angles: first-order lags within limits; 1 while any is at its limit."""
    count, limited = int(k.count), 0.0
    for i in range(count):
        pod = tail(table, i * WIDTH)
        wanted = (command[i] - state[i]) / pod[N_LAG]
        rate[i] = within(wanted, -pod[N_RATE], pod[N_RATE])
        turn = (command[count + i] - state[count + i]) / pod[DELTA_LAG]
        rate[count + i] = within(turn, -pod[DELTA_RATE], pod[DELTA_RATE])
        if rate[i] != wanted or rate[count + i] != turn:
            limited = 1.0
    return limited


@kernel
def allocate(x: Vector, state: Vector, demand: Vector, k: Any, table: Vector, out: Vector) -> None:
    """Propeller speeds and angles for the demand into `out`, as the states are ordered."""
    pod = table
    gain = speed_gain(x, pod, state[1], k)
    most_ahead = max(0.0, thrust(pod[N_AHEAD], gain, pod, k))
    most_astern = max(0.0, -thrust(-pod[N_ASTERN], gain, pod, k))
    T = scratch(2)
    one_pod(
        demand[0], demand[1] / pod[X], -pod[ANGLE], pod[ANGLE], most_astern, most_ahead,
        k.priority, T,
    )  # fmt: skip
    # What is no number must not get lost between limits.
    lost = 0.0 * (demand[0] + demand[1])
    out[0] = within(speed_for(T[0], gain, pod, k), -pod[N_ASTERN], pod[N_AHEAD]) + lost
    out[1] = T[1] + lost


class Pods(Actuator):
    """Pods that turn surge force and yaw moment into propeller speeds and propulsion angles.

    Raises a validation error where the pods cannot make a yaw moment and a surge force.
    """

    kind: Literal["pod"] = "pod"
    pods: tuple[Pod, ...] = value(..., "", "the pods", strict=False)
    priority: Literal["yaw", "surge"] = value(
        "yaw", "", "what is met first when surge force and yaw moment cannot both be had"
    )
    thrust_form: Literal["physical", "printed"] = value(
        "physical", "", "T_nV takes thrust away with the advance speed, or adds as printed in (8)"
    )
    neglect_sway_force: bool = value(False, "", "leave out the sway force, the paper's Y_p = 0")

    @model_validator(mode="after")
    def _steerable(self) -> Self:
        if len(self.pods) != 1 or self.pods[0].y != 0.0:
            raise ValueError(f"must be one pod on the centre line, got {len(self.pods)} pods")
        if self.pods[0].x == 0.0 or self.pods[0].angle_limit == 0.0:
            raise ValueError(
                "has no authority over yaw: the pod needs a lever arm x and an angle_limit, both "
                "other than 0"
            )
        return self

    @property
    def states(self) -> tuple[str, ...]:
        """Speed and angle of every pod."""
        count = len(self.pods)
        return ("n",) * count + ("delta",) * count

    @property
    def signals(self) -> tuple[str, ...]:
        """Commands, thrust and, where every pod's is known, power; flags of what is at a limit."""
        count = len(self.pods)
        known = all(pod.power_nnn is not None for pod in self.pods)
        vectors = ("n_cmd", "delta_cmd", "thrust", *(("power",) if known else ()))
        flags = ("saturated", "speed_limited", "angle_limited", "rate_limited")
        return (*flags, *(name for name in vectors for _ in range(count)))

    def constants(self) -> dict[str, float]:
        """The options, and how many pods there are."""
        known = all(pod.power_nnn is not None for pod in self.pods)
        counts = {"count": float(len(self.pods)), "power_known": float(known)}
        return super().constants() | counts

    def table(self) -> Vector:
        """The pods' numbers, row after row."""
        return np.array([number for pod in self.pods for number in [*pod.numbers()]])

    @staticmethod
    @kernel
    def drive(
        t: float, x: Vector, state: Vector, demand: Vector, k: Any, table: Vector,
        tau: Vector, rate: Vector, signals: Vector,
    ) -> None:  # fmt: skip
        """Loads from the pods' states; rates towards what the demand asks for."""
        count = int(k.count)
        command, thrusts = tail(signals, 4), tail(signals, 4 + 2 * count)
        act(x, state, k, table, tau, thrusts)
        allocate(x, state, demand, k, table, command)
        signals[3] = follow(state, command, k, table, rate)
        limits(x, state, demand, command, k, table, signals)
        if k.power_known > 0.0:
            power = tail(thrusts, count)
            for i in range(count):
                n = abs(state[i])
                power[i] = table[i * WIDTH + POWER] * n * n * n


@kernel
def limits(
    x: Vector, state: Vector, demand: Vector, command: Vector, k: Any, table: Vector, flags: Vector
) -> None:
    """Flags: the command does not make the demand; a speed, an angle is commanded to its limit."""
    count = int(k.count)
    made, thrusts = scratch(3), scratch(MOST_PODS)
    act(x, command, k, table, made, thrusts)
    flags[1] = flags[2] = 0.0
    for i in range(count):
        pod, n, delta = tail(table, i * WIDTH), command[i], abs(command[count + i])
        if n >= pod[N_AHEAD] * (1.0 - AT_LIMIT) or -n >= pod[N_ASTERN] * (1.0 - AT_LIMIT):
            flags[1] = 1.0
        if pod[ANGLE] > 0.0 and delta >= pod[ANGLE] * (1.0 - AT_LIMIT):
            flags[2] = 1.0
    apart_u, apart_r = abs(made[0] - demand[0]), abs(made[2] - demand[1])
    met = apart_u <= AT_LIMIT * (1.0 + abs(demand[0])) and apart_r <= AT_LIMIT * (
        1.0 + abs(demand[1])
    )
    flags[0] = 0.0 if met else 1.0
