"""Pods: propellers that turn with their axis, from a demand to propeller speeds and angles."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Literal, Self

import numpy as np
from pydantic import ValidationError, model_validator

from podusv_cli.components.actuators.allocation import allocate, settings
from podusv_cli.components.actuators.allocation_qp import MOST_PODS
from podusv_cli.components.actuators.allocation_single import within
from podusv_cli.components.actuators.base import SATURATION, Actuator, whole_demand
from podusv_cli.components.actuators.command import FullCommand
from podusv_cli.components.actuators.one_pod import Pod, PodFailure
from podusv_cli.components.actuators.propeller import (
    ANGLE,
    DELTA,
    DELTA_CMD,
    DELTA_LAG,
    DELTA_RATE,
    LIFT,
    LIMITED,
    N_AHEAD,
    N_ASTERN,
    N_LAG,
    N_RATE,
    POWER,
    POWER_TAKEN,
    SPEEDS,
    THRUST,
    WIDTH,
    X,
    Y,
    force,
    inflow,
    on_hull,
    thrust,
    turning,
)
from podusv_cli.components.actuators.rudder import loads
from podusv_cli.core.component import Presets, value
from podusv_cli.core.kernel import Vector, bundle, call, kernel, scratch, tail
from podusv_cli.core.portable import add_up
from podusv_cli.core.signal import DEMAND, DEMAND_SIZE, Signal
from podusv_cli.core.units import Scale, Scales

SATURATED, SPEED_LIMITED, ANGLE_LIMITED, RATE_LIMITED, FLAGS = range(5)
NEARLY = 1.0 - 1e-9  # of a limit, to which a command comes but for rounding
ROUNDS = 20  # until speeds and angles agree
STRONGEST = 1e15  # N, N m; beside it a demand of 1 is lost in rounding
TURNING = 0.25  # of an angle's lag, that a moment is late by
SMALL = 1e-3  # of what the pods can do, for finite differences


# Reads x (6) through the water, and state (2 count: speeds [1/s], then angles [rad]). Writes tau
# (3) [N, N, N m], thrusts (count) [N] and flows (count) [m/s].
@kernel
def act(
    x: Vector, state: Vector, k: Any, table: Vector, tau: Vector, thrusts: Vector, flows: Vector
) -> None:
    """Loads (9) of all pods as they stand; the thrust of each, and its advance speed in `flows`."""
    count = int(k.count)
    tau[0] = tau[1] = tau[2] = 0.0
    for i in range(count):
        pod, delta = tail(table, i * WIDTH), state[count + i]
        flows[i] = inflow(x, pod, delta, k)
        T = thrust(state[i], flows[i], pod, k)
        along, across = loads(turning(state[i], pod), T, delta, pod)
        along, across = on_hull(along, across, pod)
        thrusts[i] = T
        tau[0] += along
        tau[1] += 0.0 if k.neglect_sway_force > 0.0 else across
        tau[2] += pod[X] * across - pod[Y] * along


# Reads state and command, each (2 count: speeds [1/s], then angles [rad]). Writes rate (2 count).
@kernel
def follow(state: Vector, command: Vector, k: Any, table: Vector, rate: Vector) -> bool:
    """Rates of speeds and angles: first-order lags within limits; whether any is at its limit."""
    count, limited = int(k.count), False
    for i in range(count):
        pod = tail(table, i * WIDTH)
        wanted = (command[i] - state[i]) / pod[N_LAG]
        rate[i] = within(wanted, -pod[N_RATE], pod[N_RATE])
        turn = (command[count + i] - state[count + i]) / pod[DELTA_LAG]
        rate[count + i] = within(turn, -pod[DELTA_RATE], pod[DELTA_RATE])
        if rate[i] != wanted or rate[count + i] != turn:
            limited = True
    return limited


# Reads command (2 count). Writes flags at SPEED_LIMITED and ANGLE_LIMITED: 1 or 0.
@kernel
def at_limits(command: Vector, k: Any, table: Vector, flags: Vector) -> None:
    """Whether any speed, any angle is commanded to its limit."""
    count = int(k.count)
    flags[SPEED_LIMITED] = flags[ANGLE_LIMITED] = 0.0
    for i in range(count):
        pod, n, delta = tail(table, i * WIDTH), command[i], abs(command[count + i])
        if n >= pod[N_AHEAD] * NEARLY or n <= -pod[N_ASTERN] * NEARLY:
            flags[SPEED_LIMITED] = 1.0
        if pod[ANGLE] > 0.0 and delta >= pod[ANGLE] * NEARLY:
            flags[ANGLE_LIMITED] = 1.0


# Reads state (2 count). Writes rate (2 count) and signals: flags, (commands, read), power (count)
# [W].
@kernel
def pursue(state: Vector, k: Any, table: Vector, rate: Vector, signals: Vector) -> None:
    """Rates towards the commands that are in the signals; the flags of limits, and the power."""
    count = int(k.count)
    command = tail(signals, FLAGS)
    signals[RATE_LIMITED] = 1.0 if follow(state, command, k, table, rate) else 0.0
    at_limits(command, k, table, signals)
    if k.power_known > 0.0:
        power = tail(signals, FLAGS + 3 * count)
        for i in range(count):
            pod = tail(table, i * WIDTH)
            n = abs(turning(state[i], pod))
            power[i] = pod[POWER] * n * n * n


class Pods(Actuator):
    """Pods that turn force and yaw moment into propeller speeds and propulsion angles.

    Raises a validation error where the pods cannot make a yaw moment and a surge force.
    """

    kind: Literal["pod"] = "pod"
    presets = Presets("podusv_cli.components.actuators", "set of pods", "pod file")
    preset: str = value(
        "",
        "",
        "the file that brings the pods along: the name of one of podusv's, or a YAML file "
        "beside the scenario, which is read in; none where empty",
    )
    source: str = value("", "", "where the pods' numbers come from")
    validity: str = value("", "", "what they hold for")
    counts: Literal["turns", "parts"] = value(
        "turns",
        "",
        "what n counts: turns a second, logged as n, or parts of full speed, "
        "logged as n_part; units of the pods' numbers with s for n then go without",
    )
    command: FullCommand | None = value(
        None, "", "how the law's demand reaches the actuator; at once and as it is by default"
    )
    failure: PodFailure | None = value(None, "", "a pod's loss of thrust at a time")
    pods: tuple[Pod, ...] = value(..., "", "every pod; in place of the preset's", strict=False)
    priority: Literal["yaw", "surge"] = value(
        "yaw", "", "which demand comes first when the pods cannot meet both"
    )
    thrust_form: Literal["physical", "printed"] = value(
        "physical", "", "T_nV takes thrust away with the advance speed, or adds as printed in (8)"
    )
    neglect_sway_force: bool = value(False, "", "leave out the sway force, the paper's Y_p = 0")
    sway_weight: float = value(
        0.0,
        "",
        "several pods: what sway force counts in the squares beside 1 for surge; above 0, pods "
        "that can make one by itself take it from the law",
        ge=0,
    )
    horizon: float = value(
        0.0,
        "s",
        "0: angles and speeds anywhere within their limits are asked for; else those "
        "that their rates allow within this time",
        ge=0,
    )

    @model_validator(mode="after")
    def _steerable(self) -> Self:
        """Raises ValueError for pods that cannot make force and moment apart from each other."""
        if not 1 <= len(self.pods) <= MOST_PODS:
            raise ValueError(f"has {len(self.pods)} pods; 1 to {MOST_PODS} are possible")
        pushes = [push for pod in self.pods for push in pod.pushes()]
        if not any(moment for _, _, moment in pushes):
            raise ValueError(
                "has no authority over yaw: a pod that turns needs a lever arm x other than 0, "
                "one that does not (angle_limit 0) a lever arm y, or x where it pushes across"
            )
        if len(self.pods) == 1 and not (self.pods[0].angle_limit > 0 and self.pods[0].x != 0):
            raise ValueError(
                "has one pod, which cannot make surge force and yaw moment apart from each other; "
                "it needs a lever arm x and an angle_limit, both other than 0"
            )
        fixed = all(pod.angle_limit == 0 for pod in self.pods)
        apart = np.linalg.matrix_rank(np.array(pushes)[:, [0, 2]]) == len(DEMAND)
        if fixed and not apart:
            raise ValueError(
                "has only fixed propellers side by side at the same y, or across the ship, which "
                "cannot make surge force and yaw moment apart from each other; place two that push "
                "ahead at different y"
            )
        return self

    @model_validator(mode="after")
    def _there(self) -> Self:
        """Raises ValueError where a pod is to fail that there is not."""
        if self.failure and self.failure.pod >= len(self.pods):
            raise ValueError(
                f"has no pod {self.failure.pod} that could fail: its {len(self.pods)} are counted "
                f"from 0, so that failure.pod is at most {len(self.pods) - 1}"
            )
        return self

    @model_validator(mode="after")
    def _in_parts(self) -> Self:
        """Raises ValueError for pulses of turns, and for a table beyond full speed in parts."""
        for i, pod in enumerate(self.pods):
            if self.counts == "turns" and pod.pwm:
                raise ValueError(
                    f"has pwm in pods[{i}], which commands parts of full speed; write counts: parts"
                )
            if self.counts == "parts" and pod.table and max(pod.most_n) > 1.0 + SMALL:
                raise ValueError(
                    f"has a table in pods[{i}] whose commands reach {max(pod.most_n):g} parts of "
                    "full speed; write 'throttle [%]' or 'pwm [us]' as the name of its first column"
                    ", or change pwm.span"
                )
        return self

    @model_validator(mode="after")
    def _check_command(self) -> Self:
        """Raises ValueError for a command path of a sway force that is not taken."""
        path = self.command
        if path and not self.takes_sway and (path.resolution_v or path.dead_zone_v):
            raise ValueError(
                "has a resolution or a dead zone of a sway force, and takes none; leave "
                "command.resolution_v and command.dead_zone_v out, or set sway_weight above 0 with "
                "pods that can push every way"
            )
        return self

    @model_validator(mode="after")
    def _computable(self) -> Self:
        """Raises ValueError for thrust or moment beyond `STRONGEST`."""
        most = [max(pod.most_thrust) for pod in self.pods]
        arms = [math.sqrt(pod.x * pod.x + pod.y * pod.y) for pod in self.pods]
        force, moment = sum(most), sum(T * arm for T, arm in zip(most, arms, strict=True))
        if not max(force, moment) <= STRONGEST:
            raise ValueError(
                f"has a full thrust of {force:g} N and a yaw moment of {moment:g} N m, of which no "
                f"more than {STRONGEST:g} can be computed with; take smaller T_nn, T_nn_astern, "
                "n_max, n_max_astern, table, x or y"
            )
        return self

    @property
    def takes_sway(self) -> bool:
        """With a weight of it, where forces of the pods span surge, sway and yaw."""
        if self.sway_weight == 0.0 or self.neglect_sway_force:
            return False
        pushes = [push for pod in self.pods for push in pod.pushes()]
        return bool(np.linalg.matrix_rank(np.array(pushes)) == DEMAND_SIZE)

    @property
    def states(self) -> tuple[Signal, ...]:
        """Speed and angle of every pod."""
        count = len(self.pods)
        return (SPEEDS[self.counts][0],) * count + (DELTA,) * count

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Commands, thrust and, where every pod's is known, power; flags of what is at a limit."""
        known = all(pod.power_nnn is not None for pod in self.pods)
        vectors = (SPEEDS[self.counts][1], DELTA_CMD, THRUST, *((POWER_TAKEN,) if known else ()))
        return (SATURATION, *LIMITED, *(signal for signal in vectors for _ in self.pods))

    def constants(self) -> dict[str, float]:
        """The options, and how many pods there are."""
        known = all(pod.power_nnn is not None for pod in self.pods)
        return super().constants() | {
            "count": float(len(self.pods)),
            "power_known": float(known),
            "takes_sway": float(self.takes_sway),
            "closed_form": float(
                len(self.pods) == 1 and self.pods[0].y == self.pods[0].mount == 0.0
            ),
        }

    def table(self) -> Vector:
        """The pods' numbers, row after row, then the curves of those that have a table."""
        rows, curves = list[float](), list[float]()
        for i, pod in enumerate(self.pods):
            places = list[float]()
            for curve in pod.curves():
                places.append(float((len(self.pods) - i) * WIDTH + len(curves)))
                curves += curve.tolist()
            rows += pod.numbers(places or (0.0, 0.0))
        return np.array(rows + curves)

    def full_thrust(self) -> float:
        """Ahead or astern, whichever is larger of each."""
        return add_up(max(pod.most_thrust) for pod in self.pods)

    def shortest_lag(self) -> float:
        """Of speeds, and of angles that turn."""
        return min(lag for pod in self.pods for lag in pod.lags() if lag > 0.0)

    def lags(self) -> tuple[float, float]:
        """The propellers' lag; of a moment also a quarter of that of the angles that turn."""
        lag, turning = (max(lags) for lags in zip(*(pod.lags() for pod in self.pods), strict=True))
        return lag, lag + TURNING * turning

    def settled(self, x: Vector, demand: Vector) -> Vector:
        """Loads (3,) where the pods' state is what is commanded: x (6,), demand (2,) or (3,).

        The advance speed hangs on the angle; where thrust does not answer it, the first commands
        are the last. A horizon only takes longer to get there, so it is left out.
        """
        k, table, count = (
            bundle(self.constants() | {"horizon": 0.0}),
            self.table(),
            len(self.states),
        )
        tau, rate, state = np.zeros(3), np.zeros(count), self.rest()
        signals, demand = np.zeros(len(self.signals)), whole_demand(demand)
        felt = any(pod.T_nV or pod.T_nV_astern for pod in self.pods)
        for _ in range(ROUNDS):
            call(
                self.drive,
                x=x,
                state=state,
                demand=demand,
                k=k,
                table=table,
                tau=tau,
                rate=rate,
                signals=signals,
            )
            command = signals[FLAGS : FLAGS + count]
            if np.allclose(state, command, rtol=1e-9, atol=0.0):
                break
            state = command.copy()
            if not felt:
                act(x, state, k, table, tau, np.zeros(MOST_PODS), np.zeros(MOST_PODS))
                break
        return tau

    def without_each(self) -> dict[str, Self | None]:
        """The other pods; no command path, which may be one of a sway force that is lost."""
        return {f"pods[{i}]": self._without(i) for i in range(len(self.pods))}

    def _without(self, lost: int) -> Self | None:
        rest = tuple(pod for i, pod in enumerate(self.pods) if i != lost)
        try:
            return self.changed({"pods": rest, "failure": None, "command": None})
        except ValidationError:
            return None

    def input_matrix(self) -> Vector:
        """As for every actuator, but for loads that have settled, about a third of full thrust.

        At rest with no demand an angle has no effect yet, and loads follow the demand with a lag.
        """
        force = add_up(pod.most_thrust[0] for pod in self.pods) / 3.0
        demands, small = len(self.limits()), SMALL * force
        if not small:
            return np.zeros((3, demands))
        at, still = force * np.eye(demands)[0], np.zeros(6)
        columns = [
            (self.settled(still, at + change) - self.settled(still, at - change)) / (2.0 * small)
            for change in small * np.eye(demands)
        ]
        return np.array(columns).T

    @property
    def replayed(self) -> tuple[Signal, ...]:
        """Speed and angle of every pod, as they were; an angle that is fixed is 0."""
        return self._each(SPEEDS[self.counts][0], DELTA)

    @property
    def lagged(self) -> tuple[Signal, ...]:
        """Speed and angle of every pod, as they were asked for."""
        return self._each(SPEEDS[self.counts][1], DELTA_CMD)

    @property
    def scales(self) -> Scales:
        """Pulses of pods that have `pwm`."""
        speeds = [signal.name for signal in SPEEDS[self.counts]]
        return {
            f"{name}_{i}": {"us": Scale(pod.pwm.rest, 1.0 / pod.pwm.span)}
            for name in speeds
            for i, pod in enumerate(self.pods, 1)
            if pod.pwm
        }

    @staticmethod
    @kernel
    def lag(state: Vector, command: Vector, k: Any, table: Vector, rate: Vector) -> None:
        """Rates towards what is asked for."""
        follow(state, command, k, table, rate)

    @property
    def reach(self) -> dict[str, float]:
        """Of speeds, and of angles that turn."""
        speeds = [max(pod.most_n) for pod in self.pods]
        most = [*speeds, *(pod.angle_limit for pod in self.pods)]
        return {s.name: m for s, m in zip(self.replayed, most, strict=True) if m > 0.0}

    @property
    def full_speeds(self) -> tuple[tuple[float, float], ...]:
        """Of every pod the largest n ahead and astern; an angle has none."""
        return (*(pod.most_n for pod in self.pods), *((0.0, 0.0) for _ in self.pods))

    def with_thrust(self, factor: float, dead_band: float, exponent: float) -> Self | None:
        """By tables where dead band or exponent bend the curve; None beside a rudder then."""
        pods = [pod.with_thrust(factor, dead_band, exponent) for pod in self.pods]
        words = f"Thrust times {factor:.4g}, dead band {dead_band:.4g}, exponent {exponent:.4g}."
        new = {"preset": "", "pods": tuple(pods), "source": f"{self.source} {words}".strip()}
        return None if None in pods else self.changed(new)

    def _each(self, *vectors: Signal) -> tuple[Signal, ...]:
        """The numbers of these vectors as signals of their own, counted from 1."""
        return tuple(
            replace(vector, name=f"{vector.name}_{i}", axes=())
            for vector in vectors
            for i in range(1, len(self.pods) + 1)
        )

    @property
    def zero_where_missing(self) -> tuple[str, ...]:
        """The angles that are fixed."""
        return tuple(f"delta_{i}" for i, pod in enumerate(self.pods, 1) if pod.angle_limit == 0.0)

    @staticmethod
    @kernel
    def replay(x: Vector, demand: Vector, k: Any, table: Vector, tau: Vector) -> None:
        """Loads of the pods as they stand."""
        act(x, demand, k, table, tau, scratch(MOST_PODS), scratch(MOST_PODS))

    @staticmethod
    @kernel
    def lose(state: Vector, k: Any, table: Vector, tau: Vector, signals: Vector) -> None:
        """Take the lost part of the pod's thrust off the loads; allocation and power are as before.

        The pod's angle is as before, too; a rudder loses as much of its force.
        """
        count, i = int(k.count), int(k.failure_pod)
        thrusts, pod = tail(signals, FLAGS + 2 * count), tail(table, i * WIDTH)
        part = 1.0 - k.failure_effectiveness
        lost = part * thrusts[i]
        along, across = force(lost, state[count + i])
        if pod[LIFT] > 0.0:
            along, across = loads(turning(state[i], pod), thrusts[i], state[count + i], pod)
            along, across = part * along, part * across
        along, across = on_hull(along, across, pod)
        thrusts[i] -= lost
        tau[0] -= along
        tau[1] -= 0.0 if k.neglect_sway_force > 0.0 else across
        tau[2] -= pod[X] * across - pod[Y] * along

    @staticmethod
    @kernel
    def drive(
        x: Vector,
        state: Vector,
        demand: Vector,
        k: Any,
        table: Vector,
        tau: Vector,
        rate: Vector,
        signals: Vector,
    ) -> None:
        """Loads from the pods' states; rates towards what the demand asks for."""
        count = int(k.count)
        command, thrusts = tail(signals, FLAGS), tail(signals, FLAGS + 2 * count)
        flows, T = scratch(MOST_PODS), scratch(MOST_PODS)
        act(x, state, k, table, tau, thrusts, flows)
        met = allocate(state, demand, flows, k, table, T, tail(command, count))
        met = settings(count, T, flows, k, table, command) and met
        # What is no number must not get lost between limits; a sway force does not in `allocate`.
        lost = 0.0 * (demand[0] + demand[1])
        for i in range(2 * count):
            command[i] += lost
        signals[SATURATED] = 0.0 if met else 1.0
        pursue(state, k, table, rate, signals)

    @staticmethod
    @kernel
    def obey(
        x: Vector,
        state: Vector,
        demand: Vector,
        k: Any,
        table: Vector,
        tau: Vector,
        rate: Vector,
        signals: Vector,
    ) -> None:
        """Loads from the pods' states; rates towards the speeds and angles, cut at their limits."""
        count, met = int(k.count), True
        command, thrusts = tail(signals, FLAGS), tail(signals, FLAGS + 2 * count)
        for i in range(count):
            pod = tail(table, i * WIDTH)
            command[i] = within(demand[i], -pod[N_ASTERN], pod[N_AHEAD])
            command[count + i] = within(demand[count + i], -pod[ANGLE], pod[ANGLE])
            if command[i] != demand[i] or command[count + i] != demand[count + i]:
                met = False
        act(x, state, k, table, tau, thrusts, scratch(MOST_PODS))
        signals[SATURATED] = 0.0 if met else 1.0
        pursue(state, k, table, rate, signals)
