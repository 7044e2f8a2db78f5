"""Control inputs: early peak and settled part side by side, the paper's figures 5 to 7."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from podusv_cli.figures.style import Shown, axis_label, draw_signal, frame_finished, new_figure

EARLY = 0.005  # of the run: where the peaks are
TALL = 20.0  # a peak this many times the settled inputs gets a logarithmic axis
LOADS = (("tau_u", "tau_u_cmd"), ("tau_r", "tau_r_cmd"))


def _panel(
    axes: Axes, runs: Sequence[Shown], names: tuple[str, str], span: tuple[float, float]
) -> None:
    applied, asked = names
    for shown in runs:
        if not np.array_equal(shown.recording[applied], shown.recording[asked]):
            draw_signal(
                axes,
                shown,
                asked,
                between=span,
                linewidth=0.5,
                alpha=0.6,
                label=f"{shown.label}, asked",
            )
        draw_signal(axes, shown, applied, between=span)
    axes.set_xlim(*span)
    frame_finished(axes, runs)


def _compress(early: Axes, settled: Axes) -> None:
    """Make a tall peak's axis logarithmic beyond the size of the settled inputs."""
    usual = max(abs(limit) for limit in settled.get_ylim())
    if max(abs(limit) for limit in early.get_ylim()) > TALL * usual > 0.0:
        early.set_yscale("symlog", linthresh=10.0 ** np.ceil(np.log10(usual)))


def controls(runs: Sequence[Shown], columns: int) -> Figure:
    """Surge force and yaw moment: what acts on the hull, and thin what the law asked for."""
    figure = new_figure(columns, 3.9)
    panels = figure.subplots(2, 2, sharex="col")
    end = max(float(shown.recording["time"][-1]) for shown in runs)
    start = min(shown.steady_from for shown in runs)
    spans = ((0.0, EARLY * end), (start if start < end else 0.0, end))
    for row, names in zip(panels, LOADS, strict=True):
        for axes, span in zip(row, spans, strict=True):
            _panel(axes, runs, names, span)
        row[0].set_ylabel(axis_label(names[0]))
        _compress(row[0], row[1])
    for axes, title in zip(panels[0], ("early", "settled"), strict=True):
        axes.set_title(title)
    for axes in panels[1]:
        axes.set_xlabel("time [s]")
    handles, labels = panels[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2 * columns)
    return figure
