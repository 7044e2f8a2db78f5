"""Figures of a bench. Import this module where a figure is drawn: matplotlib is slow to import."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from podusv_cli.core import escaping
from podusv_cli.core.kernel import Vector
from podusv_cli.figures.looks import nth_style
from podusv_cli.figures.sketch import COLUMNS, Sketch
from podusv_cli.figures.style import legend, new_figure
from podusv_cli.studies.bench.runs import BenchRun
from podusv_cli.studies.bench.standing import by_vessel, profile

BESIDE = 2  # panels of hulls in a row
RATIO = "IAE over that of the best law of the case, at most"
WORST = 4.0  # times the best law's IAE; the end of the profile's axis
SMALL = 0.62  # inches, the side of a small multiple
MARGIN = 0.15  # of a path's extent, around a small multiple
LOST = "#D55E00"
SMALL_TEXT: dict[str, Any] = {"fontsize": 5.5}
NAMES = 0.75  # inches at the left, for the tasks
DPI = 150.0  # as in a page of 1300 points
TITLES = 0.28  # inches at the top, for the laws
LONGEST = 12  # letters of a law's name in one line
APART = {"bottom": 0.01, "right": 0.995, "wspace": 0.06, "hspace": 0.06}


def sketches(runs: Sequence[BenchRun], made: pd.DataFrame) -> Iterator[Sketch]:
    """The profiles of all laws on each vessel, and their tracks."""
    yield Sketch(
        "profiles",
        "performance profiles: share of a hull's cases by ratio to the best law's IAE",
        partial(profiles, made),
    )
    laws = list(made.law.unique())
    for vessel in dict.fromkeys(run.place[0] for run in runs):
        shown = [run for run in runs if run.place[0] == vessel]
        yield Sketch(
            f"tracks-{vessel}",
            f"tracks of {vessel}; path grey, failed runs orange, all conditions; north up",
            partial(tracks, shown, laws),
        )


def profiles(made: pd.DataFrame) -> Figure:
    """The performance profiles, a panel for each vessel; `made` is `standing.table` of the runs.

    A curve is the share of a vessel's cases in which a law's IAE is at most x times the best law's.
    """
    vessels = by_vessel(made)
    rows = -(-len(vessels) // BESIDE)
    figure = new_figure(COLUMNS, 2.6 * rows + 0.6)
    panels = figure.subplots(rows, min(len(vessels), BESIDE), squeeze=False).ravel()
    for axes, (vessel, cases) in zip(panels, vessels.items(), strict=False):
        _profile(axes, cases)
        axes.set_title(escaping.figure(vessel))
    for axes in panels[len(vessels) :]:
        axes.set_axis_off()
    legend(figure)
    return figure


def _profile(axes: Axes, made: pd.DataFrame) -> None:
    """Draw for each law the share of cases [%] with a ratio to the best of at most x.

    `made` has the rows of one vessel.
    """
    # Enough points that the steps look upright in print.
    ratios = np.geomspace(1.0, WORST, 300)
    for place, law in enumerate(made.law.unique()):
        color, linestyle, _ = nth_style(place)
        share = 100.0 * profile(made, law, ratios)
        axes.plot(
            ratios, share, color=color, linestyle=linestyle, label=escaping.figure(law), zorder=3
        )
    axes.set_xscale("log")
    axes.set(xlim=(1.0, WORST), ylim=(0.0, 101.0), ylabel="cases [%]", xlabel=RATIO)
    axes.set_xticks([1, 1.2, 1.5, 2, 3, 4], ["1", "1.2", "1.5", "2", "3", "4"])
    axes.minorticks_off()


def tracks(runs: Sequence[BenchRun], laws: Sequence[str]) -> Figure:
    """Small multiples of one vessel: a row a task, a column a law, all conditions together.

    `runs` are those of the vessel; `laws` are the columns, the same in each vessel's figure.
    """
    tasks = list(dict.fromkeys(run.task for run in runs))
    width, height = SMALL * len(laws) + NAMES, SMALL * len(tasks) + TITLES
    figure = Figure(figsize=(width, height), dpi=DPI)
    # The margins are known; a layout engine is slow for hundreds of panels.
    figure.set_layout_engine("none")
    places = {"left": NAMES / width, "top": 1.0 - TITLES / height, **APART}
    every = figure.subplots(len(tasks), len(laws), squeeze=False, gridspec_kw=places)
    for task, row in zip(tasks, every, strict=True):
        for law, axes in zip(laws, row, strict=True):
            _small(axes, [run for run in runs if (run.task, run.law) == (task, law)])
        row[0].set_ylabel(escaping.figure(task), **SMALL_TEXT, rotation=0, ha="right", va="center")
    for law, axes in zip(laws, every[0], strict=True):
        axes.set_title(_fold_name(law), **SMALL_TEXT, pad=2.0)
    return figure


def _fold_name(law: str) -> str:
    """A law's name as text of a figure; a long one in two lines."""
    first, _, rest = law.partition("_")
    if not rest or len(law) <= LONGEST:
        return escaping.figure(law)
    return f"{escaping.figure(first)}_\n{escaping.figure(rest)}"


def _small(axes: Axes, runs: Sequence[BenchRun]) -> None:
    """Draw the tracks of a task and a law, east over north; those that fail in another colour."""
    axes.set(xticks=[], yticks=[], aspect="equal")
    for spine in axes.spines.values():
        spine.set_linewidth(0.3)
    # Good runs last, on top of those that failed.
    for run in sorted(runs, key=lambda run: not run.good):
        axes.plot(*run.track.T[1::-1], color=nth_style(0)[0] if run.good else LOST, linewidth=0.5)
    # The path of the longest run is complete; all runs of a panel follow the same one.
    longest = max((run.track for run in runs), key=len)
    if len(longest):
        _frame(axes, longest)


def _frame(axes: Axes, track: Vector) -> None:
    """Draw the path grey, and set square limits around it and the start.

    `track` (rows, 4) has x, y, x_d, y_d [m]. A vessel that leaves these limits is cut off.
    """
    x, y, x_d, y_d = track.T
    axes.plot(y_d, x_d, color="#BBBBBB", linewidth=1.6, zorder=1)
    ends = [np.append(x_d, x[:1]), np.append(y_d, y[:1])]
    half = (0.5 + MARGIN) * max(float(np.ptp(end)) for end in ends)
    north, east = (0.5 * (float(end.min()) + float(end.max())) for end in ends)
    axes.set(xlim=(east - half, east + half), ylim=(north - half, north + half))
