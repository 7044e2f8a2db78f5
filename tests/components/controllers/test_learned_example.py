"""examples/learned/ppo.py: what its network asks for is what the law `policy` asks for."""

from __future__ import annotations

import runpy
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from command_samples import ROOT
from policy_samples import content

import podusv
from podusv_cli.components.controllers.policy import INPUTS, Policy, observe
from podusv_cli.core.kernel import Vector, bundle, call

pytest.importorskip("gymnasium", reason="Gymnasium is not installed: podusv[gym]")
pytest.importorskip("safetensors", reason="safetensors is not installed: podusv[gym]")
import podusv.gym

ppo = SimpleNamespace(**runpy.run_path(str(ROOT / "examples/learned/ppo.py")))


def demand(law: Policy, x: Vector, target: Vector) -> Vector:
    """What the law asks for."""
    tau, work = np.zeros(2), np.zeros(law.workspace())
    k = bundle(law.constants())
    call(law.law, x=x, target=target, k=k, table=law.table(), tau=tau, work=work)
    return tau


def actor(random: np.random.Generator) -> dict[str, Any]:
    """Arrays as PPO's `policy.state_dict()` names them, those of the critic among them."""
    sizes = {
        "mlp_extractor.policy_net.0": (8, 32),
        "mlp_extractor.policy_net.2": (32, 32),
        "mlp_extractor.value_net.0": (8, 32),
        "mlp_extractor.value_net.2": (32, 32),
        "action_net": (32, 2),
        "value_net": (32, 1),
    }
    arrays = {"log_std": np.zeros(2)}
    for name, (before, after) in sizes.items():
        arrays[f"{name}.weight"] = random.normal(0.0, before**-0.5, (after, before))
        arrays[f"{name}.bias"] = random.normal(0.0, 0.3, after)
    return arrays


def test_the_law_asks_for_what_the_actor_does() -> None:
    """The actor in plain numpy: (o - mean)/sqrt(variance + 1e-8), two layers of tanh, cut off."""
    random = np.random.default_rng(4)
    arrays, mean, variance = actor(random), random.normal(size=8), random.uniform(0.1, 4.0, 8)
    law = Policy(content=content(ppo.tensors(arrays, mean, variance)), squash="clip")
    cut = 0
    for _ in range(50):
        x, target, seen = random.normal(size=6), random.normal(0.0, 3.0, 6), np.zeros(INPUTS)
        observe(x, target, seen)
        h = (seen - mean) / np.sqrt(variance + 1e-8)
        for layer in (0, 2):
            name = f"mlp_extractor.policy_net.{layer}"
            h = np.tanh(arrays[f"{name}.weight"] @ h + arrays[f"{name}.bias"])
        action = arrays["action_net.weight"] @ h + arrays["action_net.bias"]
        cut += np.abs(action).max() > 1.0
        wanted = np.clip(action, -1.0, 1.0) * [8.0, 2.5]
        np.testing.assert_allclose(demand(law, x, target), wanted, rtol=0, atol=1e-13)
    assert 0 < cut < 50


def test_limits_of_the_task_are_those_of_the_law() -> None:
    arrays = ppo.tensors(actor(np.random.default_rng(0)), np.zeros(8), np.ones(8))
    env, law = ppo.environment(), Policy(content=content(arrays))
    np.testing.assert_array_equal(env.action_space.high, [1.0, 1.0])
    np.testing.assert_array_equal(env.unwrapped.action_space.high, [law.surge, law.yaw])
    np.testing.assert_array_equal(ppo.LIMITS, [law.surge, law.yaw])
    duration = podusv.load(ppo.TASK).simulation.duration
    assert round(duration / ppo.PERIOD) == ppo.EPISODE


def test_the_reward_is_the_distance_and_little_else() -> None:
    """3 m ahead and 4 m aside, at 0.5 rad/s, after half the limits: 0.2*5 + 0.2*0.25 + 0.01*0.5."""
    seen = np.array([3.0, 4.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0])
    before = podusv.gym.Moment(0.0, seen, np.zeros(6), np.zeros(6), np.zeros(2), np.zeros(3))
    now = before._replace(time=0.2, demand=np.array([4.0, -1.25]))
    assert ppo.reward(before, now) == pytest.approx(-1.055)


@pytest.mark.slow
def test_a_model_that_was_trained_asks_for_what_its_law_does(tmp_path: Any) -> None:
    """The library's own prediction, in 32 bits."""
    pytest.importorskip("stable_baselines3", reason="stable-baselines3 is not installed")
    model, envs = ppo.trained(1, ppo.ENVIRONMENTS * ppo.EPISODE)
    file = tmp_path / "policy.safetensors"
    ppo.save(model, envs, str(file))
    config = {
        "controllers": None,
        "control.period": ppo.PERIOD,
        "controller": {"kind": "policy", "weights": str(file), "squash": "clip"},
    }
    law, random = podusv.load(ppo.TASK, config).controller, np.random.default_rng(0)
    for _ in range(20):
        x, target, seen = random.normal(size=6), random.normal(0.0, 3.0, 6), np.zeros(INPUTS)
        observe(x, target, seen)
        action, _ = model.predict(envs.normalize_obs(seen), deterministic=True)
        np.testing.assert_allclose(demand(law, x, target), action * ppo.LIMITS, atol=1e-4)
