"""The tracking trajectory in the plane, the paper's figure 3."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from podusv_cli.figures.style import TARGET_LOOK, Shown, new_figure
from podusv_cli.kernels import Vector

HULL = np.array([(0.5, 0.0), (0.25, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.25, -0.5)])
SILHOUETTES = 9
LAST_PART = 0.05  # of the run, in the close-up


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


def bounds(runs: Sequence[Shown]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Limits east and north [m] of a map of the target and of the runs that finished, if any."""
    kept = [run.recording for run in runs if run.whole] or [runs[0].recording]
    east = np.concatenate([log[name] for log in kept for name in ("y", "y_d")])
    north = np.concatenate([log[name] for log in kept for name in ("x", "x_d")])
    margin = 0.06 * max(float(np.ptp(east)), float(np.ptp(north)), 1.0)
    return (
        (float(east.min()) - margin, float(east.max()) + margin),
        (float(north.min()) - margin, float(north.max()) + margin),
    )


def _draw_tracks(axes: Axes, runs: Sequence[Shown], since: float) -> None:
    """The target's and the runs' tracks from a time [s] on, on scales that are equal."""
    for log, x, y, look in (
        (runs[0].recording, "x_d", "y_d", {**TARGET_LOOK, "label": "target"}),
        *((run.recording, "x", "y", run.look) for run in runs),
    ):
        first = int(np.searchsorted(log["time"], since))
        # Thin in steps, not by extremes: a track may run in any direction.
        stride = max(1, (len(log["time"]) - first) // 3000)
        axes.plot(log[y][first::stride], log[x][first::stride], **look)
    axes.set_xlabel("$y$ [m], east")
    axes.set_ylabel("$x$ [m], north")


def _draw_hull(axes: Axes, shown: Shown, row: int, scale: float, **look: Any) -> None:
    x, y, psi = (float(shown.recording[name][row]) for name in ("x", "y", "psi"))
    outline = hull(x, y, psi, length=scale * shown.length, beam=scale * shown.beam)
    axes.add_patch(Polygon(outline, closed=True, edgecolor=shown.color, **look))


def trajectory(runs: Sequence[Shown], columns: int) -> Figure:
    """Tracks and target on a map, hulls enlarged to show the heading; the end of the run aside."""
    figure = new_figure(columns, 3.7 if columns == 2 else 6.0)
    shape = (1, 2) if columns == 2 else (2, 1)
    whole, end = figure.subplots(*shape)
    _whole(whole, runs)
    _end(end, runs)
    handles, labels = whole.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3 * columns)
    return figure


def _whole(axes: Axes, runs: Sequence[Shown]) -> None:
    _draw_tracks(axes, runs, 0.0)
    scale = enlargement(runs)
    for run in runs:
        rows = np.linspace(0, len(run.recording["time"]) - 1, SILHOUETTES).astype(int)
        for row in rows:
            _draw_hull(axes, run, row, scale, facecolor="none", linewidth=0.6)
    first = runs[0].recording
    axes.plot(first["y"][0], first["x"][0], "o", color="#444444", markersize=3.5, label="start")
    east, north = bounds(runs)
    axes.set_xlim(*east)
    axes.set_ylim(*north)
    axes.set_aspect("equal", adjustable="box")
    axes.set_title(f"whole run, hulls drawn {scale:.0f} times as large")


def _end(axes: Axes, runs: Sequence[Shown]) -> None:
    """The last part of the runs that finished, around the target's last position, to scale."""
    kept = [run for run in runs if run.whole] or list(runs)
    target = kept[0].recording
    last = float(target["time"][-1])
    _draw_tracks(axes, kept, (1.0 - LAST_PART) * last)
    for run in kept:
        _draw_hull(axes, run, -1, 1.0, facecolor=run.color, alpha=0.3)
    east, north = float(target["y_d"][-1]), float(target["x_d"][-1])
    axes.plot(east, north, "+", color="#444444", markersize=7)
    away = [np.hypot(run.recording["x"][-1] - north, run.recording["y"][-1] - east) for run in kept]
    reach = min(max(3.0 * kept[0].length, 1.3 * float(max(away))), 20.0 * kept[0].length)
    axes.set_xlim(east - reach, east + reach)
    axes.set_ylim(north - reach, north + reach)
    axes.set_aspect("equal", adjustable="box")
    axes.set_title(f"last {LAST_PART * last:.3g} s, hulls to scale at t = {last:g} s, target +")
