"""What the sea does, and when the actuator limits the law."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from podusv_cli.core.kernel import Vector
from podusv_cli.figures.curves import draw_shared
from podusv_cli.figures.panels import grid
from podusv_cli.figures.sheet import figure
from podusv_cli.figures.shown import Shown, about, axis_label, constants
from podusv_cli.figures.style import legend

SEA = ("b_u", "b_v", "b_r")


@figure(
    "loads",
    place=7,
    signals=("b_u", "b_v", "b_r", "saturated"),
    caption="disturbance, and when the actuator limits the law",
)
def loads(runs: Sequence[Shown], columns: int) -> Figure:
    """The disturbance over time, once where all runs have the same; below, who is limited when."""
    held = constants(runs, SEA)
    sea = [name for name in SEA if name not in held and any(run.has(name) for run in runs)]
    limited = [run for run in runs if run.has("saturated")]
    figure, panels = grid(len(sea) + bool(limited), columns)
    for axes, name in zip(panels, sea, strict=False):
        draw_shared(axes, runs, name)
        axes.set_ylabel(axis_label(runs, name))
        axes.set_title(about(runs, name).meaning)
    if limited:
        _limits(panels[-1], limited)
    legend(figure, held=held)
    return figure


def _limits(axes: Axes, runs: Sequence[Shown]) -> None:
    """A line for each run, marked while the actuator limits what its law asked for."""
    for place, run in enumerate(runs):
        spells = list(_spells(*run.during("saturated", None)))
        axes.broken_barh(spells, (place - 0.3, 0.6), color=run.color, linewidth=0.6)
        axes.plot([run.start, run.end], [place, place], color=run.color, linewidth=0.4)
    axes.set_yticks(range(len(runs)), [run.name for run in runs])
    # The first run stands on top.
    axes.set_ylim(len(runs) - 0.4, -0.6)
    axes.set_title("limited by the actuator")
    axes.grid(visible=False, axis="y")


def _spells(t: Vector, on: Vector) -> Iterator[tuple[float, float]]:
    """Start and length [s] of every stretch of rows in which `on` (n,) is 1; `t` (n,) [s]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0.0], on > 0.5, [0.0]])))
    for first, after in edges.reshape(-1, 2):
        # A spell that lasts to the end has no row after it.
        yield float(t[first]), float(t[min(after, len(t) - 1)] - t[first])
