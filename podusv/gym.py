"""Scenarios as environments of Gymnasium; needs `pip install 'podusv[gym]'`.

Importing it tells Gymnasium their names; `gymnasium.make("podusv.gym:podusv/Track-v0")` imports it.
"""

from typing import Any

from gymnasium.envs.registration import register, registry

from podusv_cli.interface.gym import Env as Env
from podusv_cli.interface.gym import VectorEnv as VectorEnv
from podusv_cli.interface.gym_task import Moment as Moment

__all__ = ["Env", "Moment", "VectorEnv"]
# What each name gives in place of options that are not given.
NAMES: dict[str, dict[str, Any]] = {
    "podusv/Scenario-v0": {},
    "podusv/Track-v0": {"scenario": "podusv:studies/learned.yaml", "period": 0.2},
}


def environment(scenario: Any, **options: Any) -> Env:
    """What `gymnasium.make` makes by the name; options are those of Env."""
    return Env(scenario, **options)


def environments(num_envs: int, scenario: Any, **options: Any) -> VectorEnv:
    """The same for `gymnasium.make_vec`."""
    return VectorEnv(scenario, count=num_envs, **options)


for name in {*NAMES} - {*registry}:  # a module may be imported again
    register(
        name,
        entry_point="podusv.gym:environment",
        vector_entry_point="podusv.gym:environments",
        kwargs=NAMES[name],
    )
