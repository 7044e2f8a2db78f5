"""Which figures a study has, with their captions, and drawing them into files."""

from __future__ import annotations

import ast
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.quantities import raised
from podusv_cli.pages.page import Picture
from podusv_cli.process.extras import Extras, Missing
from podusv_cli.process.interrupts import interrupts_enabled
from podusv_cli.process.workers import run_all
from podusv_cli.scenario.phrases import as_yaml
from podusv_cli.studies.study.expressions import FINISHED, parse_success, succeeded
from podusv_cli.studies.study.keep import Track
from podusv_cli.studies.study.results import Results
from podusv_cli.studies.study.summary import has, values_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    Draw = partial[Figure]

COLUMNS = 2  # of a journal page, in width
MOST_CELLS = 6  # of which each has figures of its own
FORMATS = ("png", "svg")


@dataclass(frozen=True)
class Sketch:
    """A figure that is still to be drawn: its file's name, its caption, and what draws it."""

    name: str
    caption: str
    draw: Draw


def drawn(
    results: Results, tracks: Sequence[Track], extras: Extras
) -> tuple[dict[str, bytes], list[Picture]]:
    """All figures of a study, see `rendered`."""
    return rendered(lambda: list(sketches(results, tracks)), extras)


def rendered(
    listed: Callable[[], list[Sketch]], extras: Extras
) -> tuple[dict[str, bytes], list[Picture]]:
    """Figures, each drawn in a process of its own: PNG by file name, and as pictures.

    A figure that cannot be drawn is missing among the `extras`.
    """
    files: dict[str, bytes] = {}
    pictures: list[Picture] = []
    wanted = extras.made("the list of figures", listed) or []
    outcomes = () if extras.interrupted else run_all([partial(_images, one) for one in wanted])
    for sketch, outcome in zip(wanted, outcomes, strict=bool(outcomes)):
        extras.interrupted |= outcome.interrupted
        if outcome.result:
            files[f"{sketch.name}.png"] = outcome.result["png"]
            pictures.append(Picture(sketch.name, sketch.caption, outcome.result["svg"]))
        elif not outcome.interrupted:
            extras.missing.append(Missing(f"figure {sketch.name}", outcome.failure))
    return files, pictures


def _images(sketch: Sketch, tell: Callable[[float], None]) -> dict[str, bytes]:
    from podusv_cli.figures.style import house_style, image  # matplotlib is slow to import

    with (
        interrupts_enabled(), house_style(), np.errstate(all="ignore"), warnings.catch_warnings()
    ):  # fmt: skip
        warnings.simplefilter("ignore")  # of numbers near the end of all, as diverged runs have
        figure = sketch.draw()
        return {form: image(figure, form) for form in FORMATS}


def sketches(results: Results, tracks: Sequence[Track]) -> Iterator[Sketch]:
    """The figures that the study has numbers for."""
    cells = range(min(len(results.runs.cells), MOST_CELLS))
    for name in results.shown:
        for cell in cells:
            yield from _distribution(results, name, cell)
    for name in results.shown:
        yield from _ratios(results, name)
    for cell in cells:
        yield from _failures(results, cell)
    yield from _heatmaps(results)
    for name in results.shown:
        for cell in cells:
            yield from _correlations(results, name, cell)
    yield from _funnel(tracks)


def _named(kind: str, results: Results, cell: int) -> str:
    return f"{kind}-cell{cell}" if len(results.runs.cells) > 1 else kind


def _at(results: Results, cell: int) -> str:
    return f" at {results.runs.cells[cell]}" if results.runs.cells[cell] else ""


def _label(results: Results, name: str) -> str:
    return f"{name} [{raised(results.known[name].unit)}]"


def _met(results: Results, name: str, cell: int) -> dict[str, Vector]:
    """A metric of the draws that every law that has it was tried on, failures as infinity."""
    runs, about = results.runs, results.known[name]
    return {
        law: values_of(runs, law, cell, about)[runs.done(law)[cell]]
        for law in runs.laws if has(runs, law, cell, about)
    }  # fmt: skip


def _bands(level: float) -> str:
    return "" if np.isnan(level) else f"; the bands are {100 * level:g} % intervals of each share"


def _distribution(results: Results, name: str, cell: int) -> Iterator[Sketch]:
    from podusv_cli.studies.study.figures import distributions

    values, level = _met(results, name, cell), results.level
    if values:
        yield Sketch(
            _named(f"distribution-{name}", results, cell),
            f"distribution of {name} over all draws{_at(results, cell)}: "
            f"{results.known[name].meaning}; a curve that is higher has smaller values, and one "
            f"that ends below 100 % has failed runs{_bands(level)}",
            partial(distributions, values, _label(results, name), level, COLUMNS),
        )


def _ratios(results: Results, name: str) -> Iterator[Sketch]:
    from podusv_cli.studies.study.figures import ratios

    pairs, cells, level = results.pairs, results.runs.cells[:MOST_CELLS], results.level
    if len(pairs) and len(rows := pairs[(pairs.metric == name) & pairs.cell.isin(cells)]):
        yield Sketch(
            f"ratios-{name}",
            f"ratio of {name} between two laws in the same draw: its median"
            f"{'' if np.isnan(level) else f' with a {100 * level:g} % interval'}; below 1, the law "
            f"named first has the smaller value; wins are draws in which a law is better by more "
            f"than {100 * float(rows.margin.iloc[0]):g} %",
            partial(ratios, rows, COLUMNS),
        )


def _failures(results: Results, cell: int) -> Iterator[Sketch]:
    from podusv_cli.studies.study.figures import failure_rates

    level = results.level
    for name, threshold, values in _thresholds(results, cell):
        yield Sketch(
            _named(f"failures-{name}", results, cell),
            f"failed draws{_at(results, cell)} if success asked for another threshold of {name}: "
            f"the vertical line is the study's own, {threshold:g}; each curve ends at the share of "
            f"runs that fail whatever the threshold{_bands(level)}",
            partial(failure_rates, values, _label(results, name), threshold, level, COLUMNS),
        )


def _thresholds(results: Results, cell: int) -> Iterator[tuple[str, float, dict[str, Vector]]]:
    """Metrics that success limits from above, the limits, and values of each law's draws.

    A run that fails for another reason has infinity.
    """
    tree = parse_success(results.plan.sweep.success, results.known)
    parts = tree.values if isinstance(tree, ast.BoolOp) else [tree]
    for part in parts:
        match part:
            case ast.Compare(
                left=ast.Name(id=name), ops=[ast.Lt() | ast.LtE()],
                comparators=[ast.Constant(value=limit)],
            ):  # fmt: skip
                others = [other for other in parts if other is not part]
                yield name, float(str(limit)), _limited(results, name, others, cell)


def _limited(
    results: Results, name: str, others: Sequence[ast.expr], cell: int
) -> dict[str, Vector]:
    runs, found = results.runs, dict[str, Vector]()
    rest = ast.BoolOp(ast.And(), [ast.Name(FINISHED), *others])
    for law in runs.laws:
        read = {metric: runs.metric(law, metric) for metric in runs.asked}
        held = succeeded(rest, read, runs.finished(law), results.known)[cell]
        values = np.where(held, runs.metric(law, name)[cell], np.inf)
        found[law] = values[runs.done(law)[cell]]
    return {law: values for law, values in found.items() if len(values)}


def _heatmaps(results: Results) -> Iterator[Sketch]:
    from podusv_cli.studies.study.figures import heatmaps

    grid = results.plan.sweep.grid
    if not grid:
        return
    first, *rest = grid
    across = [as_yaml(value) for value in grid[first]]
    down = [", ".join(map(as_yaml, values)) for values in product(*(grid[key] for key in rest))]
    for name in ("failed", *results.shown):
        panels = {law: _panel(results, law, name, len(across)) for law in results.runs.laws}
        label = "failed [1]" if name == "failed" else _label(results, name)
        what = "share of failed draws" if name == "failed" else f"median of {name}"
        yield Sketch(
            f"grid-{name}",
            f"{what} in every cell of the grid: grey cells have a median that is a failure, or no "
            f"runs",
            partial(heatmaps, panels, label, (first, across), (", ".join(rest), down), COLUMNS),
        )


def _panel(results: Results, law: str, name: str, across: int) -> Vector:
    """A number of every cell, a row for each combination of all keys but the first."""
    table = results.summary
    column = "failed" if name == "failed" else "q50"
    rows = table[(table.law == law) & ((name == "failed") | (table.metric == name))]
    found = rows.drop_duplicates("cell").set_index("cell")[column]
    cells = np.array([found.get(label, np.nan) for label in results.runs.cells], float)
    return cells.reshape(across, -1).T


def _correlations(results: Results, name: str, cell: int) -> Iterator[Sketch]:
    from podusv_cli.studies.study.figures import correlations

    table = results.sensitivity
    if not len(table):
        return
    rows = table[(table.metric == name) & (table.cell == results.runs.cells[cell])]
    by_chance = "; the band is what quantities without influence reach by chance"
    by_chance = "" if np.isnan(results.level) else by_chance
    if rows.correlation.notna().any():
        yield Sketch(
            _named(f"sensitivity-{name}", results, cell),
            f"what {name} depends on{_at(results, cell)}: rank correlation with the drawn "
            f"quantities that matter most to any law{by_chance}; correlations see rising and "
            "falling influence only",
            partial(correlations, rows, COLUMNS),
        )


def _funnel(tracks: Sequence[Track]) -> Iterator[Sketch]:
    from podusv_cli.studies.study.figures import funnel

    if tracks:
        curves: dict[str, list[tuple[Vector, Vector]]] = {}
        for track in tracks:
            curves.setdefault(track.law, []).append((track.time, track.distance))
        yield Sketch(
            "funnel",
            f"distance to the target over time in the {len(tracks)} runs whose logs are kept: a "
            "choice of failed, worst and named runs, not of typical ones",
            partial(funnel, curves, COLUMNS),
        )
