"""What the stability proof is about: V and its bound, V' and its bound, what V is made of."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import Locator

from podusv_cli.core.kernel import Vector
from podusv_cli.figures.curves import draw_run, thin_curve
from podusv_cli.figures.panels import TIME
from podusv_cli.figures.scales import scaling
from podusv_cli.figures.sheet import figure
from podusv_cli.figures.shown import Shown
from podusv_cli.figures.style import legend, new_figure
from podusv_cli.theory.lyapunov import TERMS, V_DOT, V

POINTS = 600  # of a stack; every column is a mean, so that no extreme stands for its surroundings
FAR = 100.0  # a bound this many times above all of V is left out of the picture and given in words
LAYERS = {
    "z_e": "#0072B2",
    r"\psi_e": "#56B4E9",
    "u_e": "#D55E00",
    "r_e": "#E69F00",
    "y_u": "#009E73",
    "y_r": "#8FD1BA",
    r"\tilde W_u": "#CC79A7",
    r"\tilde W_r": "#E6B8D2",
    r"\tilde b_u": "#555555",
    r"\tilde b_r": "#AAAAAA",
}
SUM = "SI"  # V adds numbers of different units, as (46) has it
MIXED = f"${V.symbol}$ [{SUM}]"
THIN = 0.6  # points: bounds, each in its run's line style
OUTLINE: dict[str, Any] = {"color": "black", "linewidth": 0.9}
SIDE_TICKS = 4  # at most, on either side of 0


@figure(
    "stability",
    place=8,
    signals=("V",),
    caption="Lyapunov function (46): its value with the ultimate bound, its rate with what (49) "
    "says it stays below, and its terms as parts of it, stacked; of a single run the value is "
    "stacked, too; the terms have different units, and (46) adds their numbers in SI units",
)
def stability(runs: Sequence[Shown], columns: int) -> Figure:
    """V with its ultimate bound, V' with what it should stay below, and V's terms, run by run.

    V of a single run is stacked by its terms, with its bound over the stack.
    """
    runs = [run for run in runs if run.has("V")]
    # In inches: 1.5 a panel, of which two have all runs, and 0.6 for the keys.
    figure = new_figure(columns, 3.6 + 1.5 * len(runs))
    over_time = figure.subplots(2 + len(runs), 1, sharex=True)
    draw_V = _curves if len(runs) > 1 else _stack
    draw_V(over_time[0], runs)
    _ultimate(over_time[0], runs)
    _rate(over_time[1], runs)
    layers = [_shares(axes, run) for axes, run in zip(over_time[2:], runs, strict=True)]
    over_time[-1].set_xlabel(TIME)
    over_time[-1].set_xlim(min(run.start for run in runs), max(run.end for run in runs))
    figure.add_key(layers[-1], [f"${error}$" for error in LAYERS], below=True)
    legend(figure)
    return figure


def _curves(axes: Axes, runs: Sequence[Shown]) -> None:
    """Draw V over time on an axis of logarithms."""
    axes.set_yscale("log")
    axes.set_ylabel(MIXED)
    for run in runs:
        draw_run(axes, run, run.during("V", None), fitted=run in scaling(runs))


def _stack(axes: Axes, runs: Sequence[Shown]) -> None:
    """V's terms on top of each other; the axis is logarithmic beyond the settled values."""
    (run,) = runs
    terms = [_means(run.signal(term.name)) for term in TERMS]
    axes.stackplot(_means(run.recording["time"]), terms, colors=LAYERS.values(), linewidth=0.0)
    value = run.signal("V")
    axes.plot(*thin_curve(run.recording["time"], value), **OUTLINE, label="$V$")
    _compress(axes, _settled_size(run, "V") or float(np.max(value)))
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel(MIXED + ", stacked")


def _ultimate(axes: Axes, runs: Sequence[Shown]) -> None:
    """The bound of V in each part of every run: drawn, or put into words where it is far off."""
    largest = max(float(np.max(run.signal("V"))) for run in scaling(runs))
    lines, top = [], largest
    for run in runs:
        for start, end, bound in _bounds(run):
            if bound <= FAR * largest:
                axes.plot([start, end], [bound, bound], **_thin(run))
                top = max(top, bound)
            else:
                size = f"{bound:.2g}, not drawn" if math.isfinite(bound) else "none"
                lines.append(f"bound of {run.name} from {start:g} s on: {size}")
    # The axis is logarithmic: the room above is that of a factor of two.
    axes.set_ylim(top=2.0 * top)
    axes.plot([], [], color="#444444", linewidth=THIN, label=r"thin: bound $\Delta/2\lambda$")
    if lines:
        axes.set_title("\n".join(lines), fontsize=rcParams["xtick.labelsize"], loc="right")


def _thin(run: Shown) -> dict[str, Any]:
    return {"color": run.color, "linestyle": run.linestyle, "linewidth": THIN}


def _bounds(run: Shown) -> Iterator[tuple[float, float, float]]:
    """Start, end [s] and bound of V for each part of the run that has one, or none (infinite)."""
    log = run.recording
    end = float(log["time"][-1])
    for start, bound in zip(log["window_start"], log["V_bound"], strict=True):
        if start <= end and not math.isnan(bound):
            yield float(start), end, float(bound)


def _rate(axes: Axes, runs: Sequence[Shown]) -> None:
    """Draw V' and its bound over time; bounds beyond FAR times all rates are left out."""
    axes.set_ylabel(rf"${V_DOT.symbol}$ [{SUM}/s]")
    runs = [run for run in runs if run.has("V_dot")]
    for run in runs:
        draw_run(axes, run, run.during("V_dot", None), fitted=run in scaling(runs))
    kept = scaling(runs)
    largest = max((float(np.max(np.abs(run.signal("V_dot")))) for run in kept), default=1.0)
    for run in runs:
        limit = run.signal("V_dot_bound")
        near = np.where(np.abs(limit) <= FAR * largest, limit, np.nan)
        add = axes.add_line if run in kept else axes.add_artist  # which leaves the scale as it is
        add(Line2D(run.recording["time"], near, **_thin(run)))
    # A size of 0, where no run settled, has no logarithm.
    _compress(axes, max([*(_settled_size(run, "V_dot") for run in kept), 1e-9]))
    axes.axhline(0.0, color="#444444", linewidth=0.5)
    axes.autoscale_view()


def _compress(axes: Axes, settled: float) -> None:
    """Make the vertical axis logarithmic beyond the size `settled`, with ticks at some decades."""
    threshold = 10.0 ** math.ceil(math.log10(settled))
    axes.set_yscale("symlog", linthresh=threshold, linscale=2.0)
    axes.yaxis.set_major_locator(_Decades(threshold))


class _Decades(Locator):
    """Ticks at 0 and at few of the decades from a threshold on, none near another."""

    def __init__(self, threshold: float) -> None:
        self.first = round(math.log10(threshold))

    def __call__(self) -> list[float]:
        return self.tick_values(*self.axis.get_view_interval())  # type: ignore[union-attr]

    def tick_values(self, vmin: float, vmax: float) -> list[float]:
        """Ticks between two values, the ends of the axis: 0 and decades of both signs.

        At most SIDE_TICKS decades of a sign are taken, at equal distances.
        """
        largest = max(abs(vmin), abs(vmax), 10.0**self.first)
        count = math.floor(math.log10(largest)) - self.first + 1
        steps = range(self.first, self.first + count, -(-count // SIDE_TICKS))
        sizes = [10.0**power for power in steps]
        ticks = [*(-size for size in reversed(sizes)), 0.0, *sizes]
        return [tick for tick in ticks if vmin <= tick <= vmax]


def _settled_size(run: Shown, name: str) -> float:
    """The largest size of a signal in the run's settled end, 0 where it did not get there."""
    settled = run.recording["time"] >= run.recording["window_start"][-1]
    return float(np.max(np.abs(run.signal(name)[settled]), initial=0.0))


def _shares(axes: Axes, run: Shown) -> list[PolyCollection]:
    """Draw V's terms, stacked, each as its part of V (0 to 1), and return the layers for a legend.

    Where V is 0, all parts are 0.
    """
    time = run.recording["time"]
    terms = np.stack([_means(run.signal(term.name)) for term in TERMS])
    total = terms.sum(axis=0)
    parts = np.divide(terms, total, out=np.zeros_like(terms), where=total > 0.0)
    layers = axes.stackplot(_means(time), parts, colors=LAYERS.values(), linewidth=0.0)
    axes.set_ylim(0.0, 1.0)
    axes.set_ylabel(f"parts of $V$ [1]\n{run.name}")
    return layers


def _means(values: Vector) -> Vector:
    """Means of neighbours in values (n,), at most POINTS of them."""
    width = -(-len(values) // POINTS)
    starts = np.arange(0, len(values), width)
    # The last group may be smaller.
    return np.asarray(np.add.reduceat(values, starts) / np.diff([*starts, len(values)]))
