"""Runs that wait for demands: a session, an environment of Gymnasium, and several side by side."""

from __future__ import annotations

from collections.abc import Callable
from time import process_time
from typing import Any

import numpy as np

import podusv
import podusv.gym
from benchmarks.timing import in_turns, quartiles, ratio, timed

SCENARIO = {
    "extends": "podusv:mu_2017/corrected.yaml",
    "control": {"period": 0.1},
    "simulation": {"duration": 20.0},
    "sweep": {"vary": {"start.x": {"uniform": [-15.0, 15.0]}}},
}
STEPS = 200  # in an episode, of ten integration steps each
BESIDE = 8  # environments, one of each march
MANY = 64


def _session() -> Callable[[], Any]:
    """A function that goes through an episode from its begin."""
    session = podusv.open_session({**SCENARIO, "sweep": None})
    begin, demand = session.state(), (2.0, 0.1)

    def episode() -> None:
        session.restore(begin)
        for _ in range(STEPS):
            session.step(demand)

    return episode


def _singles() -> Callable[[], Any]:
    environments, action = [podusv.gym.Env(SCENARIO) for _ in range(BESIDE)], np.array([2.0, 0.1])

    def episodes() -> None:
        for i, env in enumerate(environments):
            env.reset(seed=i)
            for _ in range(STEPS):
                env.step(action)

    return episodes


def _beside(count: int) -> Callable[[], Any]:
    env, actions = podusv.gym.VectorEnv(SCENARIO, count=count), np.tile([2.0, 0.1], (count, 1))

    def episodes() -> None:
        env.reset(seed=0)
        for _ in range(STEPS):
            env.step(actions)

    return episodes


def step_costs(rounds: int = 7) -> dict[str, Any]:
    """Processor time of a control step [s], with its share of the episode's begin."""
    timers = {
        "a session": (_session(), 1),
        "8 environments, one after another": (_singles(), BESIDE),
        "8 environments side by side": (_beside(BESIDE), BESIDE),
        "64 environments side by side": (_beside(MANY), MANY),
    }
    times = in_turns(
        {name: timed(work, 1, process_time) for name, (work, _) in timers.items()}, rounds
    )
    each = {name: times[name] / (count * STEPS) for name, (_, count) in timers.items()}
    single = "8 environments, one after another"
    return {
        name: {"seconds": quartiles(each[name]), "faster": ratio(each, single, name)}
        for name in timers
    }
