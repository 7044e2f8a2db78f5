"""Figures that are a grid of signals over time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from podusv_cli.figures.curves import compress, draw_signal
from podusv_cli.figures.sheet import Family
from podusv_cli.figures.style import Shown, axis_label, legend, new_figure

Scale = Callable[[Axes, Sequence[Shown]], None]

PANEL_HEIGHT = 1.45  # inches
TIME = "time [s]"

PEAKS = "; where peaks dwarf the settled values the axis is logarithmic beyond these"


def signals_over_time(
    *names: str, scales: Mapping[str, Scale] = MappingProxyType({}), compressed: bool = False
) -> Family:
    """A family that shows these signals, one a panel, all runs in each.

    `scales` give a signal's axis a scale of its own, and what belongs to it. With `compressed`, an
    axis with tall peaks is logarithmic beyond the settled values.
    """

    def family(runs: Sequence[Shown], columns: int) -> Figure:
        shown = [name for name in names if any(run.has(name) for run in runs)]
        figure, panels = grid(len(shown), columns)
        for axes, name in zip(panels, shown, strict=True):
            draw_signal(axes, runs, name)
            axes.set_ylabel(axis_label(runs, name))
            if name in scales:
                scales[name](axes, [run for run in runs if run.has(name)])
            if compressed:
                compress(axes, runs, name)
        legend(figure, columns)
        return figure

    return family


def grid(count: int, columns: int) -> tuple[Figure, list[Axes]]:
    """A figure with panels over one time, row by row; one alone in the last row fills it."""
    rows = math.ceil(count / columns)
    figure = new_figure(columns, 0.7 + PANEL_HEIGHT * rows)
    cells = figure.add_gridspec(rows, columns)
    alone = count % columns == 1 < columns
    panels: list[Axes] = []
    for place in range(count):
        row, column = divmod(place, columns)
        cell = cells[row, :] if alone and place == count - 1 else cells[row, column]
        axes = figure.add_subplot(cell, sharex=panels[0] if panels else None)
        axes.tick_params(labelbottom=row == rows - 1 or (alone and row == rows - 2))
        axes.set_xlabel(TIME if row == rows - 1 else "")
        panels.append(axes)
    return figure, panels
