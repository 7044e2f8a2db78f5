"""Scenarios as environments of Gymnasium; needs `pip install 'podusv[gym]'`."""

from typing import Any

from podusv.environments import register
from podusv_cli.interface.gym import Env as Env
from podusv_cli.interface.gym import VectorEnv as VectorEnv

__all__ = ["Env", "VectorEnv"]


def environment(scenario: Any, **options: Any) -> Env:
    """What `gymnasium.make("podusv/Scenario-v0", scenario=...)` makes; options are those of Env."""
    return Env(scenario, **options)


def environments(num_envs: int, scenario: Any, **options: Any) -> VectorEnv:
    """The same for `gymnasium.make_vec`."""
    return VectorEnv(scenario, count=num_envs, **options)


register()
