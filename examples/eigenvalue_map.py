"""Draw how fast the lateral loop grows over p_eff and V, with all hulls of podusv on it.

python examples/eigenvalue_map.py docs/images/eigenvalue_map.png

The colours are the polynomials of docs/theory.md for a hull with the sway damping of CyberShip II.
Every hull is at its own p_eff(V), judged by its own damping and mass matrix.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from matplotlib.figure import Figure

import podusv_cli
from podusv_cli.components.controllers.momentum_schedule import SwayResponse, schedule
from podusv_cli.components.controllers.momentum_vector import MomentumVector
from podusv_cli.components.controllers.velocity_vector import VelocityVector
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.kernel import bundle
from podusv_cli.figures.style import house_style
from podusv_cli.theory.lateral import (
    MomentumGains,
    SwayAnswer,
    growth,
    momentum_vector_gains,
    momentum_vector_polynomial,
    sway_answer,
    velocity_vector_loop,
    velocity_vector_polynomial,
)

FOLDER = Path(podusv_cli.__file__).parent / "components/vessels"
HULLS = {
    path.stem: Vessel(preset=path.stem, **yaml.safe_load(path.read_text()))
    for path in sorted(FOLDER.glob("*.yaml"))
}
ONE_MOMENT = 0.9  # N_m over m33 [rad/s2], the model ship's, so that hulls of all sizes are alike
DAMPING = sway_answer(HULLS["cybership2"], 0.5).d
STEER = VelocityVector()
SPEEDS, ANSWERS = np.geomspace(0.1, 2.0, 60), np.linspace(0.4, 3.2, 90)
TICKS = (0.1, 0.2, 0.5, 1.0, 2.0)  # m/s
MOST = 0.5  # 1/s; the end of the colours


def momentum_law(hull: Vessel) -> MomentumVector:
    """The law with the moment at hand in proportion to the hull's yaw inertia."""
    return MomentumVector(N_m=ONE_MOMENT * hull.m33)


def vector_growth(p: float, V: float) -> float:
    """Of `velocity_vector`; above V_m V does not count."""
    return growth(velocity_vector_polynomial(STEER, SwayAnswer(p, DAMPING)))


def momentum_growth(p: float, V: float) -> float:
    """Of `momentum_vector`, told p and d exactly."""
    hull = HULLS["paper_nonlinear"]
    k = bundle(momentum_law(hull).constants_with(hull))
    gains = schedule(SwayResponse(p, DAMPING), k)
    return growth(
        momentum_vector_polynomial(
            SwayAnswer(p, DAMPING), MomentumGains(gains.eta, gains.k_b, k.Q, k.S, 0.0)
        )
    )


def vector_hull(hull: Vessel, V: float) -> float:
    """Of `velocity_vector` on this hull, by its full mass matrix."""
    return float(np.linalg.eigvals(velocity_vector_loop(STEER, hull, V)).real.max())


def momentum_hull(hull: Vessel, V: float) -> float:
    """Of `momentum_vector` on this hull."""
    return growth(momentum_vector_polynomial(*momentum_vector_gains(momentum_law(hull), hull, V)))


def panel(
    axes: Any,
    title: str,
    colour: Callable[[float, float], float],
    judge: Callable[[Vessel, float], float],
) -> Any:
    """One law: colours behind, and a curve a hull, dotted where it grows."""
    field = np.array([[colour(p, V) for V in SPEEDS] for p in ANSWERS])
    mesh = axes.pcolormesh(
        SPEEDS, ANSWERS, field, cmap="RdBu_r", vmin=-MOST, vmax=MOST, rasterized=True, alpha=0.6
    )
    if field.min() < 0.0 < field.max():
        axes.contour(SPEEDS, ANSWERS, field, levels=[0.0], colors="0.3", linewidths=0.8)
    for place, (name, hull) in enumerate(HULLS.items()):
        p = np.array([sway_answer(hull, V).p for V in SPEEDS])
        grows = np.array([judge(hull, V) > 0.0 for V in SPEEDS])
        width = 3.5 if name == "paper" else 1.6  # whose curve is paper_nonlinear's, too
        axes.plot(SPEEDS, np.where(grows, np.nan, p), color=f"C{place}", lw=width, label=name)
        axes.plot(SPEEDS, np.where(grows, p, np.nan), ":", color=f"C{place}", lw=width)
    axes.set(title=title, xlabel="$V$ [m/s]", ylim=(ANSWERS[0], ANSWERS[-1]), xscale="log")
    axes.set_xticks(TICKS, [f"{V:g}" for V in TICKS])
    return mesh


def draw(place: Path) -> None:
    """Both laws side by side."""
    with house_style():
        figure = Figure(figsize=(7.09, 3.2))
        left, right = figure.subplots(1, 2, sharey=True)
        panel(left, "velocity_vector", vector_growth, vector_hull)
        mesh = panel(right, "momentum_vector", momentum_growth, momentum_hull)
        left.set_ylabel("$p_{eff}$, how much sway answers yaw")
        right.legend(loc="upper right")
        figure.colorbar(mesh, ax=[left, right], label="largest real part [1/s]", extend="both")
        figure.savefig(place)


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
