"""Tracking errors over time, the paper's figure 4."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from podusv_cli.figures.style import Shown, axis_label, draw_signal, new_figure

ERRORS = ("x_e", "y_e", "z_e", "psi_e")


def errors(runs: Sequence[Shown], columns: int) -> Figure:
    """x_e, y_e, z_e and psi_e of every run; z_e on a logarithmic axis."""
    figure = new_figure(columns, 3.6 if columns == 2 else 5.6)
    shape = (2, 2) if columns == 2 else (4, 1)
    panels = figure.subplots(*shape, sharex=True).ravel()
    for axes, name in zip(panels, ERRORS, strict=True):
        for shown in runs:
            draw_signal(axes, shown, name)
        axes.set_ylabel(axis_label(name))
    panels[2].set_yscale("log")
    for axes in panels[-columns:]:
        axes.set_xlabel("time [s]")
    panels[0].legend(loc="best")
    return figure
