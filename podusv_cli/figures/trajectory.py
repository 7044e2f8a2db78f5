"""The tracking trajectory in the plane, the paper's figure 3."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle

from podusv_cli.core.kernel import Vector
from podusv_cli.figures.curves import CUT, Span, mark, scaling
from podusv_cli.figures.page import Page
from podusv_cli.figures.sheet import figure
from podusv_cli.figures.shown import Shown
from podusv_cli.figures.style import legend, new_figure
from podusv_cli.figures.tracks import Target, bounds, rows_of, targets

HULL = np.array([(0.5, 0.0), (0.25, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.25, -0.5)])
LAST_PART = 0.05  # of the run, in the close-up of the end
INSTANTS = 2000  # at which the runs' distance from each other is looked at
APART = 0.1  # lengths; nearer runs are nowhere apart
NEAREST, FARTHEST = 2.0, 20.0  # lengths from the middle of the close-up to its edges
MARK: dict[str, Any] = {"color": "#444444", "linestyle": "none"}
ACCEPTANCE: dict[str, Any] = {"fill": False, "edgecolor": "#888888", "linewidth": 0.5}
WAYPOINT: dict[str, Any] = {**MARK, "marker": "s", "markersize": 5.0, "markerfacecolor": "none"}


def enlargement(runs: Sequence[Shown]) -> float:
    """How many times larger than life hulls must be drawn to be seen on a map of the whole run."""
    tracks = [target.track() for target in targets(runs)]
    spread = max(float(np.ptp(east) + np.ptp(north)) for east, north in tracks)
    return max(1.0, round(0.05 * spread / max(run.length for run in runs)))


def map_axes(axes: Axes, east: Span, north: Span) -> None:
    """Make the axes a map with these limits [m] and equal scales."""
    axes.set_xlim(*east)
    axes.set_ylim(*north)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel("$y$ [m], east")
    axes.set_ylabel("$x$ [m], north")


def hull_of(run: Shown, t: float, scale: float) -> Vector:
    """Outline of a run's vessel at a time [s], `scale` times as large: columns east, north [m]."""
    x, y, psi = (run.at(t, name) for name in ("x", "y", "psi"))
    vessel = run.scenario.vessel
    ahead, right = (HULL * (scale * vessel.length, scale * vessel.beam)).T
    north = x + ahead * np.cos(psi) - right * np.sin(psi)
    east = y + ahead * np.sin(psi) + right * np.cos(psi)
    return np.column_stack([east, north])


@figure(
    "trajectory", place=1, signals=("x", "y"), source="the paper's figure 3",
    caption="tracks and target: on a map with hulls enlarged, and close up, with hulls to scale, "
    "where the runs are farthest apart and at the end; x marks where a run ended early",
)  # fmt: skip
def trajectory(runs: Sequence[Shown], columns: int) -> Figure:
    """Tracks and target on a map, hulls enlarged to show the heading; close-ups aside."""
    east, north = bounds(runs)
    views = _views(runs)
    shape = float(np.ptp(east) / np.ptp(north))
    figure, whole, asides = _sheet(len(views), columns, shape)
    _whole(whole, runs)
    _mark_ends(whole, runs, east, north)
    map_axes(whole, east, north)
    for axes, view, letter in zip(asides, views, "bc", strict=False):
        (left, low), width = _close_up(axes, view)
        frame = Rectangle((left, low), width, width, fill=False, edgecolor="#444444", linewidth=0.5)
        whole.add_patch(frame)
        whole.annotate(letter, (left + width, low), (1, 0), textcoords="offset points", fontsize=6)
    legend(figure)
    return figure


def _sheet(asides: int, columns: int, shape: float) -> tuple[Page, Axes, list[Axes]]:
    """A figure with a large panel and some small ones, beside each other or one below the other.

    `shape` is the large panel's width over its height.
    """
    if columns == 2:
        part = 1.6 * float(np.clip(shape, 0.6, 1.2))
        figure = new_figure(columns, 0.9 + float(np.clip(2.8 / shape, 2.1, 3.0)))
        cells = figure.add_gridspec(1, 1 + asides, width_ratios=(part, *[1.0] * asides))
        places = [cells[0, place] for place in range(1 + asides)]
    else:
        height = float(np.clip(2.9 / shape, 1.6, 3.6))
        figure = new_figure(columns, height + 2.8)
        cells = figure.add_gridspec(2, asides, height_ratios=(height, 1.4))
        places = [cells[0, :], *(cells[1, place] for place in range(asides))]
    whole, *others = (figure.add_subplot(place) for place in places)
    return figure, whole, others


def _whole(axes: Axes, runs: Sequence[Shown]) -> None:
    _draw_tracks(axes, targets(runs), runs, (0.0, max(run.end for run in runs)))
    scale = enlargement(runs)
    for run in runs:
        for t in run.places * run.end:
            axes.add_patch(Polygon(hull_of(run, float(t), scale), **_outline(run)))
    starts = {(run.recording["y"][0], run.recording["x"][0]) for run in runs}
    axes.plot(*zip(*sorted(starts), strict=True), **MARK, marker="o", markersize=3.5, label="start")
    given = {point for run in runs for point in run.scenario.path.waypoints()}
    if given:
        north, east = zip(*sorted(given), strict=True)
        axes.plot(east, north, **WAYPOINT, label="waypoint")
    _accepting(axes, runs)
    words = f"hulls {scale:.0f} times as large" if scale > 1.0 else "hulls to scale"
    axes.set_title(words, loc="left")


def _accepting(axes: Axes, runs: Sequence[Shown]) -> None:
    """The circles within which the next leg of a path becomes active."""
    for north, east, radius in sorted({c for run in runs for c in run.scenario.path.circles()}):
        axes.add_patch(Circle((east, north), radius, **ACCEPTANCE))


def _outline(run: Shown) -> dict[str, Any]:
    """How a hull is drawn: not filled, and in the run's line style, so that none hides another."""
    style = run.linestyle
    return {"fill": False, "edgecolor": run.color, "linestyle": style, "linewidth": 0.7}


def _mark_ends(axes: Axes, runs: Sequence[Shown], east: Span, north: Span) -> None:
    """An x at the last place within the map of every run that did not finish."""
    for run in (run for run in runs if not run.whole):
        y, x = run.recording["y"], run.recording["x"]
        inside = (y > east[0]) & (y < east[1]) & (x > north[0]) & (x < north[1])
        for row in np.flatnonzero(inside)[-1:]:
            axes.plot([y[row]], [x[row]], color=run.color, **CUT)


@dataclass(frozen=True)
class View:
    """A close-up: a time and its name, the runs there, their target, the middle [m] east, north."""

    name: str
    t: float
    runs: Sequence[Shown]
    target: Target
    middle: Vector


def _views(runs: Sequence[Shown]) -> list[View]:
    """Where runs that finished are farthest apart, if anywhere, and the end that all of them have.

    Hulls are shown at one and the same time. Of several targets, the first with its runs.
    """
    finished = scaling(runs)
    target = next(target for target in targets(runs) if finished[0] in target.runs)
    kept = [run for run in finished if run in target.runs]
    last = min(run.end for run in kept)
    apart = _farthest_apart(kept, target, last)
    names = ("y_d", "x_d") if target.is_ahead else ("y", "x")
    aim = np.array([kept[0].at(last, name) for name in names])
    return [*apart, View("end", last, kept, target, aim)]


def _farthest_apart(runs: Sequence[Shown], target: Target, last: float) -> list[View]:
    """The view of the runs when they fill the largest box; none where that is in the last part."""
    times = np.linspace(0.0, last, INSTANTS)
    logs = [run.recording for run in runs]
    tracks = np.array(
        [[np.interp(times, log["time"], log[name]) for name in ("y", "x")] for log in logs]
    )
    sizes = np.hypot(*np.ptp(tracks, axis=0))
    worst = int(np.argmax(sizes))
    if sizes[worst] < APART * runs[0].length or times[worst] > (1.0 - LAST_PART) * last:
        return []
    low, high = tracks[:, :, worst].min(axis=0), tracks[:, :, worst].max(axis=0)
    return [View("largest gap", float(times[worst]), runs, target, 0.5 * (low + high))]


def _close_up(axes: Axes, view: View) -> tuple[tuple[float, float], float]:
    """Tracks around the time of the view, hulls to scale; corner and width of what is seen."""
    last = min(run.end for run in view.runs)
    span = view.t - LAST_PART * last, min(view.t + LAST_PART * last, last)
    _draw_tracks(axes, [view.target], view.runs, span)
    for run in view.runs:
        axes.add_patch(Polygon(hull_of(run, view.t, 1.0), **_outline(run)))
    if view.target.is_ahead:
        aim = [[view.runs[0].at(view.t, name)] for name in ("y_d", "x_d")]
        label = f"{view.target.line_style['label']} at this time"
        axes.plot(*aim, **MARK, marker="+", markersize=7, label=label)
    at = np.array([[run.at(view.t, name) for name in ("y", "x")] for run in view.runs])
    length = max(run.length for run in view.runs)
    away = 1.3 * float(np.max(np.hypot(*(at - view.middle).T)))
    reach = min(max(NEAREST * length, away), FARTHEST * length)
    (left, low), (right, high) = view.middle - reach, view.middle + reach
    map_axes(axes, (left, right), (low, high))
    axes.set_title(f"{view.name}, t = {view.t:.4g} s", loc="left")
    return (left, low), 2.0 * reach


def _draw_tracks(axes: Axes, ahead: Sequence[Target], runs: Sequence[Shown], span: Span) -> None:
    """Tracks of targets, and of runs with their markers, during a time [s]."""
    for target in (target for target in ahead if target.in_sight):
        axes.plot(*target.track(span), **target.line_style)
    for run in runs:
        log, rows = run.recording, rows_of(run.recording, span)
        (track,) = axes.plot(log["y"][rows], log["x"][rows], **run.line_style)
        mark(track, run, log["time"][rows])
