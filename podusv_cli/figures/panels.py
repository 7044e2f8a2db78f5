"""Grids of signals over time: the parts of such figures, and those that are nothing else."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from podusv_cli.figures.curves import compress, draw_signal
from podusv_cli.figures.page import Page
from podusv_cli.figures.scales import smallest_distance
from podusv_cli.figures.sheet import Family, Sheet, figure
from podusv_cli.figures.shown import Shown, axis_label, constants
from podusv_cli.figures.style import legend, new_figure

Scale = Callable[[Axes, Sequence[Shown]], None]

PANEL_HEIGHT = 1.45  # inches
TIME = "time [s]"

STANDOFF: dict[str, Any] = {"color": "#444444", "linewidth": 0.8, "linestyle": (0, (1, 2))}
PEAKS = "; where peaks dwarf the settled values the axis is logarithmic beyond these"


def signals_over_time(
    *names: str, scales: Mapping[str, Scale] = MappingProxyType({}), compressed: bool = False
) -> Family:
    """A family that shows these signals, one a panel, all runs in each.

    `scales` give a signal's axis a scale of its own, and what belongs to it. With `compressed`, an
    axis with tall peaks is logarithmic beyond the settled values.
    """

    def family(runs: Sequence[Shown], columns: int) -> Figure:
        """The figure: a panel for each signal that changes.

        Signals that stay as they are stand in the legend instead.
        """
        held = constants(runs, names)
        shown = [name for name in names if name not in held and any(run.has(name) for run in runs)]
        figure, panels = grid(len(shown), columns)
        for axes, name in zip(panels, shown, strict=True):
            draw_signal(axes, runs, name)
            axes.set_ylabel(axis_label(runs, name))
            if name in scales:
                scales[name](axes, [run for run in runs if run.has(name)])
            if compressed:
                compress(axes, runs, name)
        legend(figure, held=held)
        return figure

    return family


def signals(*names: str) -> Sheet:
    """A figure of these signals, named after them, each in a panel of its own."""
    family = signals_over_time(*names)
    return figure("-".join(names), caption=f"over time: {', '.join(names)}", signals=names)(family)


def grid(count: int, columns: int) -> tuple[Page, list[Axes]]:
    """A figure with `count` panels over one time, row by row, so many columns of a page wide.

    A panel that is alone in the last row fills it.
    """
    rows = math.ceil(count / columns)
    # 0.7 inches are for the legend and the labels of the time axis.
    figure = new_figure(columns, 0.7 + PANEL_HEIGHT * rows)
    cells = figure.add_gridspec(rows, columns)
    alone = count % columns == 1 < columns
    panels: list[Axes] = []
    for place in range(count):
        row, column = divmod(place, columns)
        cell = cells[row, :] if alone and place == count - 1 else cells[row, column]
        axes = figure.add_subplot(cell, sharex=panels[0] if panels else None)
        # The last panel of a row for itself is wider, so those above it need numbers of their own.
        axes.tick_params(labelbottom=row == rows - 1 or (alone and row == rows - 2))
        axes.set_xlabel(TIME if row == rows - 1 else "")
        panels.append(axes)
    return figure, panels


def distance_axis(axes: Axes, runs: Sequence[Shown]) -> None:
    """A logarithmic axis for z_e, not below what the runs resolve, with a line at each standoff."""
    axes.set_yscale("log")
    bottom, floor = axes.get_ylim()[0], smallest_distance(runs)
    axes.set_ylim(bottom=max(bottom, floor))
    kept = sorted({run.about.standoff for run in runs} - {0.0})
    for standoff in kept:
        label = f"standoff {kept[0]:g} m" if len(kept) == 1 else "standoffs"
        axes.axhline(standoff, label=label, **STANDOFF)


def _sheet(
    name: str,
    place: int,
    caption: str,
    *signals: str,
    scales: Mapping[str, Scale] = MappingProxyType({}),
    compressed: bool = False,
    source: str = "",
) -> Sheet:
    """A figure of these signals over time; the arguments are those of `figure` and its family."""
    family = signals_over_time(*signals, scales=scales, compressed=compressed)
    return figure(name, caption=caption, signals=signals, place=place, source=source)(family)


errors = figure(
    "errors",
    place=2,
    signals=("x_e", "y_e", "z_e"),
    source="the paper's figure 4",
    caption="tracking errors (18); the distance on a logarithmic axis, down to what the run "
    "resolves, with the standoff that the law keeps",
)(signals_over_time("x_e", "y_e", "z_e", "psi_e", scales={"z_e": distance_axis}))
following = _sheet(
    "path",
    2,
    "cross-track error of the active leg, the way along it, and its number",
    "e_ct",
    "along_leg",
    "leg",
)
adaptation = _sheet(
    "adaptation",
    5,
    "norms of the network weights, estimated bounds, network outputs, largest node output" + PEAKS,
    "W_norm_u",
    "W_norm_r",
    "b_hat_u",
    "b_hat_r",
    "f_hat_u",
    "f_hat_r",
    "activation",
    compressed=True,
)
velocities = _sheet(
    "velocities", 6, "velocities and heading" + PEAKS, "u", "v", "r", "psi", compressed=True
)
