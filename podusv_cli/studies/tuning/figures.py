"""Figures of a search: which there are, with their captions, and how each is drawn.

They are drawn from plain tables. Import this module where a figure is drawn, because matplotlib is
slow to import.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from podusv_cli.core import escaping
from podusv_cli.figures.looks import TARGET_LOOK, nth_style
from podusv_cli.figures.sketch import COLUMNS, Sketch
from podusv_cli.figures.style import legend, new_figure
from podusv_cli.studies.telling.figures import ratios
from podusv_cli.studies.tuning.results import SearchResults
from podusv_cli.studies.tuning.space import Gain, units_of
from podusv_cli.studies.tuning.trials import FINISHED

ROW, FRAME = 0.2, 0.75  # inches: a row of a chart, and what is around the rows
ACROSS = 4  # small panels in a row
PANEL = 1.35  # inches, the height of a small panel
TOP = 2.0  # times the scenario's objective, where an axis ends
DECADE = 10.0  # largest over least number, from where an axis is logarithmic
MIDDLE = (0.25, 0.5, 0.75)  # quantiles of the searches of a law
WHOLE: dict[str, Any] = {"s": 3.0, "linewidths": 0.0, "zorder": 3.0}
PRUNED: dict[str, Any] = {"s": 5.0, "linewidths": 0.35, "zorder": 2.0}  # or cut
SMALL: dict[str, Any] = {"fontsize": 6.5}


def sketches(results: SearchResults) -> Iterator[Sketch]:
    """The figures for which there are numbers."""

    objective = results.plan.tune.objective
    yield Sketch(
        "validation",
        f"{objective} on the fresh draws, before (hollow) and after the search (filled), with "
        f"{100 * results.level:g} % intervals",
        partial(before_and_after, results.laws, results.label),
    )
    if len(results.effort):
        yield Sketch(
            "effort",
            f"error against effort: the median {results.shown_metrics[0]} over the median total "
            "variation of the surge demand on the fresh draws; hollow before, filled after the "
            "search, the median of a law's searches with lines over their middle half; failed runs "
            "count as the worst; down and to the left is better",
            partial(effort, results.effort, results.shown_metrics[0]),
        )
    if results.winners:
        yield from _of_searches(results, objective)


def _of_searches(results: SearchResults, objective: str) -> Iterator[Sketch]:
    """Figures of the searches: history, ratios, importance, and slices of each tuned law."""
    yield Sketch(
        "history",
        f"best {objective} on the training draws so far, a curve for each search: the curves begin "
        "with the scenario's gains; one rises where a trial holds the inequalities better",
        partial(history, results.history, results.label),
    )
    rows = results.pairs[(results.pairs["when"] == "tuning")]
    rows = rows[rows.metric == (results.shown_metrics[0])]
    if len(rows):
        yield Sketch(
            "ratios",
            f"what the search changed in {results.shown_metrics[0]}: the median ratio of each law "
            "after and before in the same fresh draw, with its interval; below 1 is better",
            partial(ratios, rows),
        )
    if len(results.importance):
        yield Sketch(
            "importance",
            "importance of each gain: the share of the variation between good trials and all that "
            "it explains (PED-ANOVA); the lines go from the least to the most of all searches and "
            "parts of the trials",
            partial(importance, results.importance),
        )
    for law in results.winners:
        yield _slices(results, law, objective)


def _slices(results: SearchResults, law: str, objective: str) -> Sketch:
    """The figure of all trials of a law over each of its gains; `objective` is its text."""
    tried = pd.DataFrame(
        [
            {
                **trial.gains,
                "objective": trial.value,
                "repeat": repeat,
                "whole": trial.status == FINISHED,
            }
            for repeat, trials in enumerate(results.trials[law])
            for trial in trials
        ]
    )
    return Sketch(
        f"slices-{law}",
        f"every trial of {law} by each of its gains: {objective} over the draws that the trial "
        "met, a colour for each search, hollow where the trial was pruned or cut; the full line is "
        "the gain that was found, the broken one the scenario's",
        partial(
            slices,
            tried,
            results.plan.gains[law],
            results.winner(law).gains,
            results.label,
            units_of(results.plan.laws[law]),
        ),
    )


def before_and_after(laws: pd.DataFrame, label: str) -> Figure:
    """The objective of every law with its interval, before and after, best law on top.

    `laws` is the table `SearchResults.laws`, `label` the objective with its unit.
    """
    ordered = laws.sort_values("objective_after", ignore_index=True)
    figure = new_figure(COLUMNS, FRAME + 1.4 * ROW * len(ordered))
    axes = figure.add_subplot()
    for row, law in ordered.iterrows():
        # Both bars of a law lie on either side of its line.
        place = float(str(row))
        _draw_range(axes, place - 0.16, law, "before", "none")
        _draw_range(axes, place + 0.16, law, "after", nth_style(1)[0])
    for when, fill in (("before", "none"), ("after", nth_style(1)[0])):
        colour = nth_style(1 if when == "after" else 0)[0]
        # Empty curves, for the legend only.
        axes.plot(
            [],
            [],
            "o-",
            color=colour,
            markerfacecolor=fill,
            markersize=3.6,
            linewidth=1.2,
            label=f"{when} the search",
        )
    axes.set_yticks(range(len(ordered)), [escaping.figure(law) for law in ordered.law])
    axes.set_ylim(len(ordered) - 0.4, -0.6)
    axes.set_xlabel(escaping.figure(label))
    legend(figure)
    return figure


def effort(table: pd.DataFrame, metric: str) -> Figure:
    """Error over variation of the demand: each law before, and the middle half of its searches.

    `table` is `SearchResults.effort`, `metric` the name of its error.
    """
    figure = new_figure(COLUMNS, 3.4)
    axes = figure.add_subplot()
    for place, (law, rows) in enumerate(table.groupby("law", sort=False)):
        colour, _, marker = nth_style(place)
        look: dict[str, Any] = {"marker": marker, "color": colour, "linestyle": "none"}
        for before, some in rows.groupby("before"):
            (left, x, right), (low, y, high) = (
                some[name].quantile(MIDDLE) for name in ("variation", "error")
            )
            axes.plot([left, right], [y, y], color=colour, linewidth=0.8)
            axes.plot([x, x], [low, high], color=colour, linewidth=0.8)
            axes.plot(
                x,
                y,
                markersize=4.5,
                markerfacecolor="none" if before else colour,
                label=None if before else escaping.figure(str(law)),
                **look,
            )
    known = table.replace(np.inf, np.nan)
    wide = {name: known[name].max() > DECADE * known[name].min() for name in ("variation", "error")}
    axes.set_xscale("log" if wide["variation"] else "linear")
    axes.set_yscale("log" if wide["error"] else "linear")
    axes.set_xlabel("total variation of the surge demand [N]")
    axes.set_ylabel(f"median {escaping.figure(metric)} on fresh draws")
    legend(figure)
    return figure


def _draw_range(axes: Axes, y: float, law: Any, when: str, fill: str) -> None:
    """Draw a law's objective at height `y`: its interval as a line, the estimate as a dot.

    `law` is its row of `SearchResults.laws`, `when` before or after, `fill` the dot's colour.
    """
    estimate, low, high = (law[f"objective_{when}{end}"] for end in ("", "_low", "_high"))
    colour = nth_style(0)[0] if when == "before" else nth_style(1)[0]
    if np.isfinite([low, high]).all():
        axes.plot([low, high], [y, y], color=colour, linewidth=1.2, solid_capstyle="butt")
    if math.isfinite(estimate):
        axes.plot(estimate, y, "o", markersize=3.6, color=colour, markerfacecolor=fill)


def history(trials: pd.DataFrame, label: str) -> Figure:
    """The best objective so far over simulated runs; `trials` is `SearchResults.history`."""
    figure = new_figure(COLUMNS, 2.8)
    axes = figure.add_subplot()
    for place, (law, rows) in enumerate(trials.groupby("law", sort=False)):
        colour, style, _ = nth_style(place)
        for i, (_, repeat) in enumerate(rows.groupby("repeat")):
            axes.step(
                repeat.spent,
                repeat.best.replace(np.inf, np.nan),
                where="post",
                color=colour,
                linestyle=style,
                linewidth=0.9,
                label=escaping.figure(str(law)) if not i else None,
            )
    axes.set(xlabel="simulated runs of a search", ylabel=f"best {escaping.figure(label)} so far")
    legend(figure)
    return figure


def importance(table: pd.DataFrame) -> Figure:
    """A panel for each law with a bar for each gain; `table` is `SearchResults.importance`."""
    laws = list(dict.fromkeys(table.law))
    across = min(len(laws), ACROSS - 1)
    down = math.ceil(len(laws) / across)
    most = int(table.groupby("law").size().max())
    # In inches: 0.13 a bar, and 0.45 for title and axis.
    figure = new_figure(COLUMNS, down * (0.45 + 0.13 * most))
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for law, axes in zip(laws, panels, strict=False):
        rows = table[table.law == law].sort_values("importance", ascending=False)
        places = range(len(rows))
        axes.barh(places, 100.0 * rows.importance, color=nth_style(0)[0], alpha=0.55, height=0.7)
        axes.hlines(places, 100.0 * rows.low, 100.0 * rows.high, color="#333333", linewidth=0.7)
        axes.set_yticks(places, [escaping.figure(key) for key in rows.gain], fontsize=5.5)
        axes.set_ylim(most - 0.4, -0.6)
        axes.tick_params(axis="x", labelsize=5.5)
        axes.set_title(f"{escaping.figure(law)} [%]", **SMALL)
    for axes in panels[len(laws) :]:
        axes.set_visible(False)
    return figure


def slices(
    tried: pd.DataFrame,
    gains: Sequence[Gain],
    winner: Mapping[str, Any],
    label: str,
    units: Mapping[str, str],
) -> Figure:
    """A panel for each gain of a law, a point for each trial.

    `tried` has a row a trial: gains, objective, repeat, whole. `winner` has the gains that were
    found, `label` is the objective's, `units` are by gain.
    """
    across = min(len(gains), ACROSS)
    down = math.ceil(len(gains) / across)
    figure = new_figure(COLUMNS, 0.3 + PANEL * down)
    panels = figure.subplots(down, across, squeeze=False, sharey=True)
    values = tried.objective.to_numpy(float)
    shown = values[np.isfinite(values)]
    for gain, axes in zip(gains, panels.ravel(), strict=False):
        _slice(axes, gain, tried, winner[gain.key])
        unit = f" [{units[gain.key]}]" if units[gain.key] not in ("", "1") else ""
        axes.set_xlabel(escaping.figure(f"{gain.key}{unit}"), **SMALL)
    if len(shown):
        # The first trial has the scenario's gains. Trials far worse than it would flatten all
        # others.
        low, start = float(shown.min()), float(values[0])
        top = (
            TOP * start if math.isfinite(start) and start > 0.0 else float(np.quantile(shown, 0.75))
        )
        # matplotlib warns of an axis whose ends are equal.
        panels[0, 0].set_ylim(low - 0.05 * (top - low), max(top, low + 1e-9))
    for axes in panels.ravel()[len(gains) :]:
        axes.set_visible(False)
    for axes in panels[:, 0]:
        axes.set_ylabel(escaping.figure(label), **SMALL)
    return figure


def _slice(axes: Axes, gain: Gain, tried: pd.DataFrame, winner: Any) -> None:
    """Draw the trials over one gain, and lines at the found gain and the scenario's own.

    `winner` is the gain that was found, a number or a word.
    """
    # Words stand at whole numbers in their order.
    if gain.words:
        places = {word: place for place, word in enumerate(gain.words)}
        x = tried[gain.key].map(places)
        axes.set_xticks(range(len(places)), [escaping.figure(str(word)) for word in places])
        own, mark = places.get(gain.own), places[winner]
    else:
        x, own, mark = tried[gain.key], gain.own, winner
    for (repeat, whole), some in tried.assign(x=x).groupby(["repeat", "whole"]):
        colour = nth_style(int(str(repeat)))[0]
        fill = colour if whole else "none"
        axes.scatter(
            some.x, some.objective, facecolors=fill, edgecolors=colour, **WHOLE if whole else PRUNED
        )
    axes.axvline(mark, **TARGET_LOOK)
    if own is not None:
        axes.axvline(own, **{**TARGET_LOOK, "linestyle": "--"})
    if gain.log:
        axes.set_xscale("log")
        # The scenario's own value may lie outside of the range.
        axes.set_xlim(0.9 * min(gain.low, gain.own), 1.1 * max(gain.high, gain.own))
        axes.xaxis.set_minor_formatter(NullFormatter())  # labels of minor ticks overlap
    axes.tick_params(labelsize=5.5)
