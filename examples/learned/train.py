"""Train a policy by an evolution strategy: `python train.py SEED FILE`, five minutes on two cores.

SEED is a whole number, FILE what the policy is written to; it needs podusv[gym].

In every generation 32 pairs of networks, mirrored about the mean, steer the same four drawn runs.
Ranks of their costs give the direction in which the mean goes (Salimans et al. 2017,
arXiv:1703.03864, algorithm 2), with the steps of Adam. The result does not depend on how many
processes there are.
"""

import sys
from functools import cache
from itertools import pairwise
from multiprocessing import Pool

import numpy as np
from safetensors.numpy import save_file

import podusv.gym

TASK = "podusv:studies/learned.yaml"
OTHER_DRAWS = {"sweep.seed": 2026}  # than those of the study, which judges
PERIOD = 0.2  # s, for which a demand holds
SIZES = (8, 16, 2)
GENERATIONS, PAIRS, DRAWS = 300, 32, 4
WIDTH, RATE = (0.1, 0.03), (0.05, 0.0)  # of the search and of its steps, at begin and end
PROCESSES = 2
YAW_RATE = 4  # its place in the observation
SCALE = np.array([5.0, 5.0, 1.0, 0.5, 0.5, 0.5, 0.5, np.pi])  # of the observation
SHAPES = list(pairwise(SIZES))
ENDS = np.cumsum([out * (into + 1) for into, out in SHAPES])
# What a run costs beside the integral of the distance [m s]. Without the first two, networks turn
# round and round on their way, and swing from limit to limit.
TURNING = 1.0  # a squared yaw rate of 1 rad2/s2, for a second
CHANGE = 0.01  # a demand that changes by all of its limit
DIVERGED = 1000.0


def layers(numbers):
    """Weights (..., out, in) and biases (..., out) of each layer; a network is a row of numbers."""
    for (into, out), part in zip(SHAPES, np.split(numbers, ENDS[:-1], axis=-1), strict=True):
        weights, biases = np.split(part, [into * out], axis=-1)
        yield weights.reshape(*weights.shape[:-1], out, into), biases


@cache
def environment(count):
    """Runs of the task side by side."""
    return podusv.gym.VectorEnv(TASK, OTHER_DRAWS, count=count, period=PERIOD)


def costs(networks, seeds):
    """What each network costs in each of these runs [m s]."""
    env = environment(len(networks) * len(seeds))
    weights, limits = list(layers(networks)), env.single_action_space.high
    seen, _ = env.reset(seed=seeds * len(networks))
    before = np.zeros(env.action_space.shape)
    total, over = np.zeros(env.num_envs), np.zeros(env.num_envs, bool)
    while not over.all():
        h = seen.reshape(len(networks), len(seeds), -1) / SCALE
        for weight, bias in weights:
            h = np.tanh(h @ weight.swapaxes(1, 2) + bias[:, np.newaxis])
        shares = h.reshape(before.shape)
        seen, reward, dead, cut, _ = env.step(shares * limits)
        extra = TURNING * PERIOD * seen[:, YAW_RATE] ** 2 + DIVERGED * dead
        changes = CHANGE * ((shares - before) ** 2).sum(axis=1)
        total += np.where(over, 0.0, extra + changes - reward)
        before = shares
        over |= dead | cut
    return total.reshape(len(networks), -1)


def trained(random, pool):
    """The mean after the last generation."""
    mean = np.concatenate(
        [np.append(random.normal(0.0, a**-0.5, a * b), np.zeros(b)) for a, b in SHAPES]
    )
    slope, square = np.zeros_like(mean), np.zeros_like(mean)
    for generation in range(1, GENERATIONS + 1):
        done = (generation - 1) / GENERATIONS
        width, rate = (a + (b - a) * done for a, b in (WIDTH, RATE))
        away = random.normal(size=(PAIRS, len(mean)))
        seeds = random.integers(100_000, size=DRAWS).tolist()
        networks = np.concatenate([mean + width * away, mean - width * away])
        parts = np.array_split(networks, PROCESSES)
        cost = np.concatenate(pool.starmap(costs, [(part, seeds) for part in parts]))
        ranks = cost.argsort(axis=0).argsort(axis=0).mean(axis=1) / len(networks)
        found = (ranks[:PAIRS] - ranks[PAIRS:]) @ away / PAIRS
        slope, square = 0.9 * slope + 0.1 * found, 0.99 * square + 0.01 * found**2
        steps = slope / (1.0 - 0.9**generation)
        mean -= rate * steps / np.sqrt(square / (1.0 - 0.99**generation) + 1e-16)
        if generation % 20 == 0:
            print(f"{generation:4}  median cost {np.median(cost):.1f} m s", flush=True)
    return mean


def save(network, file):
    """As the law `policy` takes it."""
    tensors = {"scale": SCALE}
    for i, (weight, bias) in enumerate(layers(network)):
        tensors |= {f"{i}.weight": np.ascontiguousarray(weight), f"{i}.bias": bias.copy()}
    small = {name: tensor.astype(np.float32) for name, tensor in tensors.items()}
    save_file(small, file, metadata={"control.period": str(PERIOD)})


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: python train.py SEED FILE")
    seed, file = sys.argv[1:]
    with Pool(PROCESSES) as processes:
        save(trained(np.random.default_rng(int(seed)), processes), file)
