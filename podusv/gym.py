"""Scenarios as environments of Gymnasium; needs `pip install 'podusv[gym]'`.

Importing it tells Gymnasium their name, and `gymnasium.make("podusv.gym:podusv/Scenario-v0", ...)`
imports it.
"""

from typing import Any

from gymnasium.envs.registration import register, registry

from podusv_cli.interface.gym import Env as Env
from podusv_cli.interface.gym import VectorEnv as VectorEnv

__all__ = ["Env", "VectorEnv"]
NAME = "podusv/Scenario-v0"


def environment(scenario: Any, **options: Any) -> Env:
    """What `gymnasium.make` makes by the name; options are those of Env."""
    return Env(scenario, **options)


def environments(num_envs: int, scenario: Any, **options: Any) -> VectorEnv:
    """The same for `gymnasium.make_vec`."""
    return VectorEnv(scenario, count=num_envs, **options)


if NAME not in registry:  # a module may be imported again
    register(
        NAME, entry_point="podusv.gym:environment", vector_entry_point="podusv.gym:environments"
    )
