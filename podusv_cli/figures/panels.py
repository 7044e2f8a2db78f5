"""Figures that are a grid of signals over time."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from podusv_cli.figures.style import Shown, axis_label, draw_signal, frame_finished, new_figure

PANEL_HEIGHT = 1.35  # inches

Family = Callable[[Sequence[Shown], int], Figure]


def signals_over_time(*names: str, logarithmic: Collection[str] = ()) -> Family:
    """A family that shows these signals, one a panel, all runs in each."""

    def family(runs: Sequence[Shown], columns: int) -> Figure:
        shown = [name for name in names if any(run.has(name) for run in runs)]
        rows = math.ceil(len(shown) / columns)
        figure = new_figure(columns, 0.7 + PANEL_HEIGHT * rows)
        panels = figure.subplots(rows, columns, sharex=True, squeeze=False).ravel()
        for axes, name in zip(panels, shown, strict=False):
            _panel(axes, runs, name)
            if name in logarithmic:
                axes.set_yscale("log")
            frame_finished(axes, runs)
        _finish(figure, panels.tolist(), len(shown), columns)
        return figure

    return family


def _panel(axes: Axes, runs: Sequence[Shown], name: str) -> None:
    for run in runs:
        draw_signal(axes, run, name)
    axes.set_ylabel(axis_label(name))


def _finish(figure: Figure, panels: list[Axes], used: int, columns: int) -> None:
    for spare in panels[used:]:
        spare.set_axis_off()
    for axes in panels[max(0, used - columns) : used]:
        axes.set_xlabel("time [s]")
        axes.tick_params(labelbottom=True)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
