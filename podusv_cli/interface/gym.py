"""Scenarios as environments of Gymnasium, in which a controller is learned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from operator import index
from typing import Any

import numpy as np
import numpy.typing as npt

from podusv_cli.components.controllers.policy import INPUTS, OUTPUTS, observed
from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import LANES, Vector
from podusv_cli.core.phrases import unknown
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.batch import BatchRun
from podusv_cli.engine.running.lanes import LaneSorter, why_alone
from podusv_cli.engine.running.stepped import SteppedBatch
from podusv_cli.interface.border import explained
from podusv_cli.interface.scenarios import CHECKS, Changes, Source, loaded
from podusv_cli.interface.session import DEMAND, Session, marcher_of, waiting
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.sweep import Sweep
from podusv_cli.studies.making.check import gathered_metrics, sweep_faults
from podusv_cli.studies.making.draws import SOBOL_BITS, SWEEP, drawn, draws

try:
    import gymnasium
    from gymnasium.spaces import Box
    from gymnasium.vector import AutoresetMode
    from gymnasium.vector.utils import batch_space
except ImportError as error:
    raise ImportError("podusv.gym needs Gymnasium: pip install 'podusv[gym]'") from error

LEARNING = "learning"  # the stream of draws that no study has
Info = dict[str, Any]
Flags = npt.NDArray[np.bool_]
Limits = tuple[float, float]


class Task:
    """What the episodes of an environment have in common: a scenario, and what is drawn in it."""

    def __init__(
        self, source: Source, changes: Changes | None, period: float | None, reward: str,
        limits: Limits | None,
    ) -> None:  # fmt: skip
        """Raises ScenarioError, and UsageError for what no environment can be made of."""
        whole = loaded(source, changes, (*CHECKS, sweep_faults)).scenario
        self.sweep = whole.sweep or Sweep(draws=1)
        self._check_sweep()
        self.scenario, self.period = waiting(whole, period)
        self.reward, self.limits = self._known(str(reward)), self._limits(limits)
        self._check_first()

    def _check_first(self) -> None:
        """Raise UsageError for a reward that the first period does not define."""
        plain = self.scenario.simulation.model_copy(update={"compiled": False})
        scenario = self.scenario.model_copy(update={"simulation": plain})
        session = Session(scenario, self.period, marcher_of(scenario))
        after = session.step(np.zeros(OUTPUTS))
        self.check_reward(session.metric(self.reward), after.status != "diverged", after.time)

    def _known(self, reward: str) -> str:
        known = gathered_metrics(self.scenario)
        if reward in self.scenario.known_metrics() and reward not in known:
            raise UsageError(
                f"podusv.gym: runs of this scenario do not gather {reward!r} on their way; where a "
                "path is followed, take e_ct_integral in place of iae"
            )
        if reward not in known:
            sentence = unknown(f"reward {reward!r}", reward, known, "podusv list")
            raise UsageError(f"podusv.gym: {sentence}")
        return reward

    def _limits(self, given: Limits | None) -> Vector:
        limits = numbers(self.scenario.actuator.limits() if given is None else given)
        if limits.shape != (OUTPUTS,) or not (limits >= 0.0).all():
            raise UsageError(
                f"podusv.gym: the limits are {given!r}; give the largest surge force and yaw "
                "moment, as in limits=(8.0, 2.5) [N, N m]"
            )
        if not np.isfinite(limits).all():
            raise UsageError(
                "podusv.gym: the actuator does not say how large a demand may be; give "
                "limits=(8.0, 2.5) [N, N m]"
            )
        return limits

    def _check_sweep(self) -> None:
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

    def seed(self, given: Any) -> int:
        """A seed, which is the number of a draw. Raises UsageError."""
        if (number := whole(given)) < 0:
            raise UsageError(f"podusv.gym: the seed is {given!r}; give a whole number from 0 on")
        if not self.sweep.independent and number >= 2**SOBOL_BITS:
            raise UsageError(
                f"podusv.gym: the seed is {number}; Sobol' points have numbers up to "
                f"{2**SOBOL_BITS - 1}"
            )
        return number

    def drawn(self, seed: int | None, random: np.random.Generator) -> Scenario:
        """The scenario with the draw of a study whose number is the seed, or with one of no study.

        Draws of no study are independent, also where those of the study are Sobol' points.
        """
        if seed is not None:
            return drawn(self.scenario, self.sweep.vary, next(draws(self.sweep, seed, 1, SWEEP)))
        sweep = self.sweep.model_copy(update={"design": "random"})
        draw = next(draws(sweep, int(random.integers(2**53)), 1, LEARNING))
        return drawn(self.scenario, sweep.vary, draw)

    def check_reward(self, gathered: Vector | float, alive: Flags | bool, time: float) -> None:
        """Raise UsageError for a metric that is not defined at this time [s].

        It may be infinite for a run whose numbers are not finite any more.
        """
        if (np.isnan(gathered) | np.isinf(gathered) & alive).any():
            raise UsageError(
                f"podusv.gym: the metric {self.reward} is not defined at {time:g} s; a reward "
                "needs one that is at every instant, such as iae"
            )

    def action_space(self) -> Any:
        """Demands (tau_u [N], tau_r [N m]) within the actuator's limits."""
        return Box(-self.limits, self.limits, dtype=np.float64)

    def observation_space(self) -> Any:
        """As `OBSERVED`; the last number is an angle."""
        high = np.append(np.full(INPUTS - 1, np.inf), np.pi)
        return Box(-high, high, dtype=np.float64)


class Env(gymnasium.Env[Vector, Vector]):
    """A scenario as an environment of Gymnasium: an agent in place of its controller.

    An action is a demand (tau_u [N], tau_r [N m]) that holds for `period` [s], by default
    `control.period`; `limits` are its largest numbers, by default the actuator's. An observation
    has eight numbers in the vessel's own frame: the target ahead and to starboard [m], u, v [m/s],
    r [rad/s], the target's velocity ahead and to starboard [m/s], and the heading error [rad]. A
    reward is what the metric `reward` grew by, from the instant of an action to that of the next,
    with a minus: the rewards of an episode add up to minus the metric of its run. An episode is
    truncated when `simulation.duration` is over, and terminated where a number is not finite.

    `reset(seed=i)` begins the run of draw i of the scenario's `sweep.vary`, as `podusv sweep` has
    it; `reset()` one that no study has. `session` is the run under way, and its `close("folder")`
    writes it as a run folder. Raises ScenarioError, and UsageError for what no environment can be
    made of.

    >>> import podusv.gym
    >>> env = podusv.gym.Env("podusv:mu_2017/corrected.yaml", period=0.1)
    >>> seen, _ = env.reset(seed=0)
    >>> seen, reward, terminated, truncated, info = env.step((8.0, 0.5))
    >>> seen.shape, terminated, truncated, info
    ((8,), False, False, {'time': 0.1})
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - as Gymnasium's own class

    def __init__(
        self, source: Source, changes: Changes | None = None, *, period: float | None = None,
        reward: str = "iae", limits: Limits | None = None,
    ) -> None:  # fmt: skip
        """No episode has begun."""
        self._task = Task(source, changes, period, reward, limits)
        self.action_space = self._task.action_space()
        self.observation_space = self._task.observation_space()
        self._task.scenario.ready()
        self._march = marcher_of(self._task.scenario)
        self._session: Session | None = None
        self._gathered = 0.0

    @property
    def session(self) -> Session:
        """The run under way. Raises UsageError before the first `reset`."""
        if self._session is None:
            raise UsageError("podusv.gym: no episode has begun; call reset first")
        return self._session

    @explained
    def reset(
        self, *, seed: int | None = None, options: Info | None = None
    ) -> tuple[Vector, Info]:  # fmt: skip
        """Begin a run; see the class. `options` change nothing."""
        seed = None if seed is None else self._task.seed(seed)
        super().reset(seed=seed)
        scenario = self._task.drawn(seed, self.np_random)
        self._session = Session(scenario, self._task.period, self._march)
        self._gathered = 0.0
        return self._seen(), {"time": 0.0}

    @explained
    def step(self, action: Vector) -> tuple[Vector, float, bool, bool, Info]:
        """Hold a demand for a period: observation, reward, terminated, truncated, and the time [s].

        Raises UsageError for a demand that is not two finite numbers, and after an episode's end.
        """
        session, task = self.session, self._task
        if session.status != "running":
            raise UsageError("podusv.gym: the episode is over; call reset")
        after = session.step(action)
        gathered = session.metric(task.reward)
        ended = after.status == "diverged", after.status == "finished"
        task.check_reward(gathered, not ended[0], after.time)
        reward, self._gathered = self._gathered - gathered, gathered
        return self._seen(), reward, *ended, {"time": after.time}

    def _seen(self) -> Vector:
        now, seen = self.session.observe(), np.zeros(INPUTS)
        observed(now.state, now.target, seen)
        return seen


class VectorEnv(gymnasium.vector.VectorEnv[Vector, Vector, Any]):
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
        self, source: Source, changes: Changes | None = None, *, count: int = LANES,
        period: float | None = None, reward: str = "iae", limits: Limits | None = None,
    ) -> None:  # fmt: skip
        """No episode has begun."""
        if (number := whole(count)) < 1:
            raise UsageError(f"podusv.gym: count is {count!r}; give a whole number from 1 on")
        self._task = task = Task(source, changes, period, reward, limits)
        self.num_envs = count = number
        self.single_action_space = task.action_space()
        self.single_observation_space = task.observation_space()
        self.action_space = batch_space(self.single_action_space, count)
        self.observation_space = batch_space(self.single_observation_space, count)
        self._metrics, grid = task.scenario.probe(), task.scenario.time_grid()
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
        self._views = np.zeros((INPUTS, count))
        self._times, self._gathered = np.zeros((2, count))

    @explained
    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: Info | None = None
    ) -> tuple[Vector, Info]:
        """Begin a run in every environment; `options` change nothing."""
        seeds = self._seeds(seed)
        super().reset(seed=seeds[0])
        self._marches = self._begun(range(self.num_envs), seeds)
        return self._observed()

    @explained
    def step(self, actions: Vector) -> tuple[Vector, Vector, Flags, Flags, Info]:
        """As `Env.step`, for all environments: arrays with a row, or an entry, for each of them.

        Raises UsageError for demands that are not two finite numbers each; no run goes on then.
        """
        demands, ended = self._checked(actions).T, [march for march in self._marches if march.over]
        self._marches = [march for march in self._marches if not march.over]
        dead, cut = np.zeros((2, self.num_envs), bool)
        for march in self._marches:
            march.law_table[DEMAND] = demands[:, march.places]
            march.advance(march.grid.hold_every)
            dead[march.places], cut[march.places] = ~march.alive, march.over & march.alive
        rewards = self._rewards()
        again = [place for march in ended for place in march.places]
        self._marches += self._begun(again, [None] * len(again))
        seen, info = self._observed()
        return seen, rewards, dead, cut, info

    def _rewards(self) -> Vector:
        """What runs gained since they were asked last."""
        rewards = np.zeros(self.num_envs)
        for march in self._marches:
            gathered = self._metrics.one(self._task.reward, march.seen())
            self._task.check_reward(gathered, march.alive, march.time)
            rewards[march.places] = self._gathered[march.places] - gathered
            self._gathered[march.places] = gathered
        return rewards

    def _begun(self, places: Sequence[int], seeds: Sequence[int | None]) -> list[SteppedBatch]:
        """Runs for these environments, in marches."""
        groups, advance = [], self._sorter.advance
        assert advance is not None
        for place, seed in zip(places, seeds, strict=True):
            loop = self._task.drawn(seed, self.np_random).closed_loop()
            run = BatchRun.of(place, self._plan.like(loop))
            groups.append(self._sorter.sorted(run.vectors, run))
        groups += self._sorter.rest()
        self._gathered[places] = 0.0
        return [SteppedBatch(self._plan, g, advance, observed, INPUTS) for g in groups if g]

    def _observed(self) -> tuple[Vector, Info]:
        """What all see, where a run is terminated what it saw last; the time of every run [s]."""
        for march in self._marches:
            places = np.array(march.places)[march.alive]
            self._views[:, places] = march.view()[:, march.alive]
            self._times[march.places] = march.time
        info = {"time": self._times.copy(), "_time": np.ones(self.num_envs, bool)}
        return self._views.T.copy(), info

    def _checked(self, actions: Vector) -> Vector:
        if not self._marches:
            raise UsageError("podusv.gym: no episode has begun; call reset first")
        demands = numbers(actions)
        if demands.shape != (self.num_envs, OUTPUTS):
            raise UsageError(
                f"podusv.gym: the actions have shape {demands.shape}; give {self.num_envs} rows of "
                "two finite numbers, tau_u [N] and tau_r [N m]"
            )
        if (wrong := np.flatnonzero(~np.isfinite(demands).all(axis=1))).size:
            raise UsageError(
                f"podusv.gym: the action of environment {wrong[0]} is "
                f"{tuple(demands[wrong[0]].tolist())}; give two finite numbers, tau_u [N] and "
                "tau_r [N m]"
            )
        return demands

    def _seeds(self, given: Any) -> Sequence[int | None]:
        """A seed for every environment. Raises UsageError."""
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
