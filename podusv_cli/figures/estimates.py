"""What the law is given in place of the true state, and how far it is from the truth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from podusv_cli.core.kernel import Vector
from podusv_cli.core.signal import STATE
from podusv_cli.figures.curves import draw_curve, draw_run, thinned
from podusv_cli.figures.panels import TIME
from podusv_cli.figures.scales import scaling
from podusv_cli.figures.sheet import figure
from podusv_cli.figures.shown import Shown, about, unit
from podusv_cli.figures.style import legend, new_figure

PANEL_HEIGHT = 1.15  # inches
TRUE: dict[str, Any] = {"linewidth": 3.5, "alpha": 0.3, "linestyle": "-"}
MEASURED: dict[str, Any] = {"linestyle": "", "marker": ".", "markersize": 2.0, "alpha": 0.35}
ESTIMATE: dict[str, Any] = {"linewidth": 0.6}
OUTAGE: dict[str, Any] = {"color": "#444444", "alpha": 0.15, "linewidth": 0.0, "zorder": 0.0}


@figure(
    "estimates", place=8, signals=tuple(f"{state.name}_est" for state in STATE),
    caption="what the law is given in place of the true state: broad and pale the truth, dots what "
    "the sensors deliver, curves the estimate; on the right, how far estimate and dots are from "
    "the truth; shaded, the outages of the sensor",
)  # fmt: skip
def estimates(runs: Sequence[Shown], columns: int) -> Figure:
    """A row for each quantity of the state: its values, and its errors."""
    having = [run for run in runs if run.has("x_est")]
    figure = new_figure(columns, 0.7 + PANEL_HEIGHT * len(STATE))
    panels = figure.subplots(len(STATE), 2, sharex=True)
    for place, (state, (values, errors)) in enumerate(zip(STATE, panels, strict=True)):
        for run in having:
            _draw(values, run, state.name, fitted=run in scaling(having), error=False)
            _draw(errors, run, state.name, fitted=run in scaling(having), error=True)
        _shade((values, errors), having, place)
        symbol, unit_of = about(having, state.name).symbol, unit(about(having, state.name))
        values.set_ylabel(f"${symbol}$ [{unit_of}]")
        errors.set_ylabel(f"error of ${symbol}$ [{unit_of}]")
    for axes in panels[-1]:
        axes.set_xlabel(TIME)
    legend(figure)
    return figure


def _draw(axes: Axes, run: Shown, name: str, *, fitted: bool, error: bool) -> None:
    """The estimate of a quantity over truth and measured values, or both less the truth."""
    t, true = run.during(name, None)
    less = true if error else np.zeros_like(true)
    if not error:
        draw_curve(axes, (t, true), fitted=fitted, color=run.color, label="_true", **TRUE)
    measured = f"{name}_m"
    if run.has(measured):
        fresh = _fresh(run.signal(measured))
        dots = thinned(t[fresh], (run.signal(measured) - less)[fresh])
        draw_curve(axes, dots, fitted=fitted, color=run.color, label="_measured", **MEASURED)
    draw_run(axes, run, (t, run.signal(f"{name}_est") - less), fitted=fitted, **ESTIMATE)


def _fresh(measured: Vector) -> NDArray[np.intp]:
    """The rows in which a value differs from the last one; else that is held and not delivered."""
    return np.flatnonzero(np.diff(measured)) + 1


def _shade(panels: Sequence[Axes], runs: Sequence[Shown], place: int) -> None:
    """Shade the outages of the sensor of this quantity, in any of the runs."""
    start, end = min(run.start for run in runs), max(run.end for run in runs)
    spans = {
        (max(first, start), min(last, end))
        for run in runs
        for first, last in run.about.outages[place]
        if first < end and last > start
    }
    for axes in panels:
        for first, last in sorted(spans):
            axes.axvspan(first, last, label="outage of the sensor", **OUTAGE)
