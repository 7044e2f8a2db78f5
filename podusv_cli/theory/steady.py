"""The steady motion of a closed loop on its path, and its linearisation there.

Seen from a target that moves straight on or in a circle at constant speed, a settled vessel
stands still. With q the loop's state relative to the target, and the load as it is at one instant,

    q' = g(q),   g(q*) = 0,   A = dg/dq.

Everything is numerical and from the engine's own right-hand side, so any law will do.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from podusv_cli.components.estimators.none import NoEstimator
from podusv_cli.components.measurements.exact import Exact
from podusv_cli.components.vessels.plant import plant
from podusv_cli.core.errors import NotConvergedError
from podusv_cli.core.kernel import Vector, bundle
from podusv_cli.core.signal import SWAY_DEMAND, Signal
from podusv_cli.engine.loop.closed_loop import DEMAND, LOADS, ClosedLoop
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.replay import rates_at
from podusv_cli.engine.running.simulate import run
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.theory.course import Course

SETTLING = 3000.0  # s, for which the vessel is left to settle on the steady motion
MOST_EVALUATIONS = 20_000  # of the right-hand side while it settles
ROUNDS = 30  # of Newton's method
SETTLED = 1e-8  # of every state, or of 1: how far Newton's last step may go
STEPS = (1e-4, 1e-5, 1e-6)  # of every state, or of 1: steps of differences, the first that will do
ASIDE = 0.03  # of every state, or of 1: where it is looked what reads a state
CLOSE = 1e-2  # m; nearer to the target its direction may be singular
NOTHING = 1e-12  # of the largest derivative: up to this a rate answers nothing but by rounding
ROUNDED = 1e-14  # of the largest derivative: up to this a rate may be rounding
CURVED = 1e-2  # of a row's largest derivative: how much the derivatives to both sides may differ

WHAT_IT_TAKES = (
    "margins are those of a law that settles behind a steady target; look at a run, or take a law "
    "or gains that settle"
)


@dataclass(frozen=True)
class Linear:
    """A closed loop about its steady motion: q' = A q + B d, and loads on the hull C q.

    q are those of the loop's states that change by more than rounding, relative to the target, as
    `states` names them (m, rad, m/s, rad/s, units of the law's memory). d and the loads are (tau_u
    [N], tau_r [N m]) at the plant's input, or (tau_u, tau_v, tau_r) where the law asks for a sway
    force; `loads` has their names. `B_command` and `C_command` are the same at the actuator's: what
    reaches it, and what the law demands, tau_v last. A law that is told the loads sees what happens
    between the two, as a delay, but not what happens behind the actuator.

    `distance` is that to the target in the steady motion [m], `load` what is held (b_u, b_v, b_r),
    `motion` the steady (u, v, r), `reach` how far the loop is linear, in units of each state.
    """

    A: Vector
    B: Vector
    C: Vector
    B_command: Vector
    C_command: Vector
    states: tuple[str, ...]
    loads: tuple[str, ...]
    course: Course
    distance: float
    load: Vector
    motion: Vector
    reach: float

    @property
    def singular(self) -> bool:
        """Whether the target is so near that the vessel's smallest move changes its direction."""
        return self.reach < STEPS[0] and self.distance < CLOSE


def idealise(loop: ClosedLoop) -> ClosedLoop:
    """The loop with exact measurements, no estimator, no load estimate, no delay of the command.

    All of these have memory or noise that the loop's state does not hold; see `rates_at`.
    """
    actuator = loop.actuator
    if actuator.command:
        command = actuator.command.model_copy(update={"delay": 0.0})
        actuator = actuator.model_copy(update={"command": command})
    return replace(
        loop,
        actuator=actuator,
        controller=loop.controller.without_load_estimate(),
        measurement=Exact(),
        estimator=NoEstimator(),
    )


def linearise(loop: ClosedLoop, along: Course, step: float, *, compiled: bool = True) -> Linear:
    """The loop linearised about its steady motion along a course.

    The vessel gets there as in a run with this `step` [s] up to the course's time. From then on the
    target goes on as it does and the load keeps its value, until nothing changes any more. Raises
    NotConvergedError where the vessel does not come to a steady motion, or where the right-hand
    side has no derivative there.
    """
    loop = idealise(loop)
    steps = max(round(along.time / step), 1)
    plan = Plan(loop, TimeGrid(step, steps, log_every=steps))
    arrived = _arrive(plan, compiled)
    try:
        with np.errstate(all="ignore"):
            frame = _Frame(plan, along, arrived, compiled)
            return _about(plan, frame, frame.steady(frame.settle(frame.start)))
    except (ArithmeticError, np.linalg.LinAlgError) as error:
        raise NotConvergedError(f"no steady motion was found: {error}; {WHAT_IT_TAKES}") from error


def _about(plan: Plan, frame: _Frame, q: Vector) -> Linear:
    """The loop linear about `q` (states,) in the target's frame; states at rest are left out."""
    jacobian, reach = frame.jacobian(q)
    states = len(q)  # below the rows of their rates the jacobian has those of loads, then demands
    heights = (abs(jacobian[:states]) * _size(q)).max(axis=1)
    moving = np.flatnonzero(heights > NOTHING * heights.max())
    outputs, loads = jacobian[states:, moving], _loads(plan)
    return Linear(
        A=jacobian[np.ix_(moving, moving)],
        B=_inputs(plan, states)[moving],
        C=outputs[: len(loads)],
        B_command=frame.command_slopes(q)[moving],
        C_command=outputs[len(loads) :],
        states=tuple(frame.labels[1 + i] for i in moving),
        loads=loads,
        course=frame.course,
        distance=math.hypot(*q[:2]),
        load=frame.row(q)[frame.loads],
        motion=q[3:6],
        reach=reach,
    )


def _arrive(plan: Plan, compiled: bool) -> Vector:
    """The loop's state (states,) at the end of a run.

    Raises NotConvergedError where the run diverges, KeyboardInterrupt where the user ends it.
    """
    log = run(plan, compiled=compiled)
    if log.status == "interrupted":
        raise KeyboardInterrupt
    if log.status != "finished":
        raise NotConvergedError(f"there is no steady motion: the run {log.message}")
    # The numbers of one vector share a name, whose signal has a column for each
    state = dict.fromkeys(plan.names[1 : 1 + plan.layout.states])
    return np.asarray(np.column_stack([log[name] for name in state])[-1])


def _loads(plan: Plan) -> tuple[str, ...]:
    """The loads on the hull that answer the law's demands."""
    return LOADS[:3] if plan.loop.controller.asks_sway() else (LOADS[0], LOADS[2])


def _inputs(plan: Plan, states: int) -> Vector:
    """Rates of the states by each of the loads on the hull, shape (states, loads).

    At rest the plant's rates are those that the load makes, and they are linear in it.
    """
    loads = [LOADS.index(name) for name in _loads(plan)]
    k, nothing = bundle(plan.constants["vessel"]), np.zeros(6)
    rates = np.zeros((states, len(loads)))
    for column, tau in enumerate(np.eye(3)[loads]):
        rate = np.zeros(6)
        plant(nothing, tau, nothing, k, rate)
        rates[:6, column] = rate
    return rates


class _Left(NamedTuple):
    """Where the vessel is that was left to settle for some seconds.

    In the later half of them its distance to the target was between `nearest` and `farthest` [m].
    """

    q: Vector
    seconds: float
    nearest: float
    farthest: float


class _Frame:
    """The loop as a target sees it that moves on a course, its load held."""

    def __init__(self, plan: Plan, along: Course, s: Vector, compiled: bool) -> None:
        """A frame that moves with the course, starting at the loop's state `s` (states,).

        `compiled`: rates by compiled kernels, not by Python.
        """
        self.labels = plan.names
        self.course = along
        column = {name: i - 1 for i, name in enumerate(self.labels)}  # rows lack the leading time
        self.loads = [column[name] for name in LOADS[3:]]  # the disturbance's b_u, b_v, b_r
        sway = [SWAY_DEMAND.name] if plan.loop.controller.asks_sway() else []
        self._demands = [column[name] for name in (*DEMAND, *sway)]
        self._seen = [*range(len(s)), *(column[name] for name in _loads(plan)), *self._demands]
        self._rates = rates_at(plan, compiled=compiled)
        self._origin = np.zeros(len(s))
        self._origin[:2] = along.position
        self.start = s - self._origin
        self._drift = np.zeros(len(s))
        self._drift[:2] = along.velocity
        self._idle = list[int]()  # what is idle is found from `rows`, which reads this
        self._turn_angles(plan.about)
        self._idle = self._idle_memory(plan.layout.memory)

    def _turn_angles(self, about: Mapping[str, Signal]) -> None:
        """Let angles turn with the course: the heading, and those like it in the law's memory.

        Such a memory turns at the course's rate, or within half of it, where the run arrived.
        """
        turn, count = self.course.turn, len(self.start)
        if turn:
            # 1 for what turns with the course; rates of the run's end are nearly steady
            pace = self.row(self.start)[:count] / turn
            angles = [about[name].unit == "rad" for name in self.labels[1 : 1 + count]]
            self._drift[np.array(angles) & (abs(pace - 1.0) < 0.5)] = turn
            self._drift[2] = turn

    def _idle_memory(self, first: int) -> list[int]:
        """Which states, from `first` on, nothing but such states reads: they may grow for ever.

        Such are the integrals of a law whose integral gain is 0. Looked for off the steady motion,
        where no factor is 0: every state is moved by another amount.
        """
        count = len(self.start)
        here = self.start + ASIDE * np.sqrt(1.0 + np.arange(count)) * _size(self.start)
        shifts = ASIDE * np.diag(_size(here))[first:]
        reads = (self.rows(here + shifts) != self.rows(here[None]))[:, self._seen]
        # A state that an idle one alone reads is idle too, so those read by the rest are taken out
        # until none is left to take
        idle, before = np.arange(first, count), count
        while 0 < len(idle) < before:
            before, readers = len(idle), np.delete(np.arange(len(self._seen)), idle)
            idle = idle[~reads[np.ix_(idle - first, readers)].any(axis=1)]
        return [int(place) for place in idle]

    def rows(self, q: Vector, given: Vector | None = None) -> Vector:
        """For q (n, states): rates of q, then the loop's row, (n, states + columns).

        `given` as `rates_at` has it.
        """
        count = q.shape[1]
        times = np.full((len(q), 1), self.course.time)
        out = self._rates(np.hstack([times, q + self._origin]), given)
        out[:, :count] -= self._drift
        # The frame turns with the course, so a place at rest in it has the rate turn x q
        out[:, 0] += self.course.turn * q[:, 1]
        out[:, 1] -= self.course.turn * q[:, 0]
        out[:, self._idle] = 0.0
        return out

    def row(self, q: Vector) -> Vector:
        """`rows` for one q (states,): (states + columns,).

        Raises ArithmeticError where a rate is not finite.
        """
        row = np.asarray(self.rows(q[None])[0])
        if not np.isfinite(row).all():
            raise ArithmeticError("a rate is not finite")
        return row

    def settle(self, q: Vector) -> _Left:
        """The vessel once it was left to settle from `q` (states,), or as far as it came.

        BDF takes long steps once the fast states are at rest.
        """
        from scipy.integrate import BDF  # slow to import

        solver = BDF(
            lambda _, q: self.row(q)[: len(q)],
            0.0,
            q,
            SETTLING,
            rtol=1e-6,
            atol=1e-9,
            jac=lambda _, q: self._central(q, STEPS[0])[: len(q)],
        )
        # x and y of q are relative to the target, so this is the time [s] and the distance [m]
        way = [(0.0, math.hypot(*q[:2]))]
        while solver.status == "running" and solver.nfev < MOST_EVALUATIONS:
            solver.step()
            way.append((solver.t, math.hypot(*solver.y[:2])))
        late = [distance for t, distance in way if t >= 0.5 * solver.t]
        return _Left(np.asarray(solver.y), solver.t, min(late), max(late))

    def steady(self, left: _Left) -> Vector:
        """The q (states,) near the settled vessel's which does not change, by Newton's method.

        Raises NotConvergedError after ROUNDS.
        """
        q: Vector = left.q
        for _ in range(ROUNDS):
            rates, slopes = self.row(q)[: len(q)], self._central(q, STEPS[1])[: len(q)]
            size = _size(q)
            scaled = slopes * size
            heights = abs(scaled).max(axis=1)
            most = heights.max()
            heights = np.maximum(heights, NOTHING * most)
            # Every rate counts in parts of its largest derivative. Least squares, since states at
            # rest make the slopes singular: their move is 0.
            move = size * np.linalg.lstsq(scaled / heights[:, None], -rates / heights)[0]
            q = q + move
            still = abs(rates) <= 1e-6 * heights + ROUNDED * most
            if (abs(move) <= SETTLED * size).all() and still.all():
                return q
        raise NotConvergedError(self._restless(left))

    def _restless(self, left: _Left) -> str:
        """Why no steady motion was found, for the user."""
        pace = abs(self.row(left.q)[: len(left.q)]) / _size(left.q)
        return (
            f"no steady motion was found: the run is {math.hypot(*self.start[:2]):.3g} m from the "
            f"target at t = {self.course.time:g} s; with the load of that time held for "
            f"{left.seconds:.3g} s it is between {left.nearest:.3g} m and {left.farthest:.3g} m "
            f"from it; {self.labels[1 + pace.argmax()]} changes most; {WHAT_IT_TAKES}"
        )

    def _central(self, q: Vector, relative: float) -> Vector:
        """Derivatives of rates, loads and demands by q, shape (all of these, states)."""
        return self._differences(q, relative)[0]

    def _differences(self, q: Vector, relative: float) -> tuple[Vector, Vector]:
        """Central differences, and by how much those to either side are off them.

        Both are (numbers that are seen, states); the steps are `relative` to the size of each
        state.
        """
        steps = relative * _size(q)
        # All points in one call, each with one state moved up or down, and q itself last
        rows = self.rows(np.vstack([q + np.diag(steps), q - np.diag(steps), q]))[:, self._seen].T
        above, below, here = np.split(rows, [len(q), 2 * len(q)], axis=1)
        return (above - below) / (2.0 * steps), (above + below - 2.0 * here) / (2.0 * steps)

    def jacobian(self, q: Vector) -> tuple[Vector, float]:
        """Derivatives of rates, loads and demands by q, shape (all of these, states), and the step.

        By central differences of two steps, extrapolated. Raises NotConvergedError where none of
        the steps gives derivatives that are the same for half of it and to both sides.
        """
        for relative in STEPS:
            coarse, _ = self._differences(q, relative)
            fine, apart = self._differences(q, 0.5 * relative)
            doubt = np.maximum(abs(coarse - fine), abs(apart)) * _size(q)
            largest = (abs(fine) * _size(q)).max(axis=1, keepdims=True)
            # What a number of this size may lose by rounding, over the step
            rounding = 1e-12 * np.maximum(abs(self.row(q)[self._seen]), 1.0)[:, None] / relative
            if (doubt <= CURVED * largest + rounding).all():
                return fine + (fine - coarse) / 3.0, relative  # errors go with the square of a step
        at = np.unravel_index(np.nanargmax(doubt / largest), doubt.shape)
        raise NotConvergedError(self._no_derivative(q, int(at[1])))

    def command_slopes(self, q: Vector) -> Vector:
        """Derivatives of the rates by the demands that reach the actuator, (states, demands)."""
        demand = self.row(q)[self._demands]
        steps = STEPS[0] * _size(demand)
        shifts = np.diag(steps)
        given = np.vstack([demand + shifts, demand - shifts])
        rates = self.rows(np.tile(q, (len(given), 1)), given)
        above, below = np.split(rates[:, : len(q)], 2)
        return np.asarray(((above - below) / (2.0 * steps[:, None])).T)

    def _no_derivative(self, q: Vector, state: int) -> str:
        """Why there is no derivative at `q` (states,) by state number `state`, for the user."""
        distance = math.hypot(*q[:2])
        why = (
            "a limit, dead zone or step of law or actuator lies there, or damping with |r| or |v| "
            "of the hull, such as Y_rv, at r or v of 0"
        )
        if state < 2 and distance < CLOSE:
            why = f"the target is {distance:.2g} m away, where its direction is singular"
        return (
            f"the loop has no derivative by {self.labels[1 + state]} at the steady motion: {why}; "
            "margins need a smooth loop: choose a law with a standoff, another load, another "
            "actuator or a hull without that term"
        )


def _size(q: Vector) -> Vector:
    """The size of each state, at least 1, by which steps and moves are scaled."""
    return np.maximum(abs(q), 1.0)
