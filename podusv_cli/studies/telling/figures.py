"""Figures of a study: which there are, with their captions, and how each is drawn.

They are drawn from plain arrays and tables; axes by quantiles, not by tails. Import this module
where a figure is drawn, because matplotlib is slow to import.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from podusv_cli.core import escaping
from podusv_cli.core.kernel import Vector
from podusv_cli.core.quantities import raise_powers
from podusv_cli.figures.looks import TARGET_LOOK, nth_style
from podusv_cli.figures.sketch import COLUMNS, Sketch
from podusv_cli.figures.style import legend, new_figure
from podusv_cli.studies.counting import statistics
from podusv_cli.studies.counting.expressions import FINISHED, judge_success, parse_success
from podusv_cli.studies.telling.keep import DistanceCurve
from podusv_cli.studies.telling.results import Results
from podusv_cli.studies.telling.summary import column_of

MOST_CELLS = 6  # of which each has figures of its own
POINTS = 400  # of a curve
TAIL = 0.005  # of the values beyond either end of an axis
WIDE = 20.0  # a range this many times its lower end gets a logarithmic axis
ROW, FRAME = 0.17, 0.75  # inches: a row of a chart, and what is around the rows
LEAST_DISTANCE = 1e-3  # m, on a logarithmic axis
HATCHES = ("", "//////", "......", "xxxxxx")  # of bars, which have no line style, in grey print
MOST_BARS = 10  # quantities in a chart of correlations
RATIOS = (1.01, 1.02, 1.05, 1.1, 1.2, 1.5, 2.0, 3.0, 5.0, 10.0, 30.0, 100.0, 1e3, 1e4, 1e6)
BAND: dict[str, Any] = {"alpha": 0.18, "linewidth": 0.0}
CENTRED: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 6.0}
UNKNOWN = "#BBBBBB"


def sketches(results: Results, curves: Mapping[str, Sequence[DistanceCurve]]) -> Iterator[Sketch]:
    """The figures that the study has numbers for; `curves` are those of kept runs, by law."""
    cells = range(min(len(results.runs.cells), MOST_CELLS))
    for name in results.shown_metrics:
        for cell in cells:
            yield from _distribution(results, name, cell)
    for name in results.shown_metrics:
        yield from _ratios(results, name)
    for cell in cells:
        yield from _failures(results, cell)
    yield from _heatmaps(results)
    for name in results.shown_metrics:
        for cell in cells:
            yield from _correlations(results, name, cell)
    yield from _funnel(curves)


def _name_figure(kind: str, results: Results, cell: int) -> str:
    return f"{kind}-cell{cell}" if len(results.runs.cells) > 1 else kind


def _at(results: Results, cell: int) -> str:
    return f" at {results.runs.cells[cell]}" if results.runs.cells[cell] else ""


def _label(results: Results, name: str) -> str:
    return f"{name} [{raise_powers(results.known_metrics[name].unit)}]"


def _metric_by_law(results: Results, name: str, cell: int) -> dict[str, Vector]:
    """A metric (draws,) by law in one cell, infinite for failures; without laws that lack it.

    The draws are those that every law was tried on.
    """
    runs, about = results.runs, results.known_metrics[name]
    return {
        law: values[runs.done(law)[cell]]
        for law in runs.laws
        if (values := column_of(runs, law, cell, about)) is not None
    }


def _bands(level: float) -> str:
    return "" if np.isnan(level) else f"; the bands are {100 * level:g} % intervals of each share"


def _distribution(results: Results, name: str, cell: int) -> Iterator[Sketch]:
    """The figure of one metric in one cell, a curve for each law; none without numbers."""
    values, level = _metric_by_law(results, name, cell), results.level
    if values:
        yield Sketch(
            _name_figure(f"distribution-{name}", results, cell),
            f"distribution of {name} over all draws{_at(results, cell)}: "
            f"{results.known_metrics[name].meaning}; a curve that is higher has smaller values, "
            f"and one that ends below 100 % has failed runs{_bands(level)}",
            partial(distributions, values, _label(results, name), level),
        )


def _ratios(results: Results, name: str) -> Iterator[Sketch]:
    """The figure of one metric's ratios between two laws in the same draw; none without pairs."""
    pairs, cells, level = results.pairs, results.runs.cells[:MOST_CELLS], results.level
    if len(pairs) and len(rows := pairs[(pairs.metric == name) & pairs.cell.isin(cells)]):
        yield Sketch(
            f"ratios-{name}",
            f"ratio of {name} between two laws in the same draw: its median"
            f"{'' if np.isnan(level) else f' with a {100 * level:g} % interval'}; below 1, the law "
            f"named first has the smaller value; wins are draws in which a law is better by more "
            f"than {100 * float(rows.margin.iloc[0]):g} %",
            partial(ratios, rows),
        )


def _failures(results: Results, cell: int) -> Iterator[Sketch]:
    """Failures over the threshold, for each metric that success limits, in one cell."""
    level = results.level
    for name, threshold, values in _thresholds(results, cell):
        yield Sketch(
            _name_figure(f"failures-{name}", results, cell),
            f"failed draws{_at(results, cell)} if success asked for another threshold of {name}: "
            f"the vertical line is the study's own, {threshold:g}; each curve ends at the share of "
            f"runs that fail whatever the threshold{_bands(level)}",
            partial(failure_rates, values, _label(results, name), threshold, level),
        )


def _thresholds(results: Results, cell: int) -> Iterator[tuple[str, float, dict[str, Vector]]]:
    """Each metric that success limits from above, its limit, and the draws' values (n,) by law.

    A run that fails for another reason has infinity. Other parts of the condition give no figure.
    """
    tree = parse_success(results.about.success, results.known_metrics)
    parts = tree.values if isinstance(tree, ast.BoolOp) else [tree]
    for part in parts:
        match part:
            case ast.Compare(
                left=ast.Name(id=name),
                ops=[ast.Lt() | ast.LtE()],
                comparators=[ast.Constant(value=limit)],
            ):
                others = [other for other in parts if other is not part]
                yield name, float(str(limit)), _limit_axis(results, name, others, cell)


def _limit_axis(
    results: Results, name: str, others: Sequence[ast.expr], cell: int
) -> dict[str, Vector]:
    """For each law the metric `name` of its runs (n,) in one cell; inf where `others` fail.

    `others` are the remaining parts of the condition of success.
    """
    runs, limited = results.runs, dict[str, Vector]()
    rest = ast.BoolOp(ast.And(), [ast.Name(FINISHED), *others])
    for law in runs.laws:
        read = {metric: runs.metric(law, metric) for metric in runs.success_metrics}
        held = judge_success(rest, read, runs.finished(law), results.known_metrics)[cell]
        values = np.where(held, runs.metric(law, name)[cell], np.inf)
        limited[law] = values[runs.done(law)[cell]]
    return {law: values for law, values in limited.items() if len(values)}


def _heatmaps(results: Results) -> Iterator[Sketch]:
    """Failures and medians over the grid: first key across, all others down."""
    grid = results.about.grid
    if not grid:
        return
    first, *rest = grid
    across = grid[first]
    down = [", ".join(values) for values in product(*(grid[key] for key in rest))]
    for name in ("failed", *results.shown_metrics):
        panels = {law: _panel(results, law, name, len(across)) for law in results.runs.laws}
        label = "failed [1]" if name == "failed" else _label(results, name)
        what = "share of failed draws" if name == "failed" else f"median of {name}"
        yield Sketch(
            f"grid-{name}",
            f"{what} in every cell of the grid: grey cells have a median that is a failure, or no "
            f"runs",
            partial(heatmaps, panels, label, (first, across), (", ".join(rest), down)),
        )


def _panel(results: Results, law: str, name: str, across: int) -> Vector:
    """The share of failures or the median of metric `name` in every cell, for one law.

    Shape (cells / across, across), where `across` is how many values the first key has. A row is a
    combination of all other keys.
    """
    table = results.summary
    column = "failed" if name == "failed" else "q50"
    rows = table[(table.law == law) & ((name == "failed") | (table.metric == name))]
    by_cell = rows.drop_duplicates("cell").set_index("cell")[column]
    cells = np.array([by_cell.get(label, np.nan) for label in results.runs.cells], float)
    # Cells are ordered with the last key changing fastest, so the first key varies down the
    # reshaped array.
    return cells.reshape(across, -1).T


def _correlations(results: Results, name: str, cell: int) -> Iterator[Sketch]:
    """The figure of what one metric depends on in one cell; none where nothing varies."""
    table = results.sensitivity
    if not len(table):
        return
    rows = table[(table.metric == name) & (table.cell == results.runs.cells[cell])]
    by_chance = "; the band is what quantities without influence reach by chance"
    by_chance = "" if np.isnan(results.level) else by_chance
    if rows.correlation.notna().any():
        yield Sketch(
            _name_figure(f"sensitivity-{name}", results, cell),
            f"what {name} depends on{_at(results, cell)}: rank correlation with the drawn "
            f"quantities that matter most to any law{by_chance}; correlations see rising and "
            "falling influence only",
            partial(correlations, rows),
        )


def _funnel(curves: Mapping[str, Sequence[DistanceCurve]]) -> Iterator[Sketch]:
    """Distance to the target over time of the kept runs, by law."""
    if count := sum(map(len, curves.values())):
        yield Sketch(
            "funnel",
            f"distance to the target over time in the {count} runs whose logs are kept: a "
            "choice of failed, worst and named runs, not of typical ones",
            partial(funnel, curves),
        )


def distributions(values: Mapping[str, Vector], label: str, level: float) -> Figure:
    """The empirical distribution of a metric for every law; failures (+inf) are missing mass.

    `values` are (draws,) by law, `label` is the axis label, `level` the confidence of the bands.
    """
    figure = new_figure(COLUMNS, 2.6)
    axes = figure.add_subplot()
    ends = _span(axes, values)
    for place, (law, numbers) in enumerate(values.items()):
        x = _steps(numbers, ends)
        _share_curve(
            axes, place, _legend_of(law, numbers), x, _at_most(numbers, x), len(numbers), level
        )
    axes.set_ylim(0.0, 100.0)
    axes.set(xlabel=label, ylabel="draws with at most this value [%]")
    legend(figure)
    return figure


def failure_rates(
    values: Mapping[str, Vector], label: str, threshold: float, level: float
) -> Figure:
    """The share of draws that fail as a function of the metric's threshold, a curve a law.

    `values` are (draws,) by law, +inf for runs that fail whatever the threshold; `label` names the
    metric; a line marks the study's own `threshold`; `level` is the confidence of the bands.
    """
    figure = new_figure(COLUMNS, 2.6)
    axes = figure.add_subplot()
    ends = _span(axes, values, threshold)
    for place, (law, numbers) in enumerate(values.items()):
        x, n = _steps(numbers, ends), len(numbers)
        _share_curve(axes, place, _legend_of(law, numbers), x, n - _at_most(numbers, x), n, level)
    axes.axvline(threshold, **TARGET_LOOK)
    axes.set_yscale("log")
    # Half a draw, in percent: the smallest share above 0 is that of one draw.
    axes.set_ylim(50.0 / max(map(len, values.values())), 110.0)
    axes.set(xlabel=f"threshold of {label}", ylabel="failed draws [%]")
    axes.yaxis.set_major_formatter("{x:g}")
    legend(figure)
    return figure


def ratios(pairs: pd.DataFrame) -> Figure:
    """The median paired ratio a / b with its interval, and how often each law wins.

    `pairs` are rows of `summary.pairs`, all of one metric.
    """
    figure = new_figure(COLUMNS, FRAME + 2.0 * ROW * len(pairs))
    axes = figure.add_subplot()
    rows = range(len(pairs))
    ends = _ratio_axis(axes, pairs)
    for row, (_, pair) in zip(rows, pairs.iterrows(), strict=True):
        low, high = np.clip([pair.ratio_low, pair.ratio_high], *ends)
        axes.plot(
            [low, high], [row, row], color=nth_style(0)[0], linewidth=1.6, solid_capstyle="butt"
        )
        if ends[0] <= pair.ratio <= ends[1]:
            axes.plot(pair.ratio, row, color=nth_style(0)[0], marker="o", markersize=3.6)
        # An end beyond the axis becomes an arrowhead at its edge.
        for end in {low: pair.ratio_low, high: pair.ratio_high}.items():
            if end[0] != end[1]:  # beyond the axis
                mark = "<" if end[0] == ends[0] else ">"
                axes.plot(
                    end[0], row, color=nth_style(0)[0], marker=mark, markersize=4, clip_on=False
                )
    axes.axvline(1.0, **TARGET_LOOK)
    axes.set_yticks(rows, [_pair(pair) for _, pair in pairs.iterrows()])
    axes.set_ylim(len(pairs) - 0.4, -0.6)
    axes.set_xlabel("median of the paired ratio a / b")
    return figure


def heatmaps(
    panels: Mapping[str, Vector],
    label: str,
    x: tuple[str, Sequence[str]],
    y: tuple[str, Sequence[str]],
) -> Figure:
    """A number of every cell for each law: columns are the values of x, rows those of y.

    `panels` are (rows, columns) by law, NaN for a cell without a number, inf for a failure. `x` and
    `y` are grid keys with their values; `label` is that of the colour scale.
    """
    height = FRAME + 2.0 * ROW * len(y[1])
    figure = new_figure(COLUMNS, height)
    *every, scale = figure.subplots(1, len(panels) + 1, width_ratios=[1.0] * len(panels) + [0.05])
    finite = np.concatenate([panel[np.isfinite(panel)] for panel in panels.values()])
    low, high = (finite.min(), finite.max()) if len(finite) else (0.0, 1.0)
    for axes, (law, panel) in zip(every, panels.items(), strict=True):
        shown = np.ma.masked_invalid(panel)
        image = axes.pcolormesh(shown, vmin=low, vmax=high, cmap="cividis", edgecolors="white")
        _write(axes, panel, low, high)
        axes.set_title(escaping.figure(law))
        axes.set_facecolor(UNKNOWN)
        axes.grid(visible=False)
        axes.tick_params(axis="y", length=0, labelleft=axes is every[0])
        axes.set_xticks(np.arange(len(x[1])) + 0.5, [escaping.figure(v) for v in x[1]])
        axes.set_xlabel(escaping.figure(x[0]))
    every[0].set_yticks(np.arange(len(y[1])) + 0.5, [escaping.figure(v) for v in y[1]])
    every[0].set_ylabel(escaping.figure(y[0]))
    figure.colorbar(image, cax=scale, label=label, ticklocation="left")
    return figure


def correlations(sensitivity: pd.DataFrame) -> Figure:
    """Rank correlations of a metric with the drawn quantities that matter most to any law.

    `sensitivity` are rows of `summary.sensitivity`, all of one metric and cell.
    """
    table = sensitivity.pivot(index="quantity", columns="law", values="correlation")
    table = table[list(dict.fromkeys(sensitivity.law))]
    order = table.abs().max(axis=1).sort_values(ascending=False).index[:MOST_BARS]
    table, count = table.loc[order], len(table.columns)
    figure = new_figure(COLUMNS, FRAME + (0.55 + 0.45 * count) * ROW * len(table))
    axes = figure.add_subplot()
    chance = float(sensitivity.by_chance.max())
    for place, law in enumerate(table.columns):
        # The bars of all laws share 0.8 of a row, centred on it.
        at = np.arange(len(table)) + (place - (count - 1) / 2) * 0.8 / count
        axes.barh(
            at,
            table[law],
            0.7 / count,
            color=nth_style(place)[0],
            label=escaping.figure(law),
            edgecolor="white",
            linewidth=0.0,
            hatch=HATCHES[place % len(HATCHES)],
        )
    if np.isfinite(chance):
        look_of_chance: dict[str, Any] = {"color": "#E4E4E4", "linewidth": 0.0, "zorder": 0.0}
        axes.axvspan(-chance, chance, label="by chance", **look_of_chance)
    axes.axvline(0.0, **TARGET_LOOK)
    axes.set_yticks(range(len(table)), [escaping.figure(name) for name in table.index])
    axes.set_ylim(len(table) - 0.4, -0.6)
    axes.set(xlim=(-1.0, 1.0), xlabel="rank correlation [1]")
    axes.grid(visible=False, axis="y")
    legend(figure)
    return figure


def funnel(curves: Mapping[str, Sequence[DistanceCurve]]) -> Figure:
    """The distance to the target over time of every run, in the colour of its law."""
    figure = new_figure(COLUMNS, 2.6)
    axes = figure.add_subplot()
    for place, (law, runs) in enumerate(curves.items()):
        color, linestyle, _ = nth_style(place)
        for number, (time, distance) in enumerate(runs):
            label = escaping.figure(law) if not number else "_"  # "_" is not in the legend
            shown = np.maximum(distance, LEAST_DISTANCE)
            axes.plot(time, shown, color=color, linestyle=linestyle, linewidth=0.8, label=label)
    axes.set_yscale("log")
    low, high = _span_of([distance for runs in curves.values() for _, distance in runs])
    axes.set_ylim(low, high)
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set(xlabel="$t$ [s]", ylabel="$z_e$ [m]")
    axes.margins(x=0.0)
    legend(figure)
    return figure


def _span_of(distances: Sequence[Vector]) -> tuple[float, float]:
    """The ends of a logarithmic axis [m] that shows most runs.

    `distances` are (n,) [m], one array a run. Runs that peak beyond WIDE times the median peak, as
    a lost vessel does, may leave it.
    """
    peaks = np.array([float(np.max(distance)) for distance in distances])
    lows = [float(np.min(distance)) for distance in distances]
    usual = peaks[peaks <= WIDE * float(np.median(peaks))]
    return max(min(lows), LEAST_DISTANCE) / 1.5, float(usual.max()) * 1.5


def _steps(values: Vector, ends: tuple[float, float]) -> Vector:
    """Points at which a distribution of `values` (n,) is drawn, thinned, between `ends`."""
    low, high = ends
    inside = np.sort(values[(values > low) & (values < high)])
    chosen = np.linspace(0, len(inside) - 1, min(POINTS, len(inside))).astype(int)
    return np.concatenate([[low], inside[chosen], [high]])


def _at_most(values: Vector, x: Vector) -> NDArray[np.int_]:
    """How many of `values` (n,) do not exceed each of `x` (m,); counts (m,)."""
    return np.searchsorted(np.sort(values), x, side="right")


def _share_curve(
    axes: Axes, place: int, label: str, x: Vector, counts: NDArray[np.int_], n: int, level: float
) -> None:
    """Draw a share of draws [%] over `x` (m,) as steps, within its intervals.

    `counts` (m,) of `n` draws are in the share. `place` chooses the style of the law.
    """
    color, linestyle, _ = nth_style(place)
    percent = [100.0 * np.asarray(part) for part in statistics.share(counts, n, level)]
    axes.plot(x, percent[0], color=color, linestyle=linestyle, label=label, drawstyle="steps-post")
    axes.fill_between(x, percent[1], percent[2], color=color, step="post", **BAND)


def _legend_of(law: str, values: Vector) -> str:
    """The law as a legend tells it: how many of its runs failed, or have no number."""
    failed, unknown = int(np.isinf(values).sum()), int(np.isnan(values).sum())
    counts = [f"{failed} of {len(values)} failed"] if failed else []
    counts += [f"{unknown} unknown"] if unknown else []
    return escaping.figure(law) + (f" ({', '.join(counts)})" if counts else "")


def _span(axes: Axes, values: Mapping[str, Vector], *shown: float) -> tuple[float, float]:
    """Set the horizontal axis to what all laws have but for their tails; returns its ends.

    `values` are (draws,) by law; `shown` are further numbers to have on it. It is logarithmic where
    the upper end is more than WIDE times the lower.
    """
    finite = [numbers[np.isfinite(numbers)] for numbers in values.values()]
    ends = [*shown, *(end for numbers in finite if len(numbers) for end in _without_tails(numbers))]
    low, high = min(ends, default=0.0), max(ends, default=1.0)
    # Only positive ends can be logarithmic.
    if 0.0 < low * WIDE < high:
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter("{x:g}")
        low, high = low / 1.05, high * 1.05
    else:
        margin = 0.03 * (high - low) or 0.1 * abs(high) or 1.0
        low, high = low - margin, high + margin
    axes.set_xlim(low, high)
    return low, high


def _without_tails(numbers: Vector) -> list[float]:
    """The quantiles at TAIL and 1 - TAIL of numbers (n,), where the axis ends; maybe none."""
    ends = [TAIL, 1.0 - TAIL]
    return np.quantile(numbers, ends, method="inverted_cdf").tolist() if len(numbers) else []


def _ratio_axis(axes: Axes, pairs: pd.DataFrame) -> tuple[float, float]:
    """Set a logarithmic axis of ratios that is as long on both sides of 1; returns its ends."""
    values = pairs[["ratio_low", "ratio", "ratio_high"]].to_numpy(float).ravel()
    usable = np.abs(np.log(values[np.isfinite(values) & (values > 0.0)]))
    reach = float(np.exp(1.15 * max(usable.max(initial=0.0), 0.02)))
    axes.set_xscale("log")
    axes.set_xlim(1.0 / reach, reach)
    ticks = [1.0]
    for tick in RATIOS:  # outwards from 1, where there is room
        # A quarter of the half axis between labels keeps them apart.
        if tick < reach and tick / max(ticks) > reach**0.25:
            ticks += [tick, 1.0 / tick]
    axes.set_xticks(ticks, [f"{tick:.3g}" for tick in ticks])
    axes.set_xticks([], minor=True)
    return 1.0 / reach, reach


def _pair(pair: pd.Series) -> str:
    """A row's label: the laws, the cell, and in what share of draws either wins."""
    names = f"{pair.a} / {pair.b}" + (f", {pair.cell}" if pair.cell else "")
    wins = f"wins {100 * pair.a_wins:.3g} % / {100 * pair.b_wins:.3g} %"
    return f"{escaping.figure(names)}\n{wins}"


def _write(axes: Axes, panel: Vector, low: float, high: float) -> None:
    """Write every number of `panel` (rows, columns) into its cell, in a readable colour.

    `low` and `high` are the ends of the colour scale, whose lower half is dark.
    """
    for (row, column), number in np.ndenumerate(panel):
        dark = np.isfinite(number) and number < (low + high) / 2.0
        text = "-" if np.isnan(number) else f"{number:.3g}"
        axes.text(column + 0.5, row + 0.5, text, color="white" if dark else "black", **CENTRED)
