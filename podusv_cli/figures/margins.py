"""Sensitivity S and complementary sensitivity T of laws' loops over frequency."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure

from podusv_cli.core import escaping
from podusv_cli.figures.looks import TARGET_LOOK, nth_style
from podusv_cli.figures.style import legend, new_figure
from podusv_cli.theory.loop_margins import AXES, LoopMargins

HEIGHT = 4.2  # inches
FLOOR = 1e-3  # of the vertical axes
CURVES = {"S": "sensitivity |S|", "T": "complementary sensitivity |T|"}


def sensitivities(laws: Mapping[str, LoopMargins], columns: int = 2) -> Figure:
    """|S| and |T| over frequency: a row of panels each, a column a loop, a curve a law.

    `laws` are by label; one without a loop has no curve there. `columns` is the width of the
    figure.
    """
    figure = new_figure(columns, HEIGHT)
    loops = [axis for axis in AXES if any(axis in law.loops for law in laws.values())]
    panels = figure.subplots(2, len(loops), sharex="col", sharey=True)
    for row, (name, title) in zip(panels, CURVES.items(), strict=True):
        for axes, axis in zip(row, loops, strict=True):
            for place, (label, law) in enumerate(laws.items()):
                if axis not in law.loops:
                    continue
                color, linestyle, _ = nth_style(place)
                loop = law.loops[axis]
                axes.plot(
                    loop.omega,
                    getattr(loop, name),
                    color=color,
                    linestyle=linestyle,
                    label=escaping.figure(label),
                )
            axes.axhline(1.0, zorder=0, **TARGET_LOOK)
            axes.set(xscale="log", yscale="log", ylim=(FLOOR, None), title=axis)
        row[0].set_ylabel(title)
    for axes in panels[-1]:
        axes.set_xlabel("angular frequency [rad/s]")
    legend(figure)
    return figure
