"""Scenarios as environments of Gymnasium, in which a controller is learned."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import LANES, Vector
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.batch import BatchRun
from podusv_cli.engine.running.lanes import LaneSorter, why_alone
from podusv_cli.engine.running.simulate import marcher, ready
from podusv_cli.engine.running.stepped import SteppedBatch
from podusv_cli.interface.border import with_short_traceback
from podusv_cli.interface.gym_task import (
    PARTS,
    EpisodeTask,
    Flags,
    Limits,
    Moment,
    Terms,
    moment,
    numbers,
    whole,
    write_moment,
)
from podusv_cli.interface.scenarios import Changes, Source
from podusv_cli.interface.session import DEMANDED, FIRST, Session, wanted_numbers

try:
    import gymnasium
    from gymnasium.spaces import Box
    from gymnasium.utils import EzPickle
    from gymnasium.vector import AutoresetMode
    from gymnasium.vector.utils import batch_space
except ImportError as error:
    raise ImportError("podusv.gym needs Gymnasium: pip install 'podusv[gym]'") from error

Info = dict[str, Any]
Reward = str | Callable[[Moment, Moment], Any]
Observe = Callable[[Moment], Any]


def demands(task: EpisodeTask) -> Any:
    """The space of actions: (tau_u [N], tau_r [N m]), maybe with tau_v [N], within limits."""
    return Box(-task.limits, task.limits, dtype=np.float64)


def observations(task: EpisodeTask) -> Any:
    """The space of observations: eight numbers, or as many as the user's function gives."""
    most = task.observed_bounds()
    return Box(-most, most, dtype=np.float64)


class Env(gymnasium.Env[Vector, Vector], EzPickle):
    """A scenario as an environment of Gymnasium: an agent in place of its controller.

    An action is a demand (tau_u [N], tau_r [N m]), of an actuator that takes a sway force
    (tau_u, tau_r, tau_v [N]), that holds for `period` [s], by default `control.period`; `limits`
    are its largest numbers, by default the actuator's. An observation
    has eight numbers in the vessel's own frame: the target ahead and to starboard [m], u, v [m/s],
    r [rad/s], the target's velocity ahead and to starboard [m/s], and the heading error [rad]. A
    reward is what the metric `reward` grew by, from the instant of an action to that of the next,
    with a minus: the rewards of an episode add up to minus the metric of its run. An episode is
    truncated when `simulation.duration` is over, and terminated where a number is not finite.

    Both may be functions of your own: `reward(before, now)` gives a number of the moments between
    which the action held, `observe(now)` a list of numbers of a `Moment`. Written with numpy, they
    serve `VectorEnv`, too. Where a number is not finite, `now` has the last numbers that were, and
    their time; a reward that is not finite then, as over the time that has passed, counts as 0.

    `reset(seed=i)` begins the run of draw i of the scenario's `sweep.vary`, as `podusv sweep` has
    it; `reset()` one that no study has. `session` is the run under way, and its `close("folder")`
    writes it as a run folder. An environment that is pickled is the same one before its first
    episode. Raises ScenarioError, and UsageError for what no environment can be made of.

    >>> import podusv.gym
    >>> env = podusv.gym.Env("podusv:mu_2017/corrected.yaml", period=0.1)
    >>> seen, _ = env.reset(seed=0)
    >>> seen, reward, terminated, truncated, info = env.step((8.0, 0.5))
    >>> seen.shape, terminated, truncated, info
    ((8,), False, False, {'time': 0.1})
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - as Gymnasium's own class

    def __init__(
        self,
        source: Source,
        changes: Changes | None = None,
        *,
        period: float | None = None,
        reward: Reward = "iae",
        observe: Observe | None = None,
        limits: Limits | None = None,
    ) -> None:
        """Check the task and compile its loop; the first episode begins with `reset`.

        Arguments are described at the class.
        """
        terms = Terms(period, reward, observe, limits)
        self._task = task = EpisodeTask(source, changes, terms)
        EzPickle.__init__(self, task.whole, **terms._asdict())
        self.action_space, self.observation_space = demands(task), observations(task)
        plan, compiled = task.scenario.plan(), task.scenario.simulation.compiled
        ready(plan, compiled)
        self._march = marcher(plan, compiled)
        self._session: Session | None = None
        self._now: Moment
        self._gathered = 0.0

    @property
    def session(self) -> Session:
        """The run under way. Raises UsageError before the first `reset`."""
        if self._session is None:
            raise UsageError("podusv.gym: no episode has begun; call reset first")
        return self._session

    @with_short_traceback
    def reset(self, *, seed: int | None = None, options: Info | None = None) -> tuple[Vector, Info]:
        """Begin a run; its first observation (numbers,) and its time, {"time": 0.0} [s].

        `seed` is the number of a draw, see the class. `options` change nothing.
        """
        seed = None if seed is None else self._task.seed(seed)
        # It seeds the generator that draws without a number come from.
        super().reset(seed=seed)
        scenario = self._task.draw_scenario(seed, self.np_random)
        self._session = session = Session(scenario, self._task.period, scenario.plan(), self._march)
        self._now, self._gathered = self._task.moment_of(session, np.zeros(self._task.demands)), 0.0
        return self._task.observation(self._now), {"time": 0.0}

    @with_short_traceback
    def step(self, action: Vector) -> tuple[Vector, float, bool, bool, Info]:
        """Hold a demand for a period: observation, reward, terminated, truncated, and the time [s].

        Raises UsageError for a demand that is not so many finite numbers, and after an episode's
        end.
        """
        session, task = self.session, self._task
        if session.status != "running":
            raise UsageError("podusv.gym: the episode is over; call reset")
        after, before = session.step(action), self._now
        dead, cut = after.status == "diverged", after.status == "finished"
        # No number of a terminated run is sure to be finite: the moment before it stands.
        self._now = before if dead else task.moment_of(session, numbers(action))
        reward = (
            float(task.reward_gained(before, self._now))
            if task.own
            else self._reward_grown(not dead)
        )
        return task.observation(self._now), reward, dead, cut, {"time": after.time}

    def _reward_grown(self, alive: bool) -> float:
        """What the metric grew by in this period, with a minus.

        `alive` if all numbers are finite.
        """
        session, task, before = self.session, self._task, self._gathered
        self._gathered = session.metric(task.metric)
        task.check_reward(self._gathered, alive, session.observe().time)
        return before - self._gathered


class VectorEnv(gymnasium.vector.VectorEnv[Vector, Vector, Any], EzPickle):
    """`count` environments like `Env`, whose runs march side by side: a march for eight of them.

    Runs that share a march have the same time. When their episodes end, the next `step` begins
    others without looking at the actions, as Gymnasium's `AutoresetMode.NEXT_STEP` says. Where one
    of them is terminated, the others of its march are truncated. `reset(seed=i)` takes the draws
    i, i + 1, ... of a study, `reset(seed=[...])` these; `reset()`, and what begins by itself, takes
    draws that no study has. Runs are not logged. Raises as `Env`, and UsageError for parts that
    cannot march side by side.
    """

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(
        self,
        source: Source,
        changes: Changes | None = None,
        *,
        count: int = LANES,
        period: float | None = None,
        reward: Reward = "iae",
        observe: Observe | None = None,
        limits: Limits | None = None,
    ) -> None:
        """Check the task and plan marches of several runs; the first episodes begin with `reset`.

        Arguments are described at the class. Raises UsageError where runs cannot march side by
        side.
        """
        # Gymnasium's own vectors take a number second; here it would be taken for changes.
        if whole(changes) >= 0:
            raise UsageError(f"podusv.gym: {changes} stands for `changes`; write count={changes}")
        if (number := whole(count)) < 1:
            raise UsageError(f"podusv.gym: count is {count!r}; give a whole number from 1 on")
        terms = Terms(period, reward, observe, limits)
        self._task = task = EpisodeTask(source, changes, terms)
        EzPickle.__init__(self, task.whole, count=number, **terms._asdict())
        self.num_envs = count = number
        self.single_action_space, self.single_observation_space = demands(task), observations(task)
        self.action_space = batch_space(self.single_action_space, count)
        self.observation_space = batch_space(self.single_observation_space, count)
        self._metrics, grid = task.scenario.probe(), task.scenario.time_grid()
        # No log: one row, at the start.
        grid = replace(grid, log_every=grid.steps + 1)
        plan = Plan.with_probe(task.scenario.closed_loop(), grid, self._metrics)
        if why := why_alone(plan):
            raise UsageError(
                f"podusv.gym: these runs cannot march side by side ({why}); take Gymnasium's "
                "SyncVectorEnv of podusv.gym.Env"
            )
        self._plan, self._sorter = plan, LaneSorter(0, True)
        self._sorter.choose(plan)
        self._marches: list[SteppedBatch] = []
        self._parts, self._demands = np.zeros((PARTS, count)), np.zeros((task.demands, count))
        # A terminated run's moment is the last one that was, and earlier than where it ended.
        self._times, self._ends, self._gathered = np.zeros((3, count))

    @with_short_traceback
    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: Info | None = None
    ) -> tuple[Vector, Info]:
        """Begin a run in every environment; first observations (environments, numbers) and times.

        `seed` is the first of as many numbers of draws, or one for each. `options` change nothing.
        """
        seeds = self._seeds(seed)
        # The base class has one generator for all environments.
        super().reset(seed=seeds[0])
        self._marches = self._begin_runs(range(self.num_envs), seeds)
        return self._observe()

    @with_short_traceback
    def step(self, actions: Vector) -> tuple[Vector, Vector, Flags, Flags, Info]:
        """As `Env.step`, for all environments: arrays with a row, or an entry, for each of them.

        `actions` have the shape (environments, demands). Raises UsageError for demands that are not
        so many finite numbers each; no run goes on then.
        """
        given, ended = (
            self._check_actions(actions).T,
            [march for march in self._marches if march.over],
        )
        # Before anything moves: the arrays of which it is made are written in place.
        before = self._moment() if self._task.own else None
        self._marches = [march for march in self._marches if not march.over]
        dead, cut = np.zeros((2, self.num_envs), bool)
        for march in self._marches:
            # The demand of this period, in the schedule that stands for the law.
            march.law_table[FIRST : FIRST + len(given)] = given[:, march.places]
            march.advance(march.grid.hold_every)
            going = np.array(march.places)[march.alive]
            self._demands[:, going] = given[:, going]
            dead[march.places], cut[march.places] = ~march.alive, march.over & march.alive
            self._look(march)
        rewards = self._own_rewards(before) if before else self._rewards()
        again = [place for march in ended for place in march.places]
        self._marches += self._begin_runs(again, [None] * len(again))
        seen, info = self._observe()
        return seen, rewards, dead, cut, info

    def _own_rewards(self, before: Moment) -> Vector:
        """Rewards (environments,) of the user's function, 0 for runs that did not go on."""
        going = [place for march in self._marches for place in march.places]
        rewards = np.zeros(self.num_envs)
        rewards[going] = self._task.reward_gained(before, self._moment())[going]
        return rewards

    def _rewards(self) -> Vector:
        """Rewards (environments,): minus what the metric grew by since the last call."""
        rewards = np.zeros(self.num_envs)
        for march in self._marches:
            gathered = self._metrics.one(self._task.metric, march.gathered_so_far())
            self._task.check_reward(gathered, march.alive, march.time)
            rewards[march.places] = self._gathered[march.places] - gathered
            self._gathered[march.places] = gathered
        return rewards

    def _begin_runs(self, places: Sequence[int], seeds: Sequence[int | None]) -> list[SteppedBatch]:
        """Begin runs in the environments `places`, and return the marches they are sorted into.

        A march has as many runs as go side by side. `seeds` are numbers of draws, None for a draw
        that no study has.
        """
        groups, advance = [], self._sorter.advance
        assert advance is not None
        for place, seed in zip(places, seeds, strict=True):
            loop = self._task.draw_scenario(seed, self.np_random).closed_loop()
            run = BatchRun.of(place, self._plan.like(loop))
            groups.append(self._sorter.sort_in(run.vectors, run))
        # Incomplete marches, too.
        groups += self._sorter.rest()
        self._gathered[places] = 0.0
        self._demands[:, places] = 0.0
        begun = [SteppedBatch(self._plan, g, advance, write_moment, PARTS) for g in groups if g]
        for march in begun:
            self._look(march)
        return begun

    def _look(self, march: SteppedBatch) -> None:
        """Take in the next instant of a march's runs.

        A terminated run keeps its last finite numbers.
        """
        places = np.array(march.places)[march.alive]
        self._parts[:, places] = march.view()[:, march.alive]
        self._times[places], self._ends[march.places] = march.time, march.times()

    def _moment(self) -> Moment:
        return moment(self._times.copy(), self._parts, self._demands)

    def _observe(self) -> tuple[Vector, Info]:
        """What all see, and the time of every run [s]."""
        now = self._moment()
        info = {"time": self._ends.copy(), "_time": np.ones(self.num_envs, bool)}
        return self._task.observation(now).T.copy(), info

    def _check_actions(self, actions: Vector) -> Vector:
        """Actions as numbers (environments, 2 or 3) [N, N m, N]. Raises UsageError."""
        if not self._marches:
            raise UsageError("podusv.gym: no episode has begun; call reset first")
        given = numbers(actions)
        wanted = wanted_numbers(DEMANDED[: self._task.demands])
        if given.shape != (self.num_envs, self._task.demands):
            raise UsageError(
                f"podusv.gym: the actions have shape {given.shape}; give {self.num_envs} rows of "
                f"{wanted}"
            )
        if (wrong := np.flatnonzero(~np.isfinite(given).all(axis=1))).size:
            raise UsageError(
                f"podusv.gym: the action of environment {wrong[0]} is "
                f"{tuple(given[wrong[0]].tolist())}; give {wanted}"
            )
        return given

    def _seeds(self, given: Any) -> Sequence[int | None]:
        """A draw's number for every environment, None for one of no study. Raises UsageError.

        `given` is None, the first of as many numbers, or one for each.
        """
        if given is None:
            return [None] * self.num_envs
        if not np.ndim(given):
            first = self._task.seed(given)
            return range(first, first + self.num_envs)
        each = list(given)
        if len(each) != self.num_envs:
            raise UsageError(
                f"podusv.gym: {len(each)} seeds for {self.num_envs} environments; give "
                f"{self.num_envs}"
            )
        return [None if number is None else self._task.seed(number) for number in each]
