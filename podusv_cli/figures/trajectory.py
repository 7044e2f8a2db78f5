"""The tracking trajectory in the plane, the paper's figure 3."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording
from podusv_cli.figures.curves import Span, scaling
from podusv_cli.figures.sheet import figure
from podusv_cli.figures.style import TARGET_LOOK, Shown, legend, new_figure

HULL = np.array([(0.5, 0.0), (0.25, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.25, -0.5)])
SILHOUETTES = 9
LAST_PART = 0.05  # of the run, in the close-up
NEAREST, FARTHEST = 2.0, 20.0  # lengths from the middle of the close-up to its edges
POINTS = 3000  # of a track, at most about
MARK: dict[str, Any] = {"color": "#444444", "linestyle": "none"}


def hull(x: float, y: float, psi: float, *, length: float, beam: float) -> Vector:
    """Outline of the vessel on a map: columns east, north [m]."""
    ahead, right = (HULL * (length, beam)).T
    north = x + ahead * np.cos(psi) - right * np.sin(psi)
    east = y + ahead * np.sin(psi) + right * np.cos(psi)
    return np.column_stack([east, north])


@dataclass(frozen=True)
class Target:
    """A target, the runs that follow it, how it is drawn, and a log that holds its whole track."""

    runs: Sequence[Shown]
    look: dict[str, Any]
    recording: Recording


def targets(runs: Sequence[Shown]) -> list[Target]:
    """Every target that differs from the others, as long as any of its runs lasts."""
    groups: list[list[Shown]] = []
    for run in runs:
        group = next((g for g in groups if g[0].scenario.path == run.scenario.path), None)
        if group is None:
            groups.append([run])
        else:
            group.append(run)
    return [_target(group, only=len(groups) == 1) for group in groups]


def _target(group: Sequence[Shown], *, only: bool) -> Target:
    longest = max(group, key=lambda run: run.end).recording
    if only:
        return Target(group, {**TARGET_LOOK, "label": "target"}, longest)
    label = f"target of {', '.join(run.name for run in group)}"
    look = {**TARGET_LOOK, "linestyle": group[0].linestyle, "label": label}
    return Target(group, look, longest)


def enlargement(runs: Sequence[Shown]) -> float:
    """How many times larger than life hulls must be drawn to be seen on a map of the whole run."""
    tracks = [target.recording for target in targets(runs)]
    spread = max(float(np.ptp(log["x_d"]) + np.ptp(log["y_d"])) for log in tracks)
    return max(1.0, round(0.05 * spread / max(run.length for run in runs)))


def bounds(runs: Sequence[Shown]) -> tuple[Span, Span]:
    """Limits east and north [m] of a map of the targets and of the runs that finished, if any.

    Where none finished, targets alone.
    """
    logs = [target.recording for target in targets(runs)]
    pairs = [(log["y_d"], log["x_d"]) for log in logs]
    pairs += [(run.recording["y"], run.recording["x"]) for run in runs if run.whole]
    pairs += [(run.recording["y"][:1], run.recording["x"][:1]) for run in runs]
    corners = ([(part.min(), part.max()) for part in parts] for parts in zip(*pairs, strict=True))
    east, north = (np.ravel(extremes) for extremes in corners)
    margin = 0.06 * max(float(np.ptp(east)), float(np.ptp(north)), 1.0)
    return (
        (float(east.min()) - margin, float(east.max()) + margin),
        (float(north.min()) - margin, float(north.max()) + margin),
    )


def map_axes(axes: Axes, east: Span, north: Span) -> None:
    """Make the axes a map with these limits [m] and equal scales."""
    axes.set_xlim(*east)
    axes.set_ylim(*north)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel("$y$ [m], east")
    axes.set_ylabel("$x$ [m], north")


def hull_of(run: Shown, t: float, scale: float) -> Vector:
    """Outline of a run's vessel at a time [s], drawn `scale` times as large."""
    x, y, psi = (run.at(t, name) for name in ("x", "y", "psi"))
    return hull(x, y, psi, length=scale * run.length, beam=scale * run.beam)


@figure(
    "trajectory", place=1, signals=("x", "y"), source="the paper's figure 3",
    caption="tracks and target on a map; aside, the end of the run close up, framed on the map",
)  # fmt: skip
def trajectory(runs: Sequence[Shown], columns: int) -> Figure:
    """Tracks and target on a map, hulls enlarged to show the heading; the end of the run aside."""
    east, north = bounds(runs)
    wide = columns == 2
    shape = float(np.clip(np.ptp(east) / np.ptp(north), 0.6, 1.6))
    figure = new_figure(columns, 3.7 if wide else 6.0)
    ratios = {"width_ratios": (shape, 1.0)} if wide else {"height_ratios": (1.0, shape)}
    rows = 1 if wide else 2
    whole, end = figure.subplots(rows, 3 - rows, squeeze=False, gridspec_kw=ratios).ravel()
    _whole(whole, runs)
    map_axes(whole, east, north)
    box = _end(end, runs)
    whole.add_patch(Rectangle(*box, fill=False, edgecolor="#444444", linewidth=0.5))
    legend(figure, columns)
    return figure


def _whole(axes: Axes, runs: Sequence[Shown]) -> None:
    _draw_tracks(axes, targets(runs), runs, (0.0, max(run.end for run in runs)))
    scale = enlargement(runs)
    times = np.linspace(0.0, max(run.end for run in runs), SILHOUETTES)
    for run in runs:
        for t in times[times <= run.end]:
            outline = hull_of(run, float(t), scale)
            axes.add_patch(Polygon(outline, fill=False, edgecolor=run.color, linewidth=0.6))
    starts = {(run.recording["y"][0], run.recording["x"][0]) for run in runs}
    axes.plot(*zip(*sorted(starts), strict=True), **MARK, marker="o", markersize=3.5, label="start")
    axes.set_title(f"hulls every {times[1]:.3g} s, {scale:.0f} times as large")


def _end(axes: Axes, runs: Sequence[Shown]) -> tuple[tuple[float, float], float, float]:
    """The last part of the runs that finished, to scale; corner, width and height of what is seen.

    The last part that all of them have: hulls are shown at one and the same time. Of several
    targets, the first with its runs.
    """
    finished = scaling(runs)
    target = next(target for target in targets(runs) if finished[0] in target.runs)
    kept = [run for run in finished if run in target.runs]
    last = min(run.end for run in kept)
    _draw_tracks(axes, [target], kept, ((1.0 - LAST_PART) * last, last))
    for run in kept:
        axes.add_patch(Polygon(hull_of(run, last, 1.0), color=run.color, alpha=0.3))
    east, north = (kept[0].at(last, name) for name in ("y_d", "x_d"))
    axes.plot([east], [north], **MARK, marker="+", markersize=7)
    away = max(np.hypot(run.at(last, "y") - east, run.at(last, "x") - north) for run in kept)
    length = max(run.length for run in kept)
    reach = min(max(NEAREST * length, 1.3 * away), FARTHEST * length)
    map_axes(axes, (east - reach, east + reach), (north - reach, north + reach))
    part, name = f"last {LAST_PART * last:.3g} s", target.look["label"]
    axes.set_title(f"{part}, hulls to scale at t = {last:g} s, {name} +")
    return (east - reach, north - reach), 2.0 * reach, 2.0 * reach


def _draw_tracks(axes: Axes, ahead: Sequence[Target], runs: Sequence[Shown], span: Span) -> None:
    """Tracks of targets and runs during a time [s]."""
    tracks = [(target.recording, "x_d", "y_d", target.look) for target in ahead]
    tracks += [(run.recording, "x", "y", run.look) for run in runs]
    for log, x, y, look in tracks:
        first, last = (int(row) for row in np.searchsorted(log["time"], span))
        # Thin in steps, not by extremes: a track may run in any direction.
        stride = max(1, (last + 1 - first) // POINTS)
        rows = slice(first, last + 1, stride)
        axes.plot(log[y][rows], log[x][rows], **look)
