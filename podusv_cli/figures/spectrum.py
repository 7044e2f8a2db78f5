"""The settled demand over frequency, beside that of the disturbance that it answers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from podusv_cli.core.spectrum import periodogram
from podusv_cli.figures.curves import mark
from podusv_cli.figures.sheet import figure
from podusv_cli.figures.shown import Shown, about, unit
from podusv_cli.figures.style import legend, new_figure, remark

DEMANDS = {"tau_u_cmd": "b_u", "tau_r_cmd": "b_r"}  # what the law demands, and what disturbs it
SWAY = {"tau_v_cmd": "b_v"}  # of actuators that take it
AXES = {"tau_u_cmd": "surge", "tau_r_cmd": "yaw", "tau_v_cmd": "sway"}
SEA: dict[str, Any] = {"color": "#444444", "linestyle": (0, (1, 1)), "label": "disturbance"}
DECADES = 6  # shown below the largest harmonic
HEIGHT = 2.4  # inches


@figure(
    "spectrum",
    place=8,
    signals=tuple(DEMANDS),
    caption="rms of the settled demand in each harmonic, and of the disturbance on the same axis "
    "(of the first run); Hann's window spreads a line over three harmonics; a line that the "
    "disturbance and the path do not have comes from the law",
)
def spectrum(runs: Sequence[Shown], columns: int) -> Figure:
    """Demands over angular frequency, of runs that got to their settled part."""
    whole = [run for run in runs if run.counts_to > run.steady_from]
    demands = DEMANDS | {d: b for d, b in SWAY.items() if any(run.has(d) for run in runs)}
    count = len(demands)
    figure = new_figure(columns, HEIGHT if columns == 2 else count * HEIGHT)
    panels = figure.subplots(1, count) if columns == 2 else figure.subplots(count, 1)
    for axes, (demand, load) in zip(panels, demands.items(), strict=True):
        for run in (run for run in whole[:1] if run.has(load)):
            _draw(axes, run, load, **SEA)
        for run in (run for run in whole if run.has(demand)):
            mark(_draw(axes, run, demand, **run.line_style), run)
        if whole:
            _scales(axes)
        else:
            remark(axes, "no run has a settled part here")
        axes.set_title(AXES[demand])
        axes.set_xlabel("angular frequency [rad/s]")
        axes.set_ylabel(f"rms of ${about(runs, demand).symbol}$ [{unit(about(runs, demand))}]")
    legend(figure)
    return figure


def _draw(axes: Axes, run: Shown, name: str, **look: Any) -> Line2D:
    """Draw the rms of each harmonic of one signal's settled part over frequency; the line."""
    rates, power = periodogram(*run.during(name, (run.steady_from, run.counts_to)))
    # Rate 0, the mean, has no place on a logarithmic axis.
    return axes.plot(rates[1:], np.sqrt(power[1:]), **look)[0]


def _scales(axes: Axes) -> None:
    """Make both axes logarithmic, and cut off small harmonics.

    The vertical axis begins DECADES below the largest harmonic; the other ends at the last harmonic
    above that.
    """
    curves = [np.array(line.get_data()) for line in axes.lines]
    top = max((float(np.max(rms, initial=0.0)) for _, rms in curves), default=0.0)
    if np.isfinite(top) and top > 0.0:
        floor = top * 10.0**-DECADES
        last = max(float(np.max(rates[rms > floor], initial=0.0)) for rates, rms in curves)
        # Some room is left above the highest and beyond the last harmonic that is shown.
        axes.set(xscale="log", yscale="log", ylim=(floor, 3.0 * top))
        axes.set_xlim(right=1.1 * last)
