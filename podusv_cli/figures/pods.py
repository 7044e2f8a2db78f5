"""Propellers at work: speeds, angles and power, and thin what was asked of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from podusv_cli.core.kernel import Vector
from podusv_cli.figures.curves import THIN, draw_run, draw_run_curve
from podusv_cli.figures.scales import scaling
from podusv_cli.figures.sheet import figure
from podusv_cli.figures.shown import Shown, axis_label, constants
from podusv_cli.figures.style import legend, new_figure

ROWS = (("n", "n_cmd"), ("n_part", "n_part_cmd"), ("delta", "delta_cmd"), ("power", ""))
PANEL_HEIGHT = 1.5  # inches


@figure(
    "pods",
    place=10,
    signals=("n", "delta", "power"),
    caption="propeller speeds, propulsion angles and power; a column for each pod, thin what was "
    "asked of it",
)
def pods(runs: Sequence[Shown], columns: int) -> Figure:
    """A row for each of speed, angle and power, a column for each pod; actual over commanded."""
    having = [run for run in runs if run.has("delta")]
    count = max(run.recording["delta"].shape[1] for run in having)
    held = constants(having, [name for name, _ in ROWS])
    rows = [
        names for names in ROWS if names[0] not in held and any(run.has(names[0]) for run in having)
    ]
    figure = new_figure(columns, 0.7 + PANEL_HEIGHT * len(rows))
    panels = figure.subplots(len(rows), count, sharex=True, sharey="row", squeeze=False)
    for line, names in zip(panels, rows, strict=True):
        line[0].set_ylabel(axis_label(runs, names[0]))
        for pod, axes in enumerate(line):
            for run in having:
                _draw(axes, run, names, pod, fitted=run in scaling(having))
    for pod, (top, bottom) in enumerate(zip(panels[0], panels[-1], strict=True)):
        top.set_title(f"pod {pod + 1}")
        bottom.set_xlabel("time [s]")
    legend(figure, "asked for by the allocation", held=held)
    return figure


def _draw(axes: Axes, run: Shown, names: tuple[str, str], pod: int, *, fitted: bool) -> None:
    """Draw what one pod (from 0) does, and thin what it is asked for.

    `names` are (actual, asked).
    """
    actual, asked = names
    # Its label begins with _, so the legend leaves it out.
    thin: dict[str, Any] = {**run.line_style, **THIN, "label": f"_{run.name}, {asked}"}
    if _has(run, asked, pod):
        draw_run_curve(axes, run, _curve(run, asked, pod), fitted=fitted, **thin)
    if _has(run, actual, pod):
        draw_run(axes, run, _curve(run, actual, pod), fitted=fitted)


def _has(run: Shown, name: str, pod: int) -> bool:
    """Whether the run's log has this signal of this pod; "" is no signal."""
    return bool(name) and run.has(name) and pod < run.recording[name].shape[1]


def _curve(run: Shown, name: str, pod: int) -> tuple[Vector, Vector]:
    """Times (n,) [s] and a signal (n,) of one pod."""
    return run.recording["time"], run.recording[name][:, pod]
