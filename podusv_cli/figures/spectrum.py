"""The settled demand over frequency, beside that of the disturbance that it answers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from podusv_cli.core.spectrum import periodogram
from podusv_cli.figures.sheet import figure
from podusv_cli.figures.style import Shown, about, legend, new_figure, unit

DEMANDS = {"tau_u_cmd": "b_u", "tau_r_cmd": "b_r"}  # what the law demands, and what disturbs it
SEA: dict[str, Any] = {"color": "#444444", "linestyle": (0, (1, 1)), "label": "disturbance"}
DECADES = 6  # shown below the largest harmonic
HEIGHT = 2.4  # inches


@figure(
    "spectrum", place=8, signals=tuple(DEMANDS),
    caption="rms of each harmonic of the settled demand, and of the disturbance on the same axis "
    "(of the first run); what is faster than the disturbance comes from the law",
)  # fmt: skip
def spectrum(runs: Sequence[Shown], columns: int) -> Figure:
    """Demands in surge and yaw over angular frequency, of runs that got to their settled part."""
    whole = [run for run in runs if run.end > run.steady_from]
    figure = new_figure(columns, HEIGHT if columns == 2 else 2 * HEIGHT)
    panels = figure.subplots(1, 2) if columns == 2 else figure.subplots(2, 1)
    for axes, (demand, load) in zip(panels, DEMANDS.items(), strict=True):
        for run in (run for run in whole[:1] if run.has(load)):
            _draw(axes, run, load, **SEA)
        for run in (run for run in whole if run.has(demand)):
            _draw(axes, run, demand, **run.look)
        _scales(axes)
        axes.set_xlabel("angular frequency [rad/s]")
        axes.set_ylabel(f"rms of ${about(runs, demand).symbol}$ [{unit(about(runs, demand))}]")
    legend(figure, columns)
    return figure


def _draw(axes: Axes, run: Shown, name: str, **look: Any) -> None:
    """The harmonics of one signal's settled part."""
    rates, power = periodogram(*run.during(name, (run.steady_from, run.end)))
    axes.plot(rates[1:], np.sqrt(power[1:]), **look)


def _scales(axes: Axes) -> None:
    """Both axes logarithmic, down to what rounding leaves."""
    top = max((float(np.max(line.get_ydata(), initial=0.0)) for line in axes.lines), default=0.0)
    if np.isfinite(top) and top > 0.0:
        axes.set(xscale="log", yscale="log", ylim=(top * 10.0**-DECADES, 3.0 * top))
