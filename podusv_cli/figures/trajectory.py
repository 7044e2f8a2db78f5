"""The tracking trajectory in the plane, the paper's figure 3."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle

from podusv_cli.core import escaping
from podusv_cli.core.kernel import Vector
from podusv_cli.figures.curves import AFTER, CUT, draw_run
from podusv_cli.figures.page import Page
from podusv_cli.figures.scales import Span, scaling
from podusv_cli.figures.sheet import figure
from podusv_cli.figures.shown import Shown, shorten
from podusv_cli.figures.style import WIDTHS, legend, new_figure, remark
from podusv_cli.figures.tracks import Target, bounds, rows_of, targets

HULL = np.array([(0.5, 0.0), (0.25, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.25, -0.5)])
LAST_PART = 0.05  # of the run, in the close-up of the end
INSTANTS = 2000  # at which the runs' distance from each other is looked at
APPROACH = 0.2  # of a run along a path, left out where its largest deviation is looked for
APART = 0.1  # lengths; nearer runs are nowhere apart
BROAD = (2.2, 0.8)  # points, the first and the last track
HIGH_MAP = 3.1  # inches, the height of a map beside close-ups
MAP_WIDTHS = (1.0, 3.6)  # inches, of such a map
WIDE_MAP = 1.6  # times as wide as high, from where a map stands above the close-ups
NAME = 36  # letters of a run's name in a title
DEVIATION, LEG = "e_ct", "leg"  # from a path that is followed, and how much of it is done
FRAME: dict[str, Any] = {"fill": False, "edgecolor": "#444444", "linewidth": 0.5}
LARGEST_FRAME = 0.7  # of the map: a close-up of more is not framed on it
LEAST_DISTANCE = 1e-4  # m, on a logarithmic axis
NEAREST, FARTHEST = 2.0, 20.0  # lengths from the middle of the close-up to its edges
MARK: dict[str, Any] = {"color": "#444444", "linestyle": "none"}
ACCEPTANCE: dict[str, Any] = {"fill": False, "edgecolor": "#888888", "linewidth": 0.5}
WAYPOINT: dict[str, Any] = {**MARK, "marker": "s", "markersize": 5.0, "markerfacecolor": "none"}


def enlargement(runs: Sequence[Shown]) -> float:
    """How many times larger than life hulls must be drawn to be seen on a map of the whole run.

    A hull is then about a twentieth of the targets' extents.
    """
    tracks = [target.track() for target in targets(runs)]
    spread = max(float(np.ptp(east) + np.ptp(north)) for east, north in tracks)
    return max(1.0, round(0.05 * spread / max(run.length for run in runs)))


def map_axes(axes: Axes, east: Span, north: Span) -> None:
    """Make the axes a map of at least these limits [m], with equal scales, that fills its panel."""
    axes.set_xlim(*east, auto=None)  # may be widened
    axes.set_ylim(*north, auto=None)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("$y$ [m], east")
    axes.set_ylabel("$x$ [m], north")


def hull_of(run: Shown, t: float, scale: float) -> Vector:
    """Outline (5, 2) of a run's vessel at a time [s], `scale` times as large: east, north [m]."""
    x, y, psi = (run.at(t, name) for name in ("x", "y", "psi"))
    ahead, right = (HULL * (scale * run.length, scale * run.about.beam)).T
    north = x + ahead * np.cos(psi) - right * np.sin(psi)
    east = y + ahead * np.sin(psi) + right * np.cos(psi)
    return np.column_stack([east, north])


@figure(
    "trajectory",
    place=1,
    signals=("x", "y"),
    source="the paper's figure 3",
    caption="tracks and target or path, on a map, with hulls enlarged where its title says so, and "
    "close up, with hulls to scale: on a path where a run is farthest from the path once it has "
    "come to a leg, else at the end and, where runs were farther apart before, at their largest "
    "gap; curves are the distance of each run from the path, of a run alone from the target, else "
    "from the first run at the same time; of tracks that coincide, the first is the broadest; x "
    "marks where a run ended early",
)
def trajectory(runs: Sequence[Shown], columns: int) -> Figure:
    """Tracks and target on a map, hulls enlarged to show the heading; close-ups and distances."""
    longest = enlargement(runs) * max(run.length for run in runs)
    east, north = bounds(runs, room=0.5 * longest)
    seen = views(runs)
    compared = [run for run in runs if run in seen[-1].target.runs]
    shape = float(np.ptp(east) / np.ptp(north))
    figure, whole, asides, below = _sheet(
        len(seen), len(compared) > 1 or bool(_own_distance(compared)), columns, shape
    )
    _whole(whole, runs)
    _mark_ends(whole, runs, east, north)
    map_axes(whole, east, north)
    for axes, view, letter in zip(asides, seen, "bc", strict=False):
        close_up(axes, view, runs)
        (left, low), width = view.middle - view.reach, 2.0 * view.reach
        if width > LARGEST_FRAME * max(np.ptp(east), np.ptp(north)):
            continue  # its edges would be lines across the map
        whole.add_patch(Rectangle((left, low), width, width, **FRAME))
        whole.annotate(letter, (left + width, low), (1, 0), textcoords="offset points", fontsize=7)
    if below:
        distances(below, compared)
    legend(figure)
    return figure


def _sheet(
    asides: int, distances: bool, columns: int, shape: float
) -> tuple[Page, Axes, list[Axes], Axes | None]:
    """A figure with a map, `asides` close-ups, and a panel of distances or None.

    `shape` is the map's width over its height: it stands beside the rest, or, where it is wide,
    above it. `columns` is the width in columns of a page.
    """
    high = columns == 2 and shape < WIDE_MAP
    if high:
        width = float(np.clip(HIGH_MAP * shape, *MAP_WIDTHS))
        # Inches are left for titles, labels of axes and the legend: 0.9 in height, 0.6 in width.
        figure = new_figure(columns, HIGH_MAP + 0.9)
        rest = (WIDTHS[columns] - width - 0.6) / asides
        cells = figure.add_gridspec(
            1 + distances,
            1 + asides,
            width_ratios=(width, *[rest] * asides),
            height_ratios=(1.5, 1.0)[: 1 + distances],
        )
        places = [cells[:, 0], *(cells[0, 1 + place] for place in range(asides))]
        last = cells[1, 1:] if distances else None
    else:
        height = float(np.clip((WIDTHS[columns] - 0.6) / shape, 1.2, WIDTHS[columns]))
        beside = distances and columns == 2
        # Close-ups get 1.6 inches in height, distances 1.1; each row has 0.6 for its title and
        # labels.
        rows = [height, 1.6, 1.1] if distances and not beside else [height, 1.6]
        figure = new_figure(columns, sum(rows) + 0.6 * len(rows))
        cells = figure.add_gridspec(
            len(rows),
            asides + beside,
            height_ratios=rows,
            width_ratios=[1.0] * asides + [2.0] * beside,
        )
        places = [cells[0, :], *(cells[1, place] for place in range(asides))]
        last = (cells[1, asides] if beside else cells[2, :]) if distances else None
    whole, *others = (figure.add_subplot(place) for place in places)
    return figure, whole, others, figure.add_subplot(last) if last is not None else None


def distances(axes: Axes, runs: Sequence[Shown]) -> None:
    """Draw how far each run is from the first at the same time, on a logarithmic axis.

    On a path that is followed, how far it is from the path; a run alone, from its target.
    """
    first, *others = runs
    if name := _own_distance(runs):
        curves = {run: run.during(name, None) for run in runs}
        axes.set_title("from the path" if name == DEVIATION else "from the target", loc="left")
    else:
        curves = {run: _between(first, run) for run in others}
        words = escaping.figure(shorten(first.label, NAME))
        axes.set_title(f"from {words}", loc="left")
    if not curves:
        remark(axes, "one run, and no target")
        return
    for run, (t, distance) in curves.items():
        curve = t, np.maximum(np.abs(distance), LEAST_DISTANCE)
        draw_run(axes, run, curve, fitted=run in scaling(runs))
    axes.set_yscale("log")
    axes.set_xlabel("time [s]")
    axes.set_ylabel("distance [m]")


def _own_distance(runs: Sequence[Shown]) -> str:
    """The signal of how far each run is from what it follows, "" for none."""
    if all(run.about.follows and run.has(DEVIATION) for run in runs):
        return DEVIATION
    return "z_e" if len(runs) == 1 and runs[0].has("z_e") else ""


def _between(first: Shown, run: Shown) -> tuple[Vector, Vector]:
    """Time (n,) [s], and a run's distance (n,) [m] from the first one at the same time."""
    t, _ = run.during("x", (0.0, first.end))
    times = first.recording["time"]
    apart = [
        run.signal(name)[: len(t)] - np.interp(t, times, first.signal(name)) for name in ("x", "y")
    ]
    return t, np.hypot(*apart)


def _whole(axes: Axes, runs: Sequence[Shown]) -> None:
    """Draw all tracks with hulls, starts and waypoints, east over north."""
    _draw_tracks(axes, targets(runs), runs, (0.0, max(run.end for run in runs)), runs)
    scale = enlargement(runs)
    for run in runs:
        for t in run.start + run.look.places * (run.end - run.start):
            _draw_hull(axes, run, float(t), scale)
    starts = {(run.recording["y"][0], run.recording["x"][0]) for run in runs}
    axes.plot(*zip(*sorted(starts), strict=True), **MARK, marker="o", markersize=3.5, label="start")
    given = {point for run in runs for point in run.about.waypoints}
    if given:
        north, east = zip(*sorted(given), strict=True)
        axes.plot(east, north, **WAYPOINT, label="waypoint")
    _accepting(axes, runs)
    words = f"hulls {scale:.0f} times as large" if scale > 1.0 else "hulls to scale"
    axes.set_title(words, loc="left")


def _accepting(axes: Axes, runs: Sequence[Shown]) -> None:
    """The circles within which the next leg of a path becomes active."""
    for north, east, radius in sorted({c for run in runs for c in run.about.circles}):
        axes.add_patch(Circle((east, north), radius, **ACCEPTANCE))


def _draw_hull(axes: Axes, run: Shown, t: float, scale: float) -> None:
    """Draw a run's hull at a time [s], where its heading is known; grey after the end of its path.

    It is not filled, and in the run's line style, so that none hides another.
    """
    outline = hull_of(run, t, scale) if run.has("psi") else np.full((1, 2), np.nan)
    color = run.color if t <= run.counts_to else AFTER["color"]
    look = {"fill": False, "edgecolor": color, "linestyle": run.linestyle, "linewidth": 0.7}
    if np.isfinite(outline).all():
        axes.add_patch(Polygon(outline, **look))


def _mark_ends(axes: Axes, runs: Sequence[Shown], east: Span, north: Span) -> None:
    """An x at the last place of every run that did not finish, within the map (east, north) [m]."""
    for run in (run for run in runs if not run.whole):
        y, x = run.recording["y"], run.recording["x"]
        inside = (y > east[0]) & (y < east[1]) & (x > north[0]) & (x < north[1])
        for row in np.flatnonzero(inside)[-1:]:
            axes.plot([y[row]], [x[row]], color=run.color, **CUT)


@dataclass(frozen=True)
class View:
    """A close-up: its name and time, tracks during a span [s], hulls, and what is seen.

    That is a square about the middle [m] east, north, as far as `reach` [m] to all sides.
    """

    name: str
    t: float
    tracks: Sequence[Shown]
    span: Span
    hulls: Sequence[Shown]
    target: Target
    middle: Vector
    reach: float


def views(runs: Sequence[Shown]) -> list[View]:
    """The close-ups: where finished runs are farthest apart, if anywhere, and their end.

    Hulls are shown at one and the same time. Of several targets, the first with its runs. On a path
    that is followed, runs are at other places at one time: shown is the largest deviation from it.
    """
    finished = scaling(runs)
    target = next(target for target in targets(runs) if finished[0] in target.runs)
    kept = [run for run in finished if run in target.runs]
    last = min(run.counts_to for run in kept)
    if target.in_sight and not target.is_ahead and all(run.has(DEVIATION) for run in kept):
        return [_deviation(kept, target, last)]
    names = ("y_d", "x_d") if target.is_ahead else ("y", "x")
    aim = np.array([kept[0].at(last, name) for name in names])
    return [*_farthest_apart(kept, target, last), _at_once("end", last, kept, target, aim)]


def _at_once(name: str, t: float, runs: Sequence[Shown], target: Target, middle: Vector) -> View:
    """The view of the runs at a time `t` [s], with the tracks around it.

    `middle` (2,) is the view's centre: east and north [m].
    """
    last = min(run.counts_to for run in runs)
    span = t - LAST_PART * last, min(t + LAST_PART * last, last)
    at = np.array([[run.at(t, name) for name in ("y", "x")] for run in runs])
    # All hulls are in the view, with some room, unless they are too far apart.
    away = 1.3 * float(np.max(np.hypot(*(at - middle).T)))
    length = max(run.length for run in runs)
    reach = min(max(NEAREST * length, away), FARTHEST * length)
    return View(name, t, runs, span, runs, target, middle, reach)


def _deviation(runs: Sequence[Shown], target: Target, last: float) -> View:
    """The view where a run is farthest from its path, after the approach and until `last` [s]."""
    errors = [np.where(_is_on_leg(run, last), np.abs(run.signal(DEVIATION)), 0.0) for run in runs]
    largest = int(np.argmax([error.max() for error in errors]))
    worst, error = runs[largest], errors[largest]
    instant = float(worst.recording["time"][np.argmax(error)])
    middle = np.array([worst.at(instant, name) for name in ("y", "x")])
    # The largest deviation fills two thirds of the view's half width, unless hulls set the size.
    reach = min(max(NEAREST * worst.length, 1.5 * float(error.max())), FARTHEST * worst.length)
    name = "farthest from the path"
    return View(name, instant, runs, (0.0, np.inf), [worst], target, middle, reach)


def _is_on_leg(run: Shown, last: float) -> npt.NDArray[np.bool_]:
    """At which instants (rows,), after the approach and until `last` [s], the run is on its leg.

    At a change of legs the error begins anew, with up to the radius of acceptance. That is the
    corner's until the vessel crosses the leg, or is as near to it as on half of the leg.
    """
    t, error = run.recording["time"], run.signal(DEVIATION)
    counts = (t >= APPROACH * last) & (t <= last)
    begins = [*np.flatnonzero(np.diff(run.signal(LEG))) + 1, len(t)] if run.has(LEG) else []
    for begin, end in pairwise(begins):
        own, size = error[begin:end], np.abs(error[begin:end])
        # argmax finds the first True. The median counts as near, so there is one on every leg.
        came = int(np.argmax((own * own[0] <= 0.0) | (size <= np.median(size))))
        counts[begin : begin + came] = False
    return counts


def _farthest_apart(runs: Sequence[Shown], target: Target, last: float) -> list[View]:
    """The view of the runs when they fill the largest box, up to `last` [s].

    Empty if that is at the end, which has a view of its own.
    """
    times = np.linspace(min(run.start for run in runs), last, INSTANTS)
    logs = [run.recording for run in runs]
    tracks = np.array(
        [[np.interp(times, log["time"], log[name]) for name in ("y", "x")] for log in logs]
    )
    sizes = np.hypot(*np.ptp(tracks, axis=0))
    worst = int(np.argmax(sizes))
    if sizes[worst] < APART * runs[0].length or times[worst] > (1.0 - LAST_PART) * last:
        return []
    low, high = tracks[:, :, worst].min(axis=0), tracks[:, :, worst].max(axis=0)
    return [_at_once("largest gap", float(times[worst]), runs, target, 0.5 * (low + high))]


def close_up(axes: Axes, view: View, among: Sequence[Shown]) -> None:
    """Draw tracks around the time of the view, with hulls to scale.

    `among` are all runs of the figure: their order gives the widths of tracks.
    """
    _draw_tracks(axes, [view.target], view.tracks, view.span, among)
    for run in view.hulls:
        _draw_hull(axes, run, view.t, 1.0)
    if view.target.is_ahead:
        aim = [[view.tracks[0].at(view.t, name)] for name in ("y_d", "x_d")]
        label = f"{view.target.line_style['label']} at this time"
        axes.plot(*aim, **MARK, marker="+", markersize=7, label=label)
    (left, low), (right, high) = view.middle - view.reach, view.middle + view.reach
    map_axes(axes, (left, right), (low, high))
    axes.set_title(f"{view.name}, t = {view.t:.4g} s", loc="left")


def _draw_tracks(
    axes: Axes, ahead: Sequence[Target], shown: Sequence[Shown], span: Span, among: Sequence[Shown]
) -> None:
    """Draw tracks of targets and runs during `span` [s]; of equal ones, the first is the broadest.

    `shown` are the runs to draw. Widths go by their place `among` all runs, as in other views.
    """
    for target in (target for target in ahead if target.in_sight):
        axes.plot(*target.track(span), **target.line_style)
    widths = np.linspace(*BROAD, len(among)) if len(among) > 1 else BROAD[1:]
    for run, width in zip(among, widths, strict=True):
        if run in shown:
            log, rows = run.recording, rows_of(run.recording, span)
            look = {**run.line_style, "linewidth": width, "solid_capstyle": "butt"}
            t, y, x = (log[name][rows] for name in ("time", "y", "x"))
            last = int(np.searchsorted(t, run.counts_to, side="right"))
            if last < len(t):
                grey = {**look, **AFTER, "label": f"_{run.name}, after its path"}
                axes.plot(y[max(0, last - 1) :], x[max(0, last - 1) :], **grey)
            axes.plot(y[:last], x[:last], **look)
