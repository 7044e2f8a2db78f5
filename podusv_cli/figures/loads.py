"""What the sea does, and when the actuator limits the law."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from podusv_cli.core.kernel import Vector
from podusv_cli.figures.curves import draw_curve, draw_signal
from podusv_cli.figures.panels import grid
from podusv_cli.figures.sheet import figure
from podusv_cli.figures.style import Shown, axis_label, legend

SEA = ("b_u", "b_v", "b_r")
COMMON: dict[str, str] = {"color": "#444444", "linestyle": "-", "label": "all runs"}


@figure(
    "loads", place=7, signals=("b_u", "b_v", "b_r", "saturated"),
    caption="disturbance, and when the actuator limits the law",
)  # fmt: skip
def loads(runs: Sequence[Shown], columns: int) -> Figure:
    """The disturbance over time, once where all runs have the same; below, who is limited when."""
    sea = [name for name in SEA if any(run.has(name) for run in runs)]
    limited = [run for run in runs if run.has("saturated")]
    figure, panels = grid(len(sea) + bool(limited), columns)
    for axes, name in zip(panels, sea, strict=False):
        _disturbance(axes, runs, name)
        axes.set_ylabel(axis_label(runs, name))
    if limited:
        _limits(panels[-1], limited)
    legend(figure, columns)
    return figure


def _disturbance(axes: Axes, runs: Sequence[Shown], name: str) -> None:
    having = [run for run in runs if run.has(name)]
    longest = max(having, key=lambda run: run.end)
    if len(runs) > 1 and all(_same(run, longest, name) for run in having):
        draw_curve(axes, longest.during(name, None), fitted=True, **COMMON)
    else:
        draw_signal(axes, runs, name)


def _same(run: Shown, longest: Shown, name: str) -> bool:
    """Whether a run has the same signal as another, as long as it lasts."""
    t, y = run.during(name, None)
    other = np.interp(t, *longest.during(name, None))
    return bool(np.allclose(y, other, rtol=1e-6, atol=1e-6 * float(np.ptp(other))))


def _limits(axes: Axes, runs: Sequence[Shown]) -> None:
    """A line for each run, marked while the actuator limits what its law asked for."""
    for place, run in enumerate(runs):
        spells = list(_spells(*run.during("saturated", None)))
        axes.broken_barh(spells, (place - 0.3, 0.6), color=run.color, linewidth=0.6)
        axes.plot([0.0, run.end], [place, place], color=run.color, linewidth=0.4)
    axes.set_yticks(range(len(runs)), [run.name for run in runs])
    axes.set_ylim(len(runs) - 0.4, -0.6)
    axes.set_title("limited by the actuator")
    axes.grid(visible=False, axis="y")


def _spells(t: Vector, on: Vector) -> Iterator[tuple[float, float]]:
    """Start and length [s] of every stretch of rows that are on."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0.0], on > 0.5, [0.0]])))
    for first, after in edges.reshape(-1, 2):
        yield float(t[first]), float(t[min(after, len(t) - 1)] - t[first])
