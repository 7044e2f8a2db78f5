"""What the episodes of an environment have in common: draws, reward, observation, limits."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from operator import index
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from podusv_cli.components.controllers.policy import INPUTS, OUTPUTS, observe
from podusv_cli.components.paths.base import TARGET
from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.phrases import unknown_word
from podusv_cli.core.signal import HEADING, PSI_D, TARGET_SIZE
from podusv_cli.engine.loop.closed_loop import STATE
from podusv_cli.engine.running.simulate import marcher
from podusv_cli.interface.scenarios import CHECKS, Changes, Source, load_scenario
from podusv_cli.interface.session import Session, waiting
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.sweep import Sweep
from podusv_cli.studies.making.check import gathered_metrics, sweep_faults
from podusv_cli.studies.making.draws import SOBOL_BITS, SWEEP, draw_scenario, draws

LEARNING = "learning"  # the stream of draws that no study has
Flags = npt.NDArray[np.bool_]
Limits = tuple[float, ...]


class Moment(NamedTuple):
    """An instant of an episode, which rewards and observations of one's own are made of.

    `time` [s]; `seen` has the eight numbers of the usual observation; `state` is (x, y, psi, u, v,
    r) as a law is given it, `target` position, velocity and acceleration, north and east, both in
    m, rad and s; `demand` is what held before, (tau_u [N], tau_r [N m]) with a sway force [N] where
    the actuator takes one, and zeros at the begin; `heading` is what the path asks for, with its
    rates, and zeros of one without. In a `VectorEnv` each number is an array with an entry for
    every environment.
    """

    time: Any
    seen: Vector
    state: Vector
    target: Vector
    demand: Vector
    heading: Vector


class Terms(NamedTuple):
    """What a user asks of an environment, beside its scenario; see `Env`."""

    period: float | None
    reward: str | Callable[[Moment, Moment], Any]
    observe: Callable[[Moment], Any] | None
    limits: Limits | None


ENDS = (INPUTS, INPUTS + len(STATE), INPUTS + len(STATE) + len(TARGET))
PARTS = INPUTS + len(STATE) + len(TARGET) + len(HEADING)  # numbers of `write_moment`


# x (6), target (10); writes signals (23).
@kernel
def write_moment(x: Vector, target: Vector, signals: Vector) -> None:
    """Write `seen`, `state`, `target` and `heading` of a moment into `signals`, in this order."""
    observe(x, target, signals)
    for i in range(6):
        signals[8 + i] = x[i]
        signals[14 + i] = target[i]
    for i in range(3):
        signals[20 + i] = target[PSI_D + i]


def moment(time: Any, parts: Vector, demand: Vector) -> Moment:
    """A moment of what `write_moment` has written, `parts` (23,) or (23, runs); all are copies."""
    seen, state, target, heading = np.split(parts.copy(), ENDS)
    # One number, too, is numpy's: over no time a rate is NaN then, and no ZeroDivisionError.
    return Moment(np.float64(time), seen, state, target, demand.copy(), heading)


class EpisodeTask:
    """What the episodes of an environment have in common: a scenario, and what is drawn in it."""

    def __init__(self, source: Source, changes: Changes | None, terms: Terms) -> None:
        """Raises ScenarioError, and UsageError for what no environment can be made of."""
        whole = load_scenario(source, changes, (*CHECKS, sweep_faults)).scenario
        self.whole, self.sweep = whole, whole.sweep or Sweep(draws=1)
        self._check_sweep()
        self.scenario, self.period = waiting(whole, terms.period)
        self.demands = len(self.scenario.actuator.limits())  # numbers of an action
        self.limits = self._limits(terms.limits)
        self.own = terms.reward if callable(terms.reward) else None
        self.metric = "" if self.own else self._check_reward(str(terms.reward))
        self._observe = terms.observe
        self.numbers = self._check_first()

    def _check_first(self) -> int:
        """How many numbers an observation has, found by one period in plain Python.

        Raises UsageError for a reward that the first period does not define, and for functions that
        do not give numbers.
        """
        # So that mistakes are reported before anything is compiled.
        plain = self.scenario.simulation.model_copy(update={"compiled": False})
        scenario = self.scenario.model_copy(update={"simulation": plain})
        plan = scenario.plan()
        session = Session(scenario, self.period, plan, marcher(plan, compiled=False))
        none = np.zeros(self.demands)
        first = self.moment_of(session, none)
        after = session.step(none)
        if self.own is None:
            self.check_reward(session.metric(self.metric), after.status != "diverged", after.time)
        else:
            self.reward_gained(first, self.moment_of(session, none))
        return len(self.observation(first))

    def moment_of(self, session: Session, demand: Vector) -> Moment:
        """The next instant of a session, after this demand (2,) or (3,) [N, N m, N]."""
        now, parts = session.observe(), np.zeros(PARTS)
        target = np.zeros(TARGET_SIZE)
        target[: len(TARGET)], target[PSI_D:] = now.target, now.heading
        write_moment(now.state, target, parts)
        return moment(now.time, parts, demand)

    def reward_gained(self, before: Moment, now: Moment) -> Vector:
        """The user's own reward between two moments, a number or one for every run.

        Where no time is between the moments, as the run is terminated or over, what is not finite
        counts as 0: nothing was gained. Raises UsageError for what is no number.
        """
        assert self.own is not None
        with np.errstate(divide="ignore", invalid="ignore"):  # a sentence says so where it matters
            given = self.own(before, now)
        idle = np.equal(before.time, now.time)
        return _finite(given, np.shape(now.time), "reward", now.time, idle)

    def observation(self, now: Moment) -> Vector:
        """What an agent observes of a moment, (numbers,), or (numbers, environments).

        Raises UsageError where the user's function gives no list of numbers.
        """
        if self._observe is None:
            return now.seen.copy()  # of which an agent may make what it likes
        given, shape = self._observe(now), np.shape(now.time)
        parts = list(given) if isinstance(given, Iterable) else []
        if not parts:
            raise UsageError(
                f"podusv.gym: observe gave {given!r}; give a list of numbers, as in [*now.seen]"
            )
        return np.array([_finite(part, shape, "observe", now.time) for part in parts])

    def _check_reward(self, reward: str) -> str:
        """The reward's metric, if it is gathered during a run.

        Raises UsageError for any other name.
        """
        known = gathered_metrics(self.scenario)
        if reward in self.scenario.known_metrics() and reward not in known:
            raise UsageError(
                f"podusv.gym: runs of this scenario do not gather {reward!r} on their way; where a "
                "path is followed, take e_ct_integral in place of iae"
            )
        if reward not in known:
            sentence = unknown_word(f"reward {reward!r}", reward, known, "podusv list")
            raise UsageError(f"podusv.gym: {sentence}")
        return reward

    def _limits(self, given: Limits | None) -> Vector:
        """Largest surge force [N], yaw moment [N m] and, of an actuator with one, sway force [N].

        Shape (2,) or (3,). `given` are the user's own, None for those of the actuator. Raises
        UsageError.
        """
        limits = numbers(self.scenario.actuator.limits() if given is None else given)
        most, example = "surge force and yaw moment", "limits=(8.0, 2.5) [N, N m]"
        if self.demands > OUTPUTS:
            most = "surge force, yaw moment and sway force"
            example = "limits=(8.0, 2.5, 4.0) [N, N m, N]"
        if limits.shape != (self.demands,) or not (limits >= 0.0).all():
            raise UsageError(
                f"podusv.gym: the limits are {given!r}; give the largest {most}, as in {example}"
            )
        if not np.isfinite(limits).all():
            raise UsageError(
                f"podusv.gym: the actuator does not say how large a demand may be; give {example}"
            )
        return limits

    def _check_sweep(self) -> None:
        """Raises UsageError for a grid, or draws of the controller, which is learned here."""
        if self.sweep.grid:
            raise UsageError(
                f"podusv.gym: sweep.grid has several values of {', '.join(self.sweep.grid)}; an "
                "environment has a single cell, so set the value and take the grid out"
            )
        for name, quantity in self.sweep.vary.items():
            for key in quantity.targets(name):
                if key.partition(".")[0] in ("controller", "controllers"):
                    raise UsageError(
                        f"podusv.gym: sweep.vary.{name} draws {key}, and in an environment the "
                        f"controller is learned; take it out with sweep.vary: {{{name}: null}}"
                    )

    def observed_bounds(self) -> Vector:
        """The largest magnitude of each number of an observation (numbers,).

        Of the usual one pi comes last.
        """
        most = np.full(self.numbers, np.inf)
        if self._observe is None:
            most[-1] = np.pi  # an angle
        return most

    def seed(self, given: Any) -> int:
        """A seed as a number: that of a draw, from 0 on.

        Raises UsageError for anything else, and beyond the last Sobol' point.
        """
        if (number := whole(given)) < 0:
            raise UsageError(f"podusv.gym: the seed is {given!r}; give a whole number from 0 on")
        if not self.sweep.independent and number >= 2**SOBOL_BITS:
            raise UsageError(
                f"podusv.gym: the seed is {number}; Sobol' points have numbers up to "
                f"{2**SOBOL_BITS - 1}"
            )
        return number

    def draw_scenario(self, seed: int | None, random: np.random.Generator) -> Scenario:
        """The scenario with the draw of a study whose number is `seed`.

        Without one, a draw of no study. Draws of no study are independent, also where those of the
        study are Sobol' points.
        """
        if seed is not None:
            return draw_scenario(
                self.scenario, self.sweep.vary, next(draws(self.sweep, seed, 1, SWEEP))
            )
        sweep = self.sweep.model_copy(update={"design": "random"})
        # The number of the draw is itself random, in a stream (LEARNING) that no study has.
        draw = next(draws(sweep, int(random.integers(2**53)), 1, LEARNING))
        return draw_scenario(self.scenario, sweep.vary, draw)

    def check_reward(self, gathered: Vector | float, alive: Flags | bool, time: float) -> None:
        """Raise UsageError for a metric (`gathered`) that is not defined at this time [s].

        It may be infinite for a run that is not `alive`: its numbers are not finite any more.
        """
        if (np.isnan(gathered) | np.isinf(gathered) & alive).any():
            raise UsageError(
                f"podusv.gym: the metric {self.metric} is not defined at {time:g} s; a reward "
                "needs one that is at every instant, such as iae"
            )


def _finite(
    given: Any, shape: tuple[int, ...], whose: str, time: Any, idle: Flags | bool = False
) -> Vector:
    """Numbers `given` by a user's function in this shape, also where all runs share them.

    `whose` names the function in the message, and `time` [s] is when it was called. Numbers of
    `idle` runs may be NaN or infinite, and are 0 then. Raises UsageError.
    """
    try:
        array = np.broadcast_to(numbers(given), shape)
        array = np.where(idle & ~np.isfinite(array), 0.0, array)
        fine = bool(np.isfinite(array).all())
    except ValueError:
        fine = False
    if not fine:
        each = f", or {shape[0]} of them" if shape else ""
        raise UsageError(
            f"podusv.gym: {whose} gave {given!r} at {np.max(time):g} s; give finite numbers{each}"
        )
    return array


def whole(given: Any) -> int:
    """A whole number as Python's own; -1 for what is none."""
    try:
        return index(given)
    except TypeError:
        return -1


def numbers(given: Any) -> Vector:
    """Numbers as an array; an empty one for what are none."""
    try:
        return np.asarray(given, float)
    except (TypeError, ValueError):
        return np.zeros(0)
