"""What the law is given in place of the true state, and how far it is from the truth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from podusv_cli.core.kernel import Vector
from podusv_cli.core.signal import STATE, Signal
from podusv_cli.figures.curves import draw_curve, draw_run, draw_run_curve, thin_curve
from podusv_cli.figures.panels import TIME
from podusv_cli.figures.scales import scaling
from podusv_cli.figures.sheet import figure
from podusv_cli.figures.shown import Shown, shorten, unit
from podusv_cli.figures.style import WIDTHS, legend, new_figure

PANEL_HEIGHT = 1.15  # inches
SMALL_HEIGHT = 0.85  # inches, where every run has panels of its own
ABREAST = {1: 2, 2: 5}  # runs beside each other, by the width in columns
LETTER = 0.075  # inches, of a run's name above its panels
TRUE: dict[str, Any] = {"linewidth": 3.5, "alpha": 0.3, "linestyle": "-"}
MEASURED: dict[str, Any] = {"linestyle": "", "marker": ".", "markersize": 2.0, "alpha": 0.35}
ESTIMATE: dict[str, Any] = {"linewidth": 0.6}
OUTAGE: dict[str, Any] = {"color": "#444444", "alpha": 0.15, "linewidth": 0.0, "zorder": 0.0}


@figure(
    "estimates",
    place=8,
    signals=tuple(f"{state.name}_est" for state in STATE),
    caption="what the law is given in place of the true state: dots what the sensors deliver, "
    "curves the estimate; of a run alone both beside the truth, broad and pale, and how far they "
    "are from it; of several runs how far, each in its own column on common axes; shaded, the "
    "outages of the sensor",
)
def estimates(runs: Sequence[Shown], columns: int) -> Figure:
    """A row for each quantity of the state: values and errors of one run, errors of several."""
    having = [run for run in runs if run.has("x_est")]
    return _alone(having[0], columns) if len(having) == 1 else _small_multiples(having, columns)


def _alone(run: Shown, columns: int) -> Figure:
    """The values of a run and, beside them, its errors."""
    figure = new_figure(columns, 0.7 + PANEL_HEIGHT * len(STATE))
    panels = figure.subplots(len(STATE), 2, sharex=True)
    for place, (state, (values, errors)) in enumerate(zip(STATE, panels, strict=True)):
        _draw(values, run, state.name, fitted=True, error=False)
        _draw(errors, run, state.name, fitted=True, error=True)
        _shade((values, errors), [run], place)
        values.set_ylabel(f"${state.symbol}$ [{unit(state)}]")
        errors.set_ylabel(_error_label(state))
    for axes in panels[-1]:
        axes.set_xlabel(TIME)
    legend(figure)
    return figure


def _small_multiples(runs: Sequence[Shown], columns: int) -> Figure:
    """The errors of every run in a column of its own; many runs in blocks below each other.

    `columns` is the width in columns of a page.
    """
    blocks = -(-len(runs) // ABREAST[columns])
    abreast = -(-len(runs) // blocks)
    # Each block has 0.4 inches for the names of its runs; 0.7 are for legend and time axis.
    figure = new_figure(columns, 0.7 + 0.4 * blocks + SMALL_HEIGHT * blocks * len(STATE))
    cells = figure.add_gridspec(blocks * len(STATE), abreast)
    # Letters of a name that fit above a column, less the panel's own letter.
    longest = int(WIDTHS[columns] / abreast / LETTER) - len("(aa) ...")
    fitted, first = scaling(runs), dict[int, Axes]()
    for number, run in enumerate(runs):
        block, column = divmod(number, abreast)
        for place, state in enumerate(STATE):
            axes = figure.add_subplot(
                cells[block * len(STATE) + place, column],
                sharex=first.get(0),
                sharey=first.get(place),
            )
            first.setdefault(place, axes)
            _draw(axes, run, state.name, fitted=run in fitted, error=True)
            _shade([axes], [run], place)
            axes.tick_params(labelbottom=place == len(STATE) - 1, labelleft=column == 0)
            # A panel is too low for the label in one line.
            axes.set_ylabel("" if column else _error_label(state).replace(" $", "\n$"))
        axes.set_xlabel(TIME)
        # The highest panel of this column: the first of those that were just added.
        axes.figure.axes[-len(STATE)].set_title(shorten(run.name, longest), loc="left")
    legend(figure)
    return figure


def _error_label(state: Signal) -> str:
    return f"error of ${state.symbol}$ [{unit(state)}]"


def _draw(axes: Axes, run: Shown, name: str, *, fitted: bool, error: bool) -> None:
    """The estimate of a quantity over truth and measured values; with `error`, both less the truth.

    `name` is the quantity in STATE; the scale fits the curves where they are `fitted`.
    """
    t, true = run.during(name, None)
    less = true if error else np.zeros_like(true)
    if not error:
        draw_run_curve(axes, run, (t, true), fitted=fitted, color=run.color, label="_true", **TRUE)
    measured = f"{name}_m"
    if run.has(measured):
        fresh = _fresh(run.signal(measured))
        dots = thin_curve(t[fresh], (run.signal(measured) - less)[fresh])
        draw_curve(axes, dots, fitted=fitted, color=run.color, label="_measured", **MEASURED)
    draw_run(axes, run, (t, run.signal(f"{name}_est") - less), fitted=fitted, **ESTIMATE)


def _fresh(measured: Vector) -> NDArray[np.intp]:
    """The rows in which a value (n,) differs from the last one; else it is held, not delivered."""
    return np.flatnonzero(np.diff(measured)) + 1


def _shade(panels: Sequence[Axes], runs: Sequence[Shown], place: int) -> None:
    """Shade the outages of a quantity's sensor in any of the runs.

    `place` is the quantity's in STATE.
    """
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
