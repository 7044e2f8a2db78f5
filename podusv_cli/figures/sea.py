"""Waves, wind and current as the vessel meets them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from podusv_cli.core.kernel import Vector
from podusv_cli.figures.curves import draw_shared, draw_signal
from podusv_cli.figures.panels import TIME
from podusv_cli.figures.scales import Span
from podusv_cli.figures.sheet import figure
from podusv_cli.figures.shown import Shown, about, axis_label, constants
from podusv_cli.figures.style import legend, new_figure

ELEVATION = "zeta"
SIGNALS = (ELEVATION, "V_w", "V_c", "beta_c")
FROM = "beta_w"  # drawn where the wind veers
PANEL_HEIGHT = 1.25  # inches
WAVES = 20  # in the panel of single waves


@figure(
    "sea",
    place=7,
    signals=SIGNALS,
    caption="waves, wind and current where the vessel is: elevation of the sea over the last "
    f"{WAVES} waves and over the whole run, speed of the wind, speed and direction of the "
    "current; where the wind turns, also its direction",
)
def sea(runs: Sequence[Shown], columns: int) -> Figure:
    """A panel for each signal over the whole run; above them, the last waves one by one."""
    held = constants(runs, SIGNALS)
    names = [name for name in SIGNALS if name not in held and any(run.has(name) for run in runs)]
    if any(run.has(FROM) and np.ptp(run.signal(FROM)) > 0.0 for run in runs):
        names.append(FROM)
    waves = int(ELEVATION in names)
    figure = new_figure(columns, 0.7 + PANEL_HEIGHT * (waves + len(names)))
    panels: list[Axes] = figure.subplots(waves + len(names), 1, squeeze=False)[:, 0].tolist()
    if waves:
        _single_waves(panels[0], [run for run in runs if run.has(ELEVATION)])
    for axes, name in zip(panels[waves:], names, strict=True):
        draw_shared(axes, runs, name)
        axes.sharex(panels[-1])
        axes.tick_params(labelbottom=axes is panels[-1])
        axes.set_ylabel(axis_label(runs, name))
        axes.set_title(about(runs, name).meaning)
    panels[-1].set_xlabel(TIME)
    legend(figure, held=held)
    return figure


def _single_waves(axes: Axes, runs: Sequence[Shown]) -> None:
    """Draw the elevation over the last waves, which one can tell apart."""
    span = _last_waves(*max(runs, key=lambda run: run.end).during(ELEVATION, None))
    draw_signal(axes, runs, ELEVATION, span=span)
    axes.set_xlim(*span)
    axes.set_ylabel(axis_label(runs, ELEVATION))
    axes.set_title(f"the last {WAVES} waves")


def _last_waves(t: Vector, zeta: Vector) -> Span:
    """From the upward crossing of 0 with which the last waves begin, to the end [s].

    `t` [s] and the elevation `zeta` [m] are (n,).
    """
    upward = np.flatnonzero((zeta[:-1] < 0.0) & (zeta[1:] >= 0.0))
    first = upward[-WAVES] if len(upward) >= WAVES else 0
    return float(t[first]), float(t[-1])
