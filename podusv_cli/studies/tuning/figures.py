"""Figures of a search, as functions of plain tables.

Import this module where a figure is drawn, because matplotlib is slow to import. Draw and save
inside `figures.style.house_style()`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from podusv_cli.core import escaping
from podusv_cli.core.kernel import Vector
from podusv_cli.figures.style import TARGET_LOOK, legend, look, new_figure
from podusv_cli.studies.tuning.space import Gain

ROW, FRAME = 0.2, 0.75  # inches: a row of a chart, and what is around the rows
ACROSS = 4  # small panels in a row
PANEL = 1.35  # inches, the height of a small panel
TOP = 2.0  # times the scenario's objective, where an axis ends
SMALL: dict[str, Any] = {"fontsize": 6.5}


def before_and_after(laws: pd.DataFrame, label: str, columns: int = 2) -> Figure:
    """The objective of every law with its interval, before and after, best law on top."""
    ordered = laws.sort_values("objective_after", ignore_index=True)
    figure = new_figure(columns, FRAME + 1.4 * ROW * len(ordered))
    axes = figure.add_subplot()
    for row, law in ordered.iterrows():
        place = float(str(row))
        _ranged(axes, place - 0.16, law, "before", "none")
        _ranged(axes, place + 0.16, law, "after", look(1)[0])
    for when, fill in (("before", "none"), ("after", look(1)[0])):
        colour = look(1 if when == "after" else 0)[0]
        axes.plot(
            [], [], "o-", color=colour, markerfacecolor=fill, markersize=3.6, linewidth=1.2,
            label=f"{when} the search",
        )  # fmt: skip
    axes.set_yticks(range(len(ordered)), [escaping.figure(law) for law in ordered.law])
    axes.set_ylim(len(ordered) - 0.4, -0.6)
    axes.set_xlabel(escaping.figure(label))
    legend(figure, columns)
    return figure


def _ranged(axes: Axes, y: float, law: Any, when: str, fill: str) -> None:
    estimate, low, high = (law[f"objective_{when}{end}"] for end in ("", "_low", "_high"))
    colour = look(0)[0] if when == "before" else look(1)[0]
    if np.isfinite([low, high]).all():
        axes.plot([low, high], [y, y], color=colour, linewidth=1.2, solid_capstyle="butt")
    if math.isfinite(estimate):
        axes.plot(estimate, y, "o", markersize=3.6, color=colour, markerfacecolor=fill)


def history(trials: pd.DataFrame, label: str, columns: int = 2) -> Figure:
    """The best objective so far over simulated runs."""
    figure = new_figure(columns, 2.8)
    axes = figure.add_subplot()
    for place, (law, rows) in enumerate(trials.groupby("law", sort=False)):
        colour, style, _ = look(place)
        for i, (_, one) in enumerate(rows.groupby("repeat")):
            axes.step(
                one.spent, one.best.replace(np.inf, np.nan), where="post", color=colour,
                linestyle=style, linewidth=0.9, label=escaping.figure(str(law)) if not i else None,
            )  # fmt: skip
    axes.set(xlabel="simulated runs of a search", ylabel=f"best {escaping.figure(label)} so far")
    legend(figure, columns)
    return figure


def pareto(
    fronts: Mapping[str, Vector], taken: Mapping[str, Sequence[float]],
    first: Mapping[str, Sequence[float]], labels: tuple[str, str], columns: int = 2,
) -> Figure:  # fmt: skip
    """The front of every law, what was taken, and where the scenario's gains are."""
    figure = new_figure(columns, 3.2)
    axes = figure.add_subplot()
    for place, (law, points) in enumerate(fronts.items()):
        colour, _, marker = look(place)
        axes.plot(
            *points.T, marker=marker, markersize=3.0, color=colour, linewidth=0.8,
            label=escaping.figure(law),
        )  # fmt: skip
        axes.plot(*taken[law], marker="*", markersize=9.0, color=colour, linestyle="none")
        axes.plot(*first[law], marker="x", markersize=5.0, color=colour, linestyle="none")
    axes.set(xlabel=escaping.figure(labels[0]), ylabel=escaping.figure(labels[1]))
    legend(figure, columns)
    return figure


def importance(table: pd.DataFrame, columns: int = 2) -> Figure:
    """A panel for each law with a bar for each gain."""
    laws = list(dict.fromkeys(table.law))
    across = min(len(laws), ACROSS - 1)
    down = math.ceil(len(laws) / across)
    most = int(table.groupby("law").size().max())
    figure = new_figure(columns, down * (0.45 + 0.13 * most))
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for law, axes in zip(laws, panels, strict=False):
        rows = table[table.law == law].sort_values("importance", ascending=False)
        places = range(len(rows))
        axes.barh(places, 100.0 * rows.importance, color=look(0)[0], alpha=0.55, height=0.7)
        axes.hlines(places, 100.0 * rows.low, 100.0 * rows.high, color="#333333", linewidth=0.7)
        axes.set_yticks(places, [escaping.figure(key) for key in rows.gain], fontsize=5.5)
        axes.set_ylim(most - 0.4, -0.6)
        axes.tick_params(axis="x", labelsize=5.5)
        axes.set_title(f"{escaping.figure(law)} [%]", **SMALL)
    for axes in panels[len(laws) :]:
        axes.set_visible(False)
    return figure


def slices(
    tried: pd.DataFrame, gains: Sequence[Gain], found: Mapping[str, Any], label: str,
    units: Mapping[str, str], columns: int = 2,
) -> Figure:  # fmt: skip
    """A panel for each gain of a law, a point for each trial."""
    across = min(len(gains), ACROSS)
    down = math.ceil(len(gains) / across)
    figure = new_figure(columns, 0.3 + PANEL * down)
    panels = figure.subplots(down, across, squeeze=False, sharey=True)
    values = tried.objective.to_numpy(float)
    shown = values[np.isfinite(values)]
    for gain, axes in zip(gains, panels.ravel(), strict=False):
        _slice(axes, gain, tried, found[gain.key])
        unit = f" [{units[gain.key]}]" if units[gain.key] not in ("", "1") else ""
        axes.set_xlabel(escaping.figure(f"{gain.key}{unit}"), **SMALL)
    if len(shown):
        low, start = float(shown.min()), float(values[0])
        top = (
            TOP * start if math.isfinite(start) and start > 0.0 else float(np.quantile(shown, 0.75))
        )
        panels[0, 0].set_ylim(low - 0.05 * (top - low), max(top, low + 1e-9))
    for axes in panels.ravel()[len(gains) :]:
        axes.set_visible(False)
    figure.supylabel(escaping.figure(label), **SMALL)
    return figure


def _slice(axes: Axes, gain: Gain, tried: pd.DataFrame, found: Any) -> None:
    if gain.words:
        places = {word: place for place, word in enumerate(gain.words)}
        x = tried[gain.key].map(places)
        axes.set_xticks(range(len(places)), [escaping.figure(str(word)) for word in places])
        own, mark = places.get(gain.own), places[found]
    else:
        x, own, mark = tried[gain.key], gain.own, found
    axes.scatter(x, tried.objective, s=2.5, c=[look(i)[0] for i in tried.repeat], linewidths=0.0)
    axes.axvline(mark, **TARGET_LOOK)
    if own is not None:
        axes.axvline(own, **{**TARGET_LOOK, "linestyle": "--"})
    if gain.log:
        axes.set_xscale("log")
        axes.set_xlim(0.9 * min(gain.low, gain.own), 1.1 * max(gain.high, gain.own))
        axes.xaxis.set_minor_formatter(NullFormatter())  # labels of minor ticks overlap
    axes.tick_params(labelsize=5.5)
