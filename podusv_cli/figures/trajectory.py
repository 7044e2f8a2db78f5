"""The tracking trajectory in the plane, the paper's figure 3."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from podusv_cli.figures.style import TARGET_LOOK, Shown, new_figure, thinned
from podusv_cli.kernels import Vector

HULL = np.array([(0.5, 0.0), (0.25, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.25, -0.5)])
SILHOUETTES = 9


def hull(x: float, y: float, psi: float, *, length: float, beam: float) -> Vector:
    """Outline of the vessel on a map: columns east, north [m]."""
    ahead, right = (HULL * (length, beam)).T
    north = x + ahead * np.cos(psi) - right * np.sin(psi)
    east = y + ahead * np.sin(psi) + right * np.cos(psi)
    return np.column_stack([east, north])


def enlargement(runs: Sequence[Shown]) -> float:
    """How many times larger than life hulls must be drawn to be seen on a map of the whole run."""
    target = runs[0].recording
    spread = float(np.ptp(target["x_d"]) + np.ptp(target["y_d"]))
    return max(1.0, round(0.05 * spread / runs[0].length))


def _draw_track(axes: Axes, shown: Shown) -> None:
    # Thin in steps, not by extremes: a track may run in any direction.
    stride = max(1, len(shown.recording["time"]) // 3000)
    axes.plot(shown.recording["y"][::stride], shown.recording["x"][::stride], **shown.look)


def _draw_hulls(axes: Axes, shown: Shown, scale: float) -> None:
    rows = np.linspace(0, len(shown.recording["time"]) - 1, SILHOUETTES).astype(int)
    for row in rows:
        x, y, psi = (float(shown.recording[name][row]) for name in ("x", "y", "psi"))
        outline = hull(x, y, psi, length=scale * shown.length, beam=scale * shown.beam)
        axes.add_patch(
            Polygon(outline, closed=True, facecolor="none", edgecolor=shown.color, linewidth=0.6)
        )


def _map(axes: Axes, runs: Sequence[Shown]) -> None:
    first = runs[0].recording
    axes.plot(*thinned(first["y_d"], first["x_d"], 10**6), **TARGET_LOOK, label="target")
    for shown in runs:
        _draw_track(axes, shown)
    axes.set_aspect("equal", adjustable="datalim")


def trajectory(runs: Sequence[Shown], columns: int) -> Figure:
    """Tracks and target on a map, hulls enlarged to show the heading; the settled part aside."""
    figure = new_figure(columns, 3.4 if columns == 2 else 4.6)
    shape = (1, 2) if columns == 2 else (2, 1)
    whole, settled = figure.subplots(*shape)
    _map(whole, runs)
    scale = enlargement(runs)
    for shown in runs:
        _draw_hulls(whole, shown, scale)
    start = runs[0].recording
    whole.plot(start["y"][0], start["x"][0], "o", color="#444444", markersize=3.5, label="start")
    whole.set_title(f"whole run, hulls drawn {scale:.0f} times as large")
    _settled(settled, runs)
    for axes in (whole, settled):
        axes.set_xlabel("$y$ [m], east")
        axes.set_ylabel("$x$ [m], north")
    whole.legend(loc="best")
    return figure


def _settled(axes: Axes, runs: Sequence[Shown]) -> None:
    """The end of the run, close up: the last target position in the middle, hulls to scale."""
    _map(axes, runs)
    last = runs[0].recording
    reach = 3.0 * runs[0].length
    for shown in runs:
        record = shown.recording
        x, y, psi = (float(record[name][-1]) for name in ("x", "y", "psi"))
        outline = hull(x, y, psi, length=shown.length, beam=shown.beam)
        axes.add_patch(
            Polygon(outline, closed=True, facecolor=shown.color, alpha=0.25, edgecolor=shown.color)
        )
    axes.plot(last["y_d"][-1], last["x_d"][-1], "+", color="#444444", markersize=7)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlim(last["y_d"][-1] - reach, last["y_d"][-1] + reach)
    axes.set_ylim(last["x_d"][-1] - reach, last["x_d"][-1] + reach)
    axes.set_title(f"t = {last['time'][-1]:g} s, hulls to scale, target +")
