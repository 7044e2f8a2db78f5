"""Control inputs: early peak, whole run and settled part, the paper's figures 5 to 7."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from podusv_cli.figures.curves import compress, differ, draw_curve, draw_signal
from podusv_cli.figures.panels import PEAKS, TIME
from podusv_cli.figures.scales import Span
from podusv_cli.figures.sheet import figure
from podusv_cli.figures.shown import Shown, axis_label
from podusv_cli.figures.style import legend, new_figure

EARLY = 0.005  # of the run: where the peaks are
EARLY_ROWS = 20  # at least
# On the hull, and what the law demands; in the order of a demand.
LOADS = (("tau_u", "tau_u_cmd"), ("tau_r", "tau_r_cmd"))
SWAY = ("tau_v", "tau_v_cmd")  # of vessels that can be asked for it
LIMIT: dict[str, Any] = {"color": "#444444", "linewidth": 0.8, "linestyle": (0, (6, 2, 1, 2))}
CLAIMED: dict[str, Any] = {"color": "#444444", "linewidth": 0.8, "linestyle": (0, (1, 1))}
HEIGHTS = {1: 1.25, 2: 1.4}  # inches of a row of panels, by the width in columns


@figure(
    "controls",
    place=3,
    signals=("tau_u", "tau_r"),
    source="the paper's figures 5 to 7",
    caption="surge force and yaw moment: what acts on the hull, with the actuator's limits, and in "
    "panels of their own what the law demands where the actuator limits it; the first moments, the "
    "whole run, the settled part" + PEAKS,
)
def controls(runs: Sequence[Shown], columns: int) -> Figure:
    """Surge force and yaw moment on the hull, and what the law demands where this differs.

    `columns` is the width in columns of a page: it decides how panels are arranged.
    """
    spans = _spans(runs)
    loads = (*LOADS, SWAY) if any(run.has(SWAY[1]) for run in runs) else LOADS
    kinds = 2 if any(differ(run, *names) for run in runs for names in loads) else 1
    rows = kinds * (len(loads) if columns == 2 else len(spans))
    # 0.7 inches are for the legend and the labels of the time axis.
    figure = new_figure(columns, 0.7 + HEIGHTS[columns] * rows)
    cells = _cells(figure, (len(loads), kinds), list(spans), columns)
    for (load, kind, part), axes in np.ndenumerate(cells):
        _panel(axes, runs, (load, kind), list(spans.values())[part])
        if kind == kinds - 1 and part == 0:
            _draw_claimed_peak(axes, runs, loads[load][1])
        if columns == 1 or part == 0:
            axes.set_ylabel(axis_label(runs, loads[load][kind]))
    # The lowest panels, under which the labels of the time axis stand.
    for axes in cells[-1, -1] if columns == 2 else cells[:, -1, -1]:
        axes.set_xlabel(TIME)
    legend(figure)
    return figure


def _cells(
    figure: Figure, shape: tuple[int, int], parts: Sequence[str], columns: int
) -> NDArray[Any]:
    """Panels (loads, kinds, parts): parts of the run side by side, or one above the other.

    They stand above each other where the page has one column (`columns`). `shape` is how many loads
    and kinds there are; `parts` are the names of the parts.
    """
    (loads, kinds), count = shape, len(parts)
    if columns == 2:
        cells = figure.subplots(loads * kinds, count, sharex="col").reshape(loads, kinds, count)
    else:
        panels = figure.subplots(kinds * count, loads, sharex="row")
        cells = panels.reshape(kinds, count, loads).transpose(2, 0, 1)
    for (load, kind, part), axes in np.ndenumerate(cells):
        if columns == 1 or load == kind == 0:
            axes.set_title(parts[part])
    return np.asarray(cells)


def _spans(runs: Sequence[Shown]) -> dict[str, Span]:
    """Names and limits [s] of the parts to show: the first moments, all, and the settled part."""
    start, end = min(run.start for run in runs), max(run.end for run in runs)
    period = min(float(np.diff(run.recording["time"][:2])[0]) for run in runs)
    settled, counted = min(run.steady_from for run in runs), max(run.counts_to for run in runs)
    return {
        "early": (start, min(end, start + max(EARLY * (end - start), EARLY_ROWS * period))),
        "whole run": (start, end),
        "settled": (settled, counted) if start < settled < counted else (start, end),
    }


def _panel(axes: Axes, runs: Sequence[Shown], shown: tuple[int, int], span: Span) -> None:
    """One load during a part of the run [s]: `shown` is its place in LOADS, and its kind.

    Kind 0 is the load on the hull, kind 1 the law's demand.
    """
    load, kind = shown
    name = (*LOADS, SWAY)[load][kind]
    draw_signal(axes, runs, name, span=span)
    axes.set_xlim(*span)
    axes.update_datalim([(span[0], 0.0)])  # forces mean something beside none at all
    axes.autoscale_view(scalex=False)
    bounded = kind == 0 and all(run.has("saturated") for run in runs)
    if bounded:
        _limits(axes, runs, load, span)
    else:
        compress(axes, runs, name)


def _draw_claimed_peak(axes: Axes, runs: Sequence[Shown], name: str) -> None:
    """Lines at plus and minus the early peak of the demand `name` that a claim states."""
    for peak in {run.peaks[name] for run in runs if name in run.peaks}:
        for side in (peak, -peak):
            axes.axhline(side, label="peak that a claim names", **CLAIMED)


def _limits(axes: Axes, runs: Sequence[Shown], load: int, span: Span) -> None:
    """Lines at the actuators' constant limits of a load (its place), over a span [s]."""
    limits = {limit for run in runs for limit in run.about.limits[load : load + 1]}
    for limit in sorted(limit for limit in limits if limit is not None):
        for side in (limit, -limit):
            line = np.array(span), np.array([side, side])
            # Not fitted: limits far above the loads would flatten these.
            draw_curve(axes, line, fitted=False, label="limit of the actuator", **LIMIT)
