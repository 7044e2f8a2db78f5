"""Train a policy by PPO of stable-baselines3: `python ppo.py SEED FILE`, three minutes on a core.

SEED is a whole number, FILE what the policy is written to. It needs podusv[gym] and
stable-baselines3 (Raffin et al. 2021, JMLR 22:268), whose PPO cuts actions off (squash: clip).
"""

import sys

import numpy as np
from gymnasium.wrappers import RescaleAction
from safetensors.numpy import save_file

import podusv.gym

TASK = "podusv:studies/learned.yaml"
OTHER_DRAWS = {"sweep.seed": 2026}  # than those of the study, which judges
PERIOD = 0.2  # s, for which a demand holds
EPISODE = 400  # demands
ENVIRONMENTS, STEPS = 16, 1_500_000
LIMITS = np.array([8.0, 2.5])  # N and N m, at actions of 1: `surge` and `yaw` of the law
YAW_RATE = 4  # its place in what is seen
TURNING, CHANGE = 0.2, 0.01  # of a squared yaw rate [s2/rad2], of a squared change of the action
EPSILON = 1e-8  # of VecNormalize, added to the variance
HIDDEN = "mlp_extractor.policy_net."


def reward(before, now):
    """Minus the distance over the period [m s], less for turning and changes."""
    distance = np.hypot(now.seen[0], now.seen[1])
    change = (((now.demand - before.demand) / LIMITS) ** 2).sum()
    return -(PERIOD * distance + TURNING * now.seen[YAW_RATE] ** 2 + CHANGE * change)


def environment():
    """The task with actions in [-1, 1]."""
    env = podusv.gym.Env(TASK, OTHER_DRAWS, period=PERIOD, reward=reward)
    return RescaleAction(env, np.float64(-1.0), np.float64(1.0))


def tensors(actor, mean, variance):
    """Arrays of an actor by their names in PPO, as the law `policy` has them.

    `mean` and `variance` are those of the observation, which VecNormalize has gathered.
    """
    layers = {name.removeprefix(HIDDEN): a for name, a in actor.items() if name.startswith(HIDDEN)}
    last = len(layers)  # a weight and a bias each, and numbers of torch's Sequential go by two
    layers |= {f"{last}.{part}": actor[f"action_net.{part}"] for part in ("weight", "bias")}
    return layers | {"mean": mean, "scale": np.sqrt(variance + EPSILON)}


def trained(seed, steps):
    """A model of PPO, and the VecNormalize before it."""
    import torch  # these are no part of podusv[gym]
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    torch.set_num_threads(1)
    envs = DummyVecEnv([environment] * ENVIRONMENTS)
    envs.seed(seed)
    envs = VecNormalize(envs, clip_obs=np.inf, epsilon=EPSILON)  # the law cuts nothing off
    model = PPO(
        "MlpPolicy",
        envs,
        seed=seed,
        device="cpu",
        n_steps=EPISODE,
        batch_size=EPISODE,
        n_epochs=5,
        gamma=0.99,
        learning_rate=lambda left: 1e-3 * left,
        policy_kwargs={"net_arch": [32, 32], "log_std_init": -0.5},
    )
    return model.learn(steps, progress_bar=False), envs


def save(model, envs, file):
    """As the law `policy` takes it, with squash: clip."""
    actor = {name: array.detach().numpy() for name, array in model.policy.state_dict().items()}
    seen = envs.obs_rms
    arrays = tensors(actor, seen.mean, seen.var)
    arrays = {name: np.ascontiguousarray(array, dtype=float) for name, array in arrays.items()}
    save_file(arrays, file, metadata={"control.period": str(PERIOD)})


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: python ppo.py SEED FILE")
    save(*trained(int(sys.argv[1]), STEPS), sys.argv[2])
