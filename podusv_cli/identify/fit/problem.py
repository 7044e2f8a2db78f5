"""Which numbers are looked for, what is known of them before, and the filter that they make."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.components.estimators.ekf import MOVING, PACKED, ExtendedKalmanFilter, N
from podusv_cli.components.facts import Facts
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import LANES, Vector
from podusv_cli.identify.fit.beside import (
    ALL,
    ASKED,
    AXES,
    DEVIATION,
    LASTING,
    PLAIN,
    RATE,
    SIZE,
    SWINGS,
    entry,
)
from podusv_cli.identify.fit.estimate import HullSearch
from podusv_cli.identify.fit.march import (
    COMPASS,
    CURRENT,
    CURVE,
    DEAD_BAND,
    DELAY,
    DELIVERED,
    EXPONENT,
    GUSTS,
    NAMES,
    SEA,
    SIGMAS,
    SQUARE,
    THRUST,
    Follow,
    Followed,
    side_by_side,
)
from podusv_cli.identify.fit.numbers import (
    ADDED,
    FORCES,
    FreeNumber,
    hull_numbers,
    symmetric,
    values_at,
)
from podusv_cli.identify.fit.records import FilterLog
from podusv_cli.identify.fit.sensing import USUAL, Wandering, position_wandering, sensor_noise
from podusv_cli.identify.logs.reading import Whole
from podusv_cli.process.workers import available_workers
from podusv_cli.scenario.identify import COMPASS_OFF, THRUST_CURVE, WANDER, Identify
from podusv_cli.scenario.model import Scenario

Entry = TypeVar("Entry")
OWN = NAMES.index(SEA[0])  # where what a log alone has begins
WALKS = ("q_u", "q_v", "q_r", "q_b", "q_b_psi")
UNSURE = 1.5  # of the logarithm of a noise, before the logs are read
LOUD = 2.0  # of these deviations, of accelerations and loads, where a second search begins
LEAST = -3.0  # of these deviations, of a sensor: a log without noise would make a singular filter
CALM = 0.002  # m/s2/sqrt(Hz): accelerations that neither hull nor load explain, on the model ship
AT_START = (0.2, 0.1, 0.05)  # m/s, m/s, rad/s: the same of the velocities at the start
# What a log begins with: speed through the water, sway, loads. A filter that is unsure of them on
# positions of 0.5 m begins with kicks of 1 m/s for a boat of 2 m, and what it makes of these
# differs from one hull to the next, for all of the log; so they are looked for.
FIRST = ("first u", "first v")
FIRST_LOADS = ("first load_x", "first load_y", "first load_psi")
MEAN_LOADS = ("mean load_x", "mean load_y", "mean load_psi")  # in their place, of gusts
TURNED = 0.05  # rad, of the heading at the start
FORGETS = 1.0  # of the logarithm of the time in which a position's error forgets
# Of gusts, before the logs: w_b on the model ship [rad/s] and z_b, and the deviations of their
# logarithms.
SWINGING, DAMPED = (1.0, 1.0), (0.7, 0.7)
FLOWING = 0.1  # of the speed at full thrust: a current that nothing is known of
BLOCK = 30.0  # s of a log, whose innovations count together


@dataclass(frozen=True)
class FitProblem:
    """The filter along several logs as a function of the numbers that are looked for.

    Points are in units of the priors' standard deviations, 0 where the prior is.
    """

    scenario: Scenario
    wanted: Identify
    logs: Sequence[FilterLog]
    gusts: bool = False  # whether loads are those of gusts

    @cached_property
    def facts(self) -> Facts:
        """What sizes the filter."""
        return self.scenario.facts

    @cached_property
    def filter(self) -> ExtendedKalmanFilter:
        """The filter before anything is looked for."""
        sized = ExtendedKalmanFilter().sized(self.facts)
        pace = self.facts.lam**0.25  # of an acceleration times the root of a time, after Froude
        quiet = {"q_u": CALM * pace, "q_v": CALM * pace, "q_r": CALM * pace / self.facts.lam}
        return sized.changed(quiet | self._sensor_deviations)

    @cached_property
    def _sensor_deviations(self) -> dict[str, float]:
        """The deviations of sensors that a log has: given, or guessed from it."""
        guesses = np.array([sensor_noise(log) for log in self.logs])
        sigmas: dict[str, float] = {}
        for i, name in enumerate(SIGMAS):
            measured = guesses[guesses[:, i] > 0.0, i]
            if name in self.wanted.noise:
                sigmas[name] = self.wanted.noise[name]
            elif len(measured):
                sigmas[name] = max(float(np.median(measured)), sigmas.get(name, 0.0))
        return sigmas

    @cached_property
    def wandering(self) -> Wandering:
        """What third differences say of an error of positions that wanders."""
        return position_wandering(self.logs)

    @property
    def wander(self) -> float:
        """Deviation of the error of positions that wanders, given or guessed [m]; 0: none."""
        guessed = self.wandering.deviation if self.wandering.is_sure else 0.0
        return self.wanted.noise.get(WANDER, guessed)

    @cached_property
    def _position(self) -> list[FreeNumber]:
        """Numbers of an error of positions that wanders, if there is one."""
        if not self.wander:
            return []
        own = [] if WANDER in self.wanted.noise else [FreeNumber(DEVIATION, self.wander, UNSURE)]
        return [*own, FreeNumber(LASTING, USUAL, FORGETS)]

    @cached_property
    def _gusts(self) -> list[FreeNumber]:
        """Numbers of gusts, where loads are those."""
        if not self.gusts:
            return []
        usual = SWINGING[0] / math.sqrt(self.facts.lam)
        return [FreeNumber(RATE, usual, SWINGING[1]), FreeNumber(SWINGS, *DAMPED)]

    @cached_property
    def hull(self) -> list[FreeNumber]:
        """The hull's numbers that are looked for, and those of the thrust.

        Raises UsageError for the thrust curve of an actuator without propellers.
        """
        actuator, numbers = self.scenario.actuator, hull_numbers(self.scenario.vessel, self.wanted)
        if {n.name for n in numbers} & {*CURVE} and not np.any(actuator.full_speeds):
            raise UsageError(
                f"identify.free: {THRUST_CURVE} is that of propellers, and {actuator.label} has "
                "none; leave it out, or choose the actuator whose propeller speeds the logs have"
            )
        return numbers

    @property
    def _seeks_thrust_curve(self) -> bool:
        """Whether dead band and exponent of the thrust are looked for."""
        return any(number.name in CURVE for number in self.hull)

    @cached_property
    def numbers(self) -> list[FreeNumber]:
        """All numbers that are looked for: the hull's, the noises, the current of every log."""
        guessed = [name for name in self._sensor_deviations if name not in self.wanted.noise]
        noises = [FreeNumber(n, getattr(self.filter, n), UNSURE, least=LEAST) for n in guessed]
        noises += [FreeNumber(n, getattr(self.filter, n), UNSURE) for n in WALKS]
        noises += [*self._position, *self._gusts]
        own = {**dict.fromkeys(CURRENT if self.current else (), self.current), **self._first}
        each = [
            FreeNumber(f"{name}, {log.name}", 0.0, sd, ratio=False)
            for log in self.logs
            for name, sd in own.items()
        ]
        off = self.wanted.noise.get(COMPASS, COMPASS_OFF)
        common = {DELAY: self.wanted.step} | ({COMPASS: off} if off else {})
        shared = [FreeNumber(name, 0.0, sd, ratio=False) for name, sd in common.items()]
        return [*self.hull, *noises, *shared, *each]

    @cached_property
    def current(self) -> float:
        """Standard deviation of a log's current, before it is read [m/s]."""
        given = self.wanted.current
        return FLOWING * self.facts.U if given is None else given

    @cached_property
    def sd(self) -> Vector:
        """Standard deviations of the hull's logarithms, before the logs are read."""
        return np.array([number.sd for number in self.hull])

    @cached_property
    def _first(self) -> dict[str, float]:
        """Standard deviations of what a log begins with, about what is guessed of it."""
        f, s = self.filter, self.facts.s
        sizes = (AT_START[0] * s, AT_START[1] * s, f.sigma_b, f.sigma_b, f.sigma_b_psi)
        return dict(zip((*FIRST, *self._loads), sizes, strict=True))

    @property
    def _loads(self) -> tuple[str, ...]:
        """Numbers of the load that a log begins with; of gusts, those of its mean."""
        return MEAN_LOADS if self.gusts else FIRST_LOADS

    @cached_property
    def _fixed_constants(self) -> Vector:
        """The filter's constants before anything is looked for, in the order of `NAMES`."""
        still = {THRUST: 1.0, EXPONENT: SQUARE}
        still |= dict.fromkeys((DEAD_BAND, DELAY, COMPASS, *SEA), 0.0)
        still |= {DEVIATION: self.wander, LASTING: USUAL, RATE: 1.0, SWINGS: 1.0}
        still |= dict(zip(ASKED, (float(self.wander > 0.0), float(self.gusts)), strict=True))
        known = self.scenario.vessel.constants() | self.filter.constants() | still
        return np.array([known[name] for name in NAMES])

    def at(self, y: Vector) -> Vector:
        """The numbers at a point."""
        return values_at(self.numbers, y)

    def values(self, y: Vector) -> dict[str, float]:
        """The numbers at a point, by name."""
        values = self.at(y).tolist()
        return {name: values[place] for name, place in self._places.items()}

    @cached_property
    def _places(self) -> dict[str, int]:
        """Where the coordinate of each number is in a point; m32 may go with m23."""
        return self._with_m32({number.name: i for i, number in enumerate(self.numbers)})

    def _with_m32(self, by_name: dict[str, Entry]) -> dict[str, Entry]:
        tied = "m23" in by_name and symmetric(self.scenario.vessel.constants())
        return by_name | {"m32": by_name["m23"]} if tied else by_name

    @cached_property
    def _free_constants(self) -> tuple[Whole, Whole]:
        """Which of the filter's constants are looked for, and where in a point each of them is."""
        free = [(i, self._places[name]) for i, name in enumerate(NAMES) if name in self._places]
        at, place = np.array(free, dtype=np.int64).T
        return at, place

    def constants(self, values: Vector, sea: Sequence[float]) -> Vector:
        """The filter's constants, with `values` from `at`, in a sea as of `SEA`, or part of it."""
        at, place = self._free_constants
        constants = self._fixed_constants.copy()
        constants[at] = values[place]
        constants[OWN : OWN + len(sea)] = sea
        return constants

    def sea_at(self, log: FilterLog, values: Vector) -> list[float]:
        """The sea of a log with `values` from `at`: current [m/s], and mean load where it gusts."""
        names = [f"{n}, {log.name}" for n in (*CURRENT, *(MEAN_LOADS if self.gusts else ()))]
        return [float(values[self._places[n]]) if n in self._places else 0.0 for n in names]

    @cached_property
    def sea_sd(self) -> Vector:
        """Standard deviations of a log's sea before it is read: current, and mean load in gusts."""
        loads = [self._first[name] for name in self._loads] if self.gusts else []
        return np.array([self.current, self.current, *loads])

    def vessel(self, y: Vector) -> Vessel:
        """The hull at a point. Raises ValidationError where no hull can be like that."""
        own = self.scenario.vessel
        new = self._with_m32(self._hull_values(y))
        new = {name: number for name, number in new.items() if name not in (THRUST, *CURVE)}
        beside = {n: getattr(own, n) + getattr(own, ADDED[n]) for n in ADDED}
        added = {ADDED[n]: beside[n] - new.pop(n) for n in ADDED if n in new}
        return own.changed(new | added)

    def before(self, y: Vector) -> Vector:
        """The point with the hull and the sea of before the logs, and with the sensors of a point.

        The hull of before is judged with this: it is not to blame for a compass that is off.
        """
        sensed = (*SIGMAS, DEVIATION, LASTING, COMPASS)
        return np.array([e * (n.name in sensed) for n, e in zip(self.numbers, y, strict=True)])

    def position_noise(self, y: Vector) -> float:
        """Standard deviation of a measured position, on each axis, at a point [m]."""
        k = dict(zip(NAMES, self.constants(self.at(y), (0.0, 0.0)), strict=True))
        return math.hypot(k["sigma_p"], k[DEVIATION])

    def thrust(self, y: Vector) -> float:
        """What part of the loads that the actuator's numbers give acts on the hull at a point."""
        return self._hull_values(y).get(THRUST, 1.0)

    def actuator(self, y: Vector) -> Actuator | None:
        """The actuator with the thrust at a point; None where its kind cannot have that thrust."""
        found = self._hull_values(y)
        bent = max(found.get(DEAD_BAND, 0.0), 0.0), found.get(EXPONENT, SQUARE)
        return self.scenario.actuator.with_thrust(self.thrust(y), *bent)

    def _hull_values(self, y: Vector) -> dict[str, float]:
        values = values_at(self.hull, y[: len(self.hull)]).tolist()
        return {number.name: value for number, value in zip(self.hull, values, strict=True)}

    def scale_by_thrust(self, y: Vector, thrust: float) -> Vessel:
        """The hull that moves under this thrust as the one at a point does under its own.

        A motion stays as it is where all forces, inertia's and thrust's too, are times one factor.
        """
        hull, factor = self.vessel(y), thrust / self.thrust(y)
        return hull.changed({name: factor * getattr(hull, name) for name in FORCES})

    @cached_property
    def _follow(self) -> Follow:
        return side_by_side(self.scenario.actuator, bent=self._seeks_thrust_curve)

    def start(
        self, log: FilterLog, sea: Sequence[float], values: Vector, *, first_known: bool = True
    ) -> Vector:
        """The filter's state at the beginning of a log, in the water's frame.

        Velocity and loads there are known by `values` from `at`, or unsure.
        """
        state = log.state.copy()
        state[2] -= values[self._places[COMPASS]] if COMPASS in self._places else 0.0
        c, s = math.cos(state[2]), math.sin(state[2])
        state[3] -= c * sea[0] + s * sea[1]
        state[4] -= c * sea[1] - s * sea[0]
        wander = values[self._places[DEVIATION]] if DEVIATION in self._places else self.wander
        pose = math.hypot(max(self.filter.sigma_p, 1e-9) * 3.0, wander)
        speeds = np.array(AT_START) * [self.facts.s, self.facts.s, self.facts.s / self.facts.lam]
        loads, first = [*self._first.values()][2:], np.zeros(len(self._first))
        if first_known:
            first = values[[self._places[f"{name}, {log.name}"] for name in self._first]]
            speeds[:2], loads = 0.0, [0.0] * 3
        state[3:5] += first[:2]
        beside = np.zeros(SIZE - N - PACKED)
        own = [PLAIN - N - PACKED + entry(a, a) for a in range(ALL)]
        beside[own[:AXES]] = wander * wander  # of the error, north and east
        if self.gusts:
            q, q_psi, w_b, z_b = (values[self._places[n]] for n in (*WALKS[3:], *GUSTS))
            rates = np.array([q, q, q_psi]) * math.sqrt(w_b / (4.0 * z_b))
            beside[own[AXES:]], loads, first[2:] = rates**2, rates / w_b, sea[len(CURRENT) :]
        unsure = np.diag(np.square([pose, pose, TURNED, *speeds, *loads]))
        return np.concatenate([state, first[2:], unsure[np.triu_indices(N)], beside])

    def follow(
        self, log: FilterLog, points: Sequence[Vector], seas: Sequence[Sequence[float]] = ()
    ) -> Followed:
        """The filter along a log, for every point, in the sea of the point or another."""
        values = [self.at(y) for y in points]
        around = seas or [self.sea_at(log, each) for each in values]
        starts = [
            self.start(log, sea, each, first_known=not seas)
            for sea, each in zip(around, values, strict=True)
        ]
        runs = self._runs(log, [*map(self.constants, values, around)], starts, tracked=True)
        whole = Followed(*(np.concatenate(arrays, axis=-1) for arrays in zip(*runs, strict=True)))
        flows = np.array([sea[: len(CURRENT)] for sea in around])
        since = log.times - log.times[0]
        whole.track[:, :2] += since[:, None, None] * flows.T
        return whole

    def _runs(
        self,
        log: FilterLog,
        constants: Sequence[Vector],
        starts: Sequence[Vector],
        *,
        tracked: bool,
    ) -> Iterator[Followed]:
        """The filter along a log for a few constants and starts after another."""
        for i in range(0, len(constants), LANES):
            part = slice(i, i + LANES)
            yield self._follow(log.record, constants[part], starts[part], tracked)

    def innovations(self, points: Sequence[Vector]) -> tuple[Vector, Vector]:
        """Innovations and their variances of all logs, a row a value, a column a point.

        Tracks would take several times the room of these.
        """
        ends = np.cumsum([0, *(log.record.delivered for log in self.logs)]).tolist()
        nu, s = (np.empty((ends[-1], len(points))) for _ in range(2))
        values = [self.at(y) for y in points]

        def fill(log: FilterLog, begin: int, end: int) -> None:
            """Write the rows of a log; runs that are alike along it are made once."""
            both = [(v, self.sea_at(log, v)) for v in values]
            rows = [np.append(self.constants(v, sea), self.start(log, sea, v)) for v, sea in both]
            # What another log begins with changes nothing here.
            each, of = np.unique(rows, axis=0, return_inverse=True)
            constants, starts = list(each[:, : len(NAMES)]), list(each[:, len(NAMES) :])
            for i, run in enumerate(self._runs(log, constants, starts, tracked=False)):
                for lane in range(run.innovations.shape[1]):
                    columns = np.flatnonzero(of.ravel() == LANES * i + lane)
                    nu[begin:end, columns] = run.innovations[:, lane, None]
                    s[begin:end, columns] = run.variances[:, lane, None]

        with ThreadPoolExecutor(available_workers()) as pool:
            list(pool.map(fill, self.logs, ends[:-1], ends[1:]))
        return nu, s

    @cached_property
    def search(self) -> HullSearch:
        """What is searched, the second time from a filter on that trusts its model little.

        A hull far from the boat's explains a log badly, and one that is trusted is stuck there.
        """
        loud = np.array([LOUD * (number.name in WALKS) for number in self.numbers])
        return HullSearch(self.innovations, len(loud), self.blocks, len(self.hull), second=loud)

    @cached_property
    def blocks(self) -> Whole:
        """Of every delivered value, in which part of the logs it is."""
        blocks, first = [], 0
        for log in self.logs:
            number = ((log.times - log.times[0]) // BLOCK).astype(int)
            per_row = log.record.rows[:, DELIVERED : DELIVERED + MOVING].sum(axis=1).astype(int)
            blocks.append(first + np.repeat(number, per_row))
            first += int(number[-1]) + 1
        return np.concatenate(blocks)


def channels(log: FilterLog) -> Whole:
    """Of every value that a log delivers, which of x, y, psi, u, v, r it is."""
    return np.nonzero(log.record.rows[:, DELIVERED : DELIVERED + MOVING])[1].astype(np.int64)
