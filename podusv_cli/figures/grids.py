"""Figures that show signals over time and nothing else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from podusv_cli.figures.panels import PEAKS, Scale, signals_over_time
from podusv_cli.figures.sheet import Sheet, figure
from podusv_cli.figures.style import Shown

SAMPLES = 1000  # of a signal, about, for what is usual in it
DIP = 0.02  # of the run; a distance that is smaller for less than this is a passage
STANDOFF: dict[str, Any] = {"color": "#444444", "linewidth": 0.8, "linestyle": (0, (1, 2))}


def distance_axis(axes: Axes, runs: Sequence[Shown]) -> None:
    """A logarithmic axis for z_e, not below what the runs resolve, with a line at each standoff."""
    axes.set_yscale("log")
    bottom, floor = axes.get_ylim()[0], min(map(_resolved, runs))
    axes.set_ylim(bottom=max(bottom, floor))
    approaches = [run.scenario.controller.approach() for run in runs]
    kept = sorted({approach.standoff for approach in approaches if approach} - {0.0})
    for standoff in kept:
        label = f"standoff {kept[0]:g} m" if len(kept) == 1 else "standoffs"
        axes.axhline(standoff, label=label, **STANDOFF)


def _resolved(run: Shown) -> float:
    """The smallest distance [m] worth showing: a step's way, or less where the vessel stays nearer.

    How near a vessel comes in passing depends on where the steps happen to fall.
    """
    stride = -(-len(run.recording["time"]) // SAMPLES)
    z_e, u = (np.abs(run.signal(name)[::stride]) for name in ("z_e", "u"))
    way = run.scenario.simulation.step * float(np.median(u))
    return min(way, float(np.quantile(z_e, DIP)))


def _grid(
    name: str, place: int, caption: str, *signals: str,
    scales: Mapping[str, Scale] = MappingProxyType({}), compressed: bool = False, source: str = "",
) -> Sheet:  # fmt: skip
    family = signals_over_time(*signals, scales=scales, compressed=compressed)
    return figure(name, caption=caption, signals=signals, place=place, source=source)(family)


errors = _grid(
    "errors", 2, "tracking errors (18); the distance on a logarithmic axis, down to what the run "
    "resolves, with the standoff that the law keeps",
    "x_e", "y_e", "z_e", "psi_e", scales={"z_e": distance_axis}, source="the paper's figure 4",
)  # fmt: skip
adaptation = _grid(
    "adaptation", 5,
    "norms of the network weights, estimated bounds, network outputs, largest node output" + PEAKS,
    "W_norm_u", "W_norm_r", "b_hat_u", "b_hat_r", "f_hat_u", "f_hat_r", "activation",
    compressed=True,
)  # fmt: skip
velocities = _grid(
    "velocities", 6, "velocities and heading" + PEAKS, "u", "v", "r", "psi", compressed=True
)
