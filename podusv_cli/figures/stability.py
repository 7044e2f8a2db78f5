"""What the stability proof is about: V and its bound, V' and its bound, what V is made of."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import SymmetricalLogLocator

from podusv_cli.figures.curves import thinned
from podusv_cli.figures.panels import TIME
from podusv_cli.figures.style import Shown, axis_label, legend, new_figure
from podusv_cli.kernels import Vector
from podusv_cli.signals import SIGNALS
from podusv_cli.theory.monitor import TERMS

POINTS = 600  # of a stack; every column is a mean, so that no extreme stands for its surroundings
FAR = 100.0  # a bound this many times above all of V is left out of the picture and told in words
LAYERS = (
    "#0072B2", "#56B4E9", "#D55E00", "#E69F00", "#009E73",
    "#8FD1BA", "#CC79A7", "#E6B8D2", "#555555", "#AAAAAA",
)  # fmt: skip
BOUND: dict[str, Any] = {"linewidth": 0.8, "linestyle": (0, (4, 2))}


def stability(runs: Sequence[Shown], columns: int) -> Figure:
    """V with its ultimate bound, V' with what it should stay below, and V's terms, run by run."""
    runs = [run for run in runs if run.has("V")]
    figure = new_figure(columns, 3.4 + 1.5 * len(runs))
    over_time = figure.subplots(2 + len(runs), 1, sharex=True)
    _value(over_time[0], runs)
    _rate(over_time[1], runs)
    layers = [_shares(axes, run) for axes, run in zip(over_time[2:], runs, strict=True)]
    over_time[-1].set_xlabel(TIME)
    over_time[-1].set_xlim(0.0, max(run.end for run in runs))
    names = [f"${SIGNALS[name].symbol}$" for name in TERMS]
    over_time[-1].legend(
        layers[-1], names, loc="upper center", bbox_to_anchor=(0.5, -0.35), ncols=5 * columns,
        fontsize="small", handlelength=0.8, columnspacing=0.8,
    )  # fmt: skip
    legend(figure, columns)
    return figure


def _value(axes: Axes, runs: Sequence[Shown]) -> None:
    axes.set_yscale("log")
    axes.set_ylabel(axis_label("V"))
    for run in runs:
        axes.plot(*thinned(run.recording["time"], run.signal("V")), **run.look)
    largest = max(axes.dataLim.intervaly)
    told = []
    for run in runs:
        for start, end, bound in _bounds(run):
            if bound <= FAR * largest:
                axes.plot([start, end], [bound, bound], color=run.color, **BOUND)
            else:
                size = f"{bound:.2g}, not drawn" if math.isfinite(bound) else "none"
                told.append(f"bound of {run.label} from {start:g} s on: {size}")
    axes.plot([], [], color="#444444", label=r"bound $\Delta/2\lambda$", **BOUND)
    if told:
        axes.set_title("\n".join(told), fontsize="x-small", loc="left")


def _bounds(run: Shown) -> Iterator[tuple[float, float, float]]:
    """Start, end [s] and bound of V for each part of the run that has one, or none (infinite)."""
    log = run.recording
    end = float(log["time"][-1])
    for start, bound in zip(log["window_start"], log["V_bound"], strict=True):
        if start <= end and not math.isnan(bound):
            yield float(start), end, float(bound)


def _rate(axes: Axes, runs: Sequence[Shown]) -> None:
    axes.set_ylabel(axis_label("V_dot"))
    runs = [run for run in runs if run.has("V_dot")]
    for run in runs:
        axes.plot(*thinned(run.recording["time"], run.signal("V_dot")), **run.look)
    largest = max((float(np.max(np.abs(run.signal("V_dot")))) for run in runs), default=1.0)
    for run in runs:
        limit = run.signal("V_dot_bound")
        near = np.where(np.abs(limit) <= FAR * largest, limit, np.nan)
        axes.plot(run.recording["time"], near, color=run.color, **BOUND)
    threshold = 10.0 ** math.ceil(math.log10(max([*map(_settled_rate, runs), 1e-9])))
    axes.set_yscale("symlog", linthresh=threshold)
    locator = SymmetricalLogLocator(base=10.0, linthresh=threshold)
    locator.set_params(numticks=7)
    axes.yaxis.set_major_locator(locator)
    axes.axhline(0.0, color="#444444", linewidth=0.5)
    axes.autoscale_view()


def _settled_rate(run: Shown) -> float:
    """The largest |V'| of the run's settled end, 0 where it did not get there."""
    settled = run.recording["time"] >= run.recording["window_start"][-1]
    return float(np.max(np.abs(run.signal("V_dot")[settled]), initial=0.0))


def _shares(axes: Axes, run: Shown) -> list[PolyCollection]:
    """V's terms, stacked, each as its part of V; the layers."""
    time = run.recording["time"]
    terms = np.stack([_means(run.signal(name)) for name in TERMS])
    total = terms.sum(axis=0)
    parts = np.divide(terms, total, out=np.zeros_like(terms), where=total > 0.0)
    layers = axes.stackplot(_means(time), parts, colors=LAYERS, linewidth=0.0)
    axes.set_ylim(0.0, 1.0)
    axes.set_ylabel(f"parts of $V$ [1]\n{run.label}")
    return layers


def _means(values: Vector) -> Vector:
    """Means of neighbours, at most POINTS of them."""
    width = -(-len(values) // POINTS)
    starts = np.arange(0, len(values), width)
    return np.asarray(np.add.reduceat(values, starts) / np.diff([*starts, len(values)]))
