"""Where the proof's sets end: nodes near the state, filter errors, and the bound of the sway."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from podusv_cli.figures.curves import draw_signal
from podusv_cli.figures.panels import TIME
from podusv_cli.figures.sheet import figure
from podusv_cli.figures.shown import Shown, axis_label
from podusv_cli.figures.style import legend, new_figure

THIN = 0.6  # points: bounds, each in its run's line style
REACH = 2.0  # widths; farther from every node a network says next to nothing
LABELS = {"node_distance": "nearest node [widths]"}
PANELS = ("node_distance", "activation", "y_u", "y_r")


@figure(
    "validity",
    place=9,
    signals=("V",),
    caption="where the proof's assumptions hold: distance to the nearest network centre (line: 2 "
    "widths, beyond which the network says next to nothing), largest node output, filter errors, "
    "and the sway speed with its bound (51)",
)
def validity(runs: Sequence[Shown], columns: int) -> Figure:
    """Distance to the nearest node, largest node output, filter errors, sway with its bound."""
    runs = [run for run in runs if run.has("V")]
    rows = len(PANELS) // columns
    figure = new_figure(columns, 0.7 + 1.5 * (rows + 1))
    cells = figure.add_gridspec(rows + 1, columns)
    for place, name in enumerate(PANELS):
        axes = figure.add_subplot(cells[divmod(place, columns)])
        draw_signal(axes, runs, name)
        axes.set_ylabel(LABELS.get(name) or axis_label(runs, name))
        if name == "node_distance":
            axes.axhline(REACH, color="#444444", linewidth=0.6)
    _sway(figure.add_subplot(cells[rows, :]), runs)
    span = min(run.start for run in runs), max(run.end for run in runs)
    for axes in figure.axes:
        axes.set_xlim(*span)
    legend(figure)
    return figure


def _sway(axes: Axes, runs: Sequence[Shown]) -> None:
    """Draw sway [m/s], and its bound from the start of each window to the end of the run."""
    draw_signal(axes, runs, "v")
    for run in runs:
        end = run.end
        for start, bound in zip(
            run.recording["window_start"], run.recording["v_bound"], strict=True
        ):
            if start <= end and np.isfinite(bound):
                for side in (bound, -bound):
                    axes.plot(
                        [start, end],
                        [side, side],
                        color=run.color,
                        linewidth=THIN,
                        linestyle=run.linestyle,
                    )
    axes.plot([], [], color="#444444", linewidth=THIN, label="thin: bound of $|v|$")
    axes.set_ylabel(axis_label(runs, "v"))
    axes.set_xlabel(TIME)
