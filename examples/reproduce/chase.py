"""Draw docs/images/chase.png: the three boats of `podusv demo` behind their target, on the water.

python examples/reproduce/chase.py docs/images/chase.png
"""

from __future__ import annotations

import sys

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

import podusv

LOOKS = {
    "pid_winds_up": ("#ffb000", "PID that winds up"),
    "pid": ("#ffffff", "PID with anti-windup"),
    "momentum_vector": ("#7fffd4", "momentum_vector"),
}
EVERY, LARGER = 8.0, 1.8  # s between two hulls; how much larger than they are they are drawn
WATER, CREST = "#0b3c5d", "#1d5f8a"
HULL = np.array([[0.5, 0.0], [0.2, 0.17], [-0.5, 0.17], [-0.5, -0.17], [0.2, -0.17]])  # lengths


def water(axes: Axes) -> None:
    """Crests across the view, and no axes but a scale."""
    axes.set_facecolor(WATER)
    draws = np.random.default_rng(1)
    (west, east), (south, north) = axes.get_xlim(), axes.get_ylim()
    for _ in range(220):
        x, y = draws.uniform(west, east), draws.uniform(south, north)
        along = np.linspace(-0.5, 0.5, 20) * draws.uniform(0.6, 2.2)
        axes.plot(x + along, y + 0.12 * np.cos(3.0 * along), color=CREST, lw=0.9, zorder=0)
    axes.plot([west + 1.0, west + 6.0], [south + 0.7] * 2, color="white", lw=2)
    axes.text(west + 3.5, south + 0.95, "5 m", color="white", ha="center", fontsize=9)
    axes.set(xticks=[], yticks=[])


def boat(axes: Axes, run: podusv.Run, length: float, color: str) -> None:
    """A track, and the hull on it every so often; the later, the clearer."""
    axes.plot(run["y"], run["x"], color=color, lw=1.0, alpha=0.8)
    times = run["time"]
    for t in np.arange(0.0, times[-1] + 1e-9, EVERY):
        k = int(np.searchsorted(times, t))
        c, s = np.cos(run["psi"][k]), np.sin(run["psi"][k])
        ahead, across = LARGER * length * HULL.T
        north, east = run["x"][k] + c * ahead - s * across, run["y"][k] + s * ahead + c * across
        axes.fill(east, north, color=color, alpha=0.25 + 0.75 * t / times[-1], ec=WATER, lw=0.8)


def main(out: str) -> None:
    """Simulate, and draw."""
    scenario = podusv.load("podusv:demo.yaml")
    figure, axes = plt.subplots(figsize=(9.6, 9.6 * 19 / 56), dpi=125)
    axes.set(aspect="equal", xlim=(-12.0, 44.0), ylim=(-9.5, 9.5))
    water(axes)
    runs = {name: podusv.simulate(single) for name, single in scenario.singles().items()}
    first = next(iter(runs.values()))
    axes.plot(first["y_d"], first["x_d"], color="white", lw=1.0, ls=(0, (2, 3)), label="target")
    for name, (color, says) in LOOKS.items():
        boat(axes, runs[name], scenario.vessel.length, color)
        axes.plot([], [], color=color, lw=3, label=says)
    axes.legend(ncols=4, loc="upper right", frameon=False, labelcolor="white", fontsize=9)
    figure.subplots_adjust(0.0, 0.0, 1.0, 1.0)
    figure.savefig(out, pil_kwargs={"optimize": True})


if __name__ == "__main__":
    main(*sys.argv[1:])
