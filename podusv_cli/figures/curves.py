"""Curves over time, and how peaks leave the rest readable."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import SymmetricalLogLocator

from podusv_cli.core.kernel import Vector
from podusv_cli.figures.scales import Span, linear_up_to, mean_size, scaling
from podusv_cli.figures.shown import Shown

THIN: dict[str, Any] = {"linewidth": 0.5, "alpha": 0.6}
MARK: dict[str, Any] = {"markersize": 3.2, "markerfacecolor": "white", "markeredgewidth": 0.7}
COMMON: dict[str, str] = {"color": "#444444", "linestyle": "-", "label": "all runs"}
AFTER: dict[str, Any] = {"color": "#b4b4b4", "linewidth": 0.6, "zorder": 1.5}  # the end of a path
CUT: dict[str, Any] = {"marker": "x", "markersize": 5.0, "markeredgewidth": 1.2, "zorder": 5.0}
DENSE = 60.0  # ranges that a curve runs through; from there it hides what is below it
FINE = 0.5  # points, of such a curve
APART = 1.5  # a curve that goes this many times as far up and down lies below the calmer one
RIPPLE = 1e-3  # of a signal's mean size over the run; a panel never shows less than this


class Beyond(SymmetricalLogLocator):
    """Ticks at 0 and beyond the linear part, within which those of powers cover each other."""

    def __init__(self, linear: float) -> None:
        """`linear` is where the linear part ends."""
        super().__init__(base=10.0, linthresh=linear)
        self.linear = linear

    def tick_values(self, vmin: float, vmax: float) -> Sequence[float]:
        """As matplotlib has them, but for those."""
        ticks = super().tick_values(vmin, vmax)
        return [tick for tick in ticks if tick == 0.0 or abs(tick) > 0.5 * self.linear]


def thin_curve(t: Vector, y: Vector, points: int = 1500) -> tuple[Vector, Vector]:
    """About `points` samples that keep every extreme: the least and the largest of each bin.

    `t` [s] and `y` are (n,) both before and after.
    """
    if len(t) <= points:
        return t, y
    # Rounded up; each bin gives two points.
    width = -(-len(t) // (points // 2))
    whole = (len(t) - 1) // width * width  # the rest after it is no longer than a bin
    bins, starts = y[:whole].reshape(-1, width), np.arange(0, whole, width)
    ends = [0, whole + int(np.argmin(y[whole:])), whole + int(np.argmax(y[whole:])), len(t) - 1]
    chosen = np.unique(np.concatenate([starts + bins.argmin(1), starts + bins.argmax(1), ends]))
    return t[chosen], y[chosen]


def draw_signal(
    axes: Axes, runs: Sequence[Shown], name: str, *, span: Span | None = None, beside: str = ""
) -> None:
    """Plot a signal of all runs that have it over time, or over a part of it, `span` [s].

    `beside` another signal it is drawn thin, not in the legend, and only where the two differ.
    Dense curves are fine; a curve lies below those that are calmer. What varies by less than RIPPLE
    of the signal's mean size is shown as a flat line.
    """
    having = [run for run in runs if run.has(name)]
    fitted = scaling(having, span)
    curves = {run: run.during(name, span) for run in having}
    ways = {run: _way(y) for run, (_, y) in curves.items()}
    for run, curve in curves.items():
        calmer = sum(way > APART * ways[run] for way in ways.values())
        look: dict[str, Any] = {"zorder": 2.0 + 0.5 * calmer / len(having)}
        if len(curve[1]) and ways[run] > DENSE * np.ptp(curve[1]):
            look["linewidth"] = FINE
        if curve[1].ndim > 1:
            _draw_components(axes, run, curve, fitted=run in fitted)
        elif not beside:
            draw_run(axes, run, curve, fitted=run in fitted, **look)
        elif differ(run, name, beside):
            # A label with _ in front is not in the legend.
            thin = {**run.line_style, **THIN, "label": f"_{run.name}, {name}"}
            draw_run_curve(axes, run, curve, fitted=run in fitted, **thin)
    sizes = [mean_size(run, name) for run in fitted if run.whole and run.has(name)]
    _widen(axes, max(sizes, default=0.0))


def _widen(axes: Axes, size: float) -> None:
    """Give what is drawn a vertical range of at least RIPPLE of `size`, about its middle."""
    low, high = axes.dataLim.intervaly
    if high - low < RIPPLE * size:
        ends = 0.5 * (low + high) + 0.5 * RIPPLE * size * np.array([-1.0, 1.0])
        axes.update_datalim([(axes.dataLim.x0, end) for end in ends])


def _way(y: Vector) -> float:
    """How far a signal y (n,) goes up and down in all, as far as a page can show it.

    In y's unit; thinned first, since noise between two pixels is not seen.
    """
    _, few = thin_curve(np.arange(len(y), dtype=float), y)
    return float(np.sum(np.abs(np.diff(few, axis=0))))


def _draw_components(axes: Axes, run: Shown, curve: tuple[Vector, Vector], *, fitted: bool) -> None:
    """All components of a vector over time, thin, with one name; curve is t (n,) and (n, parts)."""
    t, vectors = curve
    for number, y in enumerate(vectors.reshape(len(t), -1).T):
        name = run.line_style["label"] if not number else f"_{number}"
        look = {**run.line_style, **THIN, "label": name}
        draw_run_curve(axes, run, (t, y), fitted=fitted, **look)


def draw_shared(axes: Axes, runs: Sequence[Shown], name: str) -> None:
    """Plot the signal `name` over time, once where all runs have the same."""
    having = [run for run in runs if run.has(name)]
    # The others are compared with it as long as they last.
    longest = max(having, key=lambda run: run.end)
    if len(runs) > 1 and all(_same(run, longest, name) for run in having):
        draw_curve(axes, longest.during(name, None), fitted=True, **COMMON)
    else:
        draw_signal(axes, runs, name)


def _same(run: Shown, longest: Shown, name: str) -> bool:
    """Whether a run has the same signal as another, as long as it lasts."""
    t, y = run.during(name, None)
    other = np.interp(t, *longest.during(name, None))
    return bool(np.allclose(y, other, rtol=1e-6, atol=1e-6 * float(np.ptp(other))))


def draw_run(
    axes: Axes, run: Shown, curve: tuple[Vector, Vector], *, fitted: bool, **look: Any
) -> None:
    """Plot a `curve` (t [s], y), each (n,), in the look of its run, with the run's markers.

    `look` is added to that of the run; `fitted` is as in `draw_run_curve`. A run that did not
    finish has an x below the instant of its end; the curve may end anywhere.
    """
    mark(draw_run_curve(axes, run, curve, fitted=fitted, **run.line_style, **look), run)
    if not run.whole and len(curve[0]) and curve[0][-1] == run.end:
        below = axes.get_xaxis_transform()
        axes.plot([run.end], [0.0], transform=below, clip_on=False, color=run.color, **CUT)


def mark(line: Line2D, run: Shown, t: Vector | None = None) -> None:
    """Put the run's markers on a curve, at their places in time.

    `t` (n,) [s] are the instants of the curve's points, where these are not its horizontal
    positions.
    """
    instants = np.asarray(line.get_xdata() if t is None else t)
    if len(instants) and run.marker:
        # Places are fractions of the time that the curve covers.
        at = instants[0] + run.look.places * (instants[-1] - instants[0])
        rows = np.minimum(np.searchsorted(instants, at), len(instants) - 1)
        line.set(marker=run.marker, markevery=rows.tolist(), **MARK)
        line.recache(always=True)  # else matplotlib counts from the first point within the axes


def differ(run: Shown, name: str, other: str) -> bool:
    """Whether the run has both signals, and they are not the same."""
    both = run.has(name) and run.has(other)
    return both and not np.array_equal(run.signal(name), run.signal(other))


def draw_curve(axes: Axes, curve: tuple[Vector, Vector], *, fitted: bool, **look: Any) -> Line2D:
    """Plot a curve (t, y), each (n,), thinned; the scale fits it only where it is `fitted`."""
    t, y = thin_curve(*curve)
    if fitted:
        return axes.plot(t, y, **look)[0]
    # `axes.plot` would fit both scales; here only the horizontal one grows.
    line = Line2D(t, y, **look)
    if len(t):
        axes.add_artist(line)
        axes.update_datalim(np.column_stack([t, np.zeros(len(t))]), updatey=False)
    return line


def draw_run_curve(
    axes: Axes, run: Shown, curve: tuple[Vector, Vector], *, fitted: bool, **look: Any
) -> Line2D:
    """Plot a curve of a run, grey after the end of its path; the line up to there.

    `curve` is (t [s], y), each (n,). The scale of the axes fits it only where it is `fitted`;
    `look` are keyword arguments of a line. No metric and no scale counts what comes after the path.
    """
    t, y = curve
    last = int(np.searchsorted(t, run.counts_to, side="right"))
    if 0 < last < len(t):
        # matplotlib leaves labels that begin with _ out of the legend.
        grey = {**look, **AFTER, "label": f"_{run.name}, after its path"}
        # From the last counted point on, so that no gap is left between the two.
        draw_curve(axes, (t[last - 1 :], y[last - 1 :]), fitted=False, **grey)
    return draw_curve(axes, (t[:last], y[:last]), fitted=fitted, **look)


def compress(axes: Axes, runs: Sequence[Shown], name: str) -> None:
    """Make the vertical axis logarithmic beyond usual values where peaks dwarf them.

    `name` is the signal; `axes` has its curves already.
    """
    linear = linear_up_to(runs, name, max(abs(limit) for limit in axes.dataLim.intervaly))
    if linear:
        axes.set_yscale("symlog", linthresh=linear)
        axes.yaxis.set_major_locator(Beyond(linear))
        axes.autoscale_view(scalex=False)  # margins in the new scale
