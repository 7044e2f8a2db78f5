"""Figures whose margins follow from what stands in them, in inches, so that nothing is measured.

matplotlib's own layouts draw every text to learn its size, and its axes make an object for every
tick. Together they take three quarters of the time of a figure.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis, Tick, XAxis, YAxis
from matplotlib.backend_bases import RendererBase
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.gridspec import GridSpec
from matplotlib.ticker import Formatter, LogFormatterSciNotation, NullLocator, ScalarFormatter
from matplotlib.transforms import ScaledTranslation

from podusv_cli.core.kernel import Vector
from podusv_cli.core.quantities import exponent

POINT = 1.0 / 72.0  # inches
LINE = 1.25  # heights of a letter from line to line
WIDE, NARROW, USUAL = 0.95, 0.36, 0.64  # widths of letters over their height
WIDE_LETTERS, NARROW_LETTERS = frozenset("mwMW%@−+=<>"), frozenset(" .,:;'|!ilIjtfr()[]/-")
GAP = 3.0  # points between things
SIDE = 0.11  # inches beside a panel, for half a number at an end of its axis
EDGE = 0.03  # inches around a page
FIGURES = 4  # digits for which there is always room beside a panel
MOST = 0.45  # of a page's width, for names at an axis
ROW = 1.5  # heights of a letter from row to row of a legend
HANDLE = 2.8  # heights of a letter beside a line of a legend and its name
RASTER = 1e-6  # of an axis, by which a tick at its end may lie outside

Locations = Sequence[float] | Vector


class Page(Figure):
    """A figure of `Panel`s on one grid; `head` and `foot` are inches kept for legends."""

    head = foot = 0.0

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        """As matplotlib has it."""
        super().__init__(*args, **kwargs)
        self.keys: list[tuple[Sequence[Any], Sequence[str], bool]] = []

    def add_subplot(self, *args: Any, **kwargs: Any) -> Axes:
        """As matplotlib has it; a `Panel`."""
        panel: Axes = super().add_subplot(*args, **{"axes_class": Panel, **kwargs})
        return panel

    def draw(self, renderer: RendererBase) -> None:
        """Arrange the panels and draw them."""
        self.arrange()
        super().draw(renderer)

    def resize(self, width: float, height: float) -> None:
        """Give the page another size [inches].

        Its legends get as many rows as the new width asks for.
        """
        self.set_size_inches(width, height)
        keys, self.keys = self.keys, []
        # A copy, as removing changes the list.
        for legend in list(self.legends):
            legend.remove()
        for handles, names, below in keys:
            self.add_key(handles, names, below=below)

    def narrow(self, width: float) -> bool:
        """Give the page this width [inches] and its panels fewer columns; False where it cannot.

        A row of panels, each with labels of its own, becomes a column; others with labels below
        them stand in two. A grid whose rows and columns mean something stays, up to two columns.
        """
        panels = [axes for axes in self.axes if axes.get_visible()]
        specs = [axes.get_subplotspec() for axes in panels]
        grids = {spec.get_gridspec() if spec else None for spec in specs}
        grid, height = grids.pop() if len(grids) == 1 else None, self.get_figheight()
        # Panels that share the labels of the lowest row cannot be moved apart.
        if grid and all(axes.get_xlabel() for axes in panels):
            single = grid.nrows == 1 and all(axes.get_ylabel() for axes in panels)
            columns = 1 if single else min(grid.ncols, 2)
            rows = -(-len(panels) // columns)
            cells = GridSpec(rows, columns, figure=self)
            for place, axes in enumerate(panels):
                axes.set_subplotspec(cells[place // columns, place % columns])
                if place % columns == 0:
                    axes.tick_params(labelleft=True)
                    axes.set_ylabel(axes.get_ylabel() or panels[0].get_ylabel())
            height *= rows / grid.nrows
        elif grid and grid.ncols > 2:
            return False
        self.resize(width, height)
        return True

    def add_key(self, handles: Sequence[Any], names: Sequence[str], *, below: bool = False) -> None:
        """A legend above (or below) all panels, in as few rows as its names fit into.

        `handles` and `names` are as for matplotlib's legend.
        """
        size = FontProperties(size=rcParams["legend.fontsize"]).get_size_in_points()
        room = (HANDLE + rcParams["legend.handlelength"]) * size * POINT
        wide = [room + text_width(name, size) for name in names]
        count = len(names)
        # Fewer columns until the widest names of all columns fit side by side.
        while count > 1 and sum(map(max, np.array_split(wide, count))) > self.get_figwidth():
            count -= 1
        taken = (-(-len(names) // count) * ROW * size + GAP) * POINT
        edge = EDGE / self.get_figheight()
        self.legend(
            handles,
            names,
            ncols=count,
            loc="lower center" if below else "upper center",
            bbox_to_anchor=(0.5, edge if below else 1.0 - edge),
            borderaxespad=0.0,
            borderpad=0.0,
        )
        self.keys.append((handles, names, below))
        self.foot, self.head = (taken, self.head) if below else (self.foot, taken)

    def add_line(self, text: str) -> None:
        """A line of text below all panels and legends; the next one goes below it."""
        size = FontProperties(size=rcParams["legend.fontsize"]).get_size_in_points()
        place = (self.foot + EDGE) / self.get_figheight()
        self.text(0.5, place, text, ha="center", va="bottom", fontsize=size)
        self.foot += (ROW * size + GAP) * POINT

    def arrange(self) -> None:
        """Give every panel its place: around it, what its own labels, title and numbers take.

        Heights come first: which numbers an axis has depends on its height, and the room at the
        left depends on the numbers.
        """
        panels = [axes for axes in self.axes if axes.get_visible() and axes.get_subplotspec()]
        if not panels:
            return
        for axis in (axis for axes in panels for axis in (axes.xaxis, axes.yaxis)):
            # Of matplotlib's own kinds alone: a formatter that a figure has set stays.
            if plain := PLAIN.get(type(axis.get_major_formatter())):
                axis.set_major_formatter(plain())
            if plain := PLAIN.get(type(axis.get_minor_formatter())):
                axis.set_minor_formatter(plain())
        specs = [spec for axes in panels if (spec := axes.get_subplotspec())]
        grid = specs[0].get_gridspec()
        rows, columns = [spec.rowspan for spec in specs], [spec.colspan for spec in specs]
        width, height = self.get_size_inches()
        above, below = _most(rows, map(_above, panels), map(_below, panels), grid.nrows)
        heights = np.asarray(grid.get_height_ratios()), (self.head + EDGE, self.foot + EDGE)
        tops, bottoms = _spread(height, *heights, above, below)
        for axes, row in zip(panels, rows, strict=True):  # numbers depend on an axis's height
            high = tops[row.start], bottoms[row.stop - 1]
            axes.set_position((0.1, 1.0 - high[1] / height, 0.8, (high[1] - high[0]) / height))
        beside = [_numbers(axes, MOST * width) for axes in panels]
        labels = [
            max(n, SIDE) + _lines(axes.yaxis.label, axes.get_ylabel())
            for axes, n in zip(panels, beside, strict=True)
        ]
        left, right = _most(columns, labels, [SIDE] * len(panels), grid.ncols)
        starts, ends = _spread(
            width, np.asarray(grid.get_width_ratios()), (EDGE, EDGE), left, right
        )
        named = [n if axes.get_ylabel() else 0.0 for axes, n in zip(panels, beside, strict=True)]
        numbers, _ = _most(columns, named, named, grid.ncols)
        for axes, row, column in zip(panels, rows, columns, strict=True):
            low, high = bottoms[row.stop - 1], tops[row.start]
            first, last = starts[column.start], ends[column.stop - 1]
            axes.set_position(
                (first / width, 1.0 - low / height, (last - first) / width, (low - high) / height)
            )
            _put_labels(axes, numbers[column.start])


def _most(
    spans: Sequence[range], before: Iterable[float], after: Iterable[float], count: int
) -> tuple[list[float], list[float]]:
    """What every row or column needs before and after it, by the panels that begin or end there.

    `spans` are the rows (or columns) of each panel, `before` and `after` its needs [inches];
    `count` is how many rows there are.
    """
    needed = [0.0] * count, [0.0] * count
    for span, one, other in zip(spans, before, after, strict=True):
        needed[0][span.start] = max(needed[0][span.start], one)
        needed[1][span.stop - 1] = max(needed[1][span.stop - 1], other)
    return needed


def _spread(
    size: float,
    ratios: Vector,
    edges: tuple[float, float],
    before: Sequence[float],
    after: Sequence[float],
) -> tuple[Vector, Vector]:
    """Where each row (or column) of panels begins and ends [inches], two arrays (rows,).

    `size` [inches] is that of the page; `ratios` (rows,) say how the panels share what is free.
    Also in [inches], `edges` are free at both ends of the page, and `before` and `after` at each
    row, for its labels.
    """
    # Labels that need more than the page would leave nothing of the panels.
    free = max(size - sum(edges) - sum(before) - sum(after), 0.2 * size)
    own = free * ratios / np.sum(ratios)
    whole = np.asarray(before) + own + np.asarray(after)
    starts = edges[0] + np.concatenate([[0.0], np.cumsum(whole)[:-1]]) + before
    return starts, starts + own


def text_width(text: str, size: float) -> float:
    """About the width [inches] of a line of `text` in letters of this size [points]."""
    letters = (
        WIDE if c in WIDE_LETTERS else NARROW if c in NARROW_LETTERS else USUAL for c in text
    )
    return sum(letters) * size * POINT


def _lines(text: Any, shown: str) -> float:
    """Height of an axis's label or of a title with the gap before it [inches]."""
    if not shown:
        return 0.0
    return float(LINE * text.get_fontsize() * (1 + shown.count("\n")) + GAP) * POINT


def _above(axes: Axes) -> float:
    """The height of the titles above a panel [inch]; they may have several lines."""
    titles = [axes.get_title(loc=place) for place in ("left", "center", "right")]
    lines = max((1 + words.count("\n") for words in titles if words), default=0)
    return float(lines * LINE * float(axes.title.get_fontsize()) + GAP) * POINT


def _below(axes: Axes) -> float:
    return _under(axes) + _lines(axes.xaxis.label, axes.get_xlabel()) + GAP * POINT


def _under(axes: Axes) -> float:
    """Height of ticks and numbers below a panel [inches]."""
    look = axes.xaxis.get_tick_params()
    if not look.get("labelbottom", True):
        return 0.0
    size = _size(axes.xaxis)
    lines = max((1 + text.count("\n") for text in _texts(axes.xaxis)), default=1)
    return float(lines * LINE * size + _reach(axes.xaxis)) * POINT


def _numbers(axes: Axes, most: float) -> float:
    """Width of ticks and numbers, or names, at the left of a panel [inches]."""
    if not axes.yaxis.get_tick_params().get("labelleft", True):
        return 0.0
    size = _size(axes.yaxis)
    texts = [line for text in _texts(axes.yaxis) for line in text.split("\n")]
    if not any(texts):
        return 0.0
    widest = max(text_width("0" * FIGURES, size), *(text_width(text, size) for text in texts))
    return min(widest, most) + _reach(axes.yaxis) * POINT


def _size(axis: Axis) -> float:
    given = axis.get_tick_params().get("labelsize", rcParams["ytick.labelsize"])
    return float(FontProperties(size=given).get_size_in_points())


def _reach(axis: Axis) -> float:
    """Points from an axis to its numbers."""
    look = axis.get_tick_params()
    length = look.get("length", rcParams["ytick.major.size"])
    return float(length + look.get("pad", rcParams["ytick.major.pad"]))


def _texts(axis: Axis) -> list[str]:
    """The texts at the ticks that are seen, and last the factor of all numbers, often ""."""
    shown: list[str] = []
    for locations, formatter in (
        (axis.get_majorticklocs(), axis.get_major_formatter()),
        (axis.get_minorticklocs(), axis.get_minor_formatter()),
    ):
        texts = formatter.format_ticks(list(locations))
        shown += [t for t, seen in zip(texts, _visible_ticks(axis, locations), strict=True) if seen]
    # Read last: a formatter computes the factor with the ticks.
    return [*shown, axis.get_major_formatter().get_offset()]  # which depends on the numbers


def _visible_ticks(axis: Axis, locations: Locations) -> Any:
    """Which ticks at `locations` (n,) lie on the axis, as a mask (n,).

    RASTER of the axis's length is allowed beyond both ends, for rounding.
    """
    change = axis.get_transform().transform
    low, high = sorted(change(np.asarray(axis.get_view_interval(), float)))
    at, room = change(np.asarray(locations, float)), RASTER * (high - low)
    return (at >= low - room) & (at <= high + room)


def _put_labels(axes: Axes, numbers: float) -> None:
    """Put the labels beyond the numbers [inches], those of one column of panels in one line."""
    inches = axes.figure.dpi_scale_trans
    away = ScaledTranslation(-max(numbers, SIDE) - GAP * POINT, 0.0, inches)
    axes.yaxis.set_label_coords(0.0, 0.5, axes.transAxes + away)
    down = ScaledTranslation(0.0, -_under(axes) - GAP * POINT, inches)
    axes.xaxis.set_label_coords(0.5, 0.0, axes.transAxes + down)


class Panel(Axes):
    """Axes that draw all ticks of a kind with one object, not each with its own."""

    name = "podusv"

    def _init_axis(self) -> None:  # where matplotlib has projections give their axes
        """The axes of this panel instead of matplotlib's own, without clearing it twice."""
        self.xaxis, self.yaxis = Across(self, clear=False), Up(self, clear=False)
        for place, axis in (
            ("bottom", self.xaxis),
            ("top", self.xaxis),
            ("left", self.yaxis),
            ("right", self.yaxis),
        ):
            self.spines[place].register_axis(axis)


class _Stamped(Axis, ABC):
    """An axis that moves one tick of each kind from place to place, drawing it there."""

    def set_clip_path(self, path: Any, transform: Any = None) -> None:
        """Of the axis alone: ticks lie inside, and minor ones that are not seen are not made."""
        Artist.set_clip_path(self, path, transform)

    def draw(self, renderer: RendererBase, *args: Any, **kwargs: Any) -> None:
        """Draw grid, ticks, numbers and label."""
        if not self.get_visible():
            return
        renderer.open_group(__name__, gid=self.get_gid())
        for which in (self.major, self.minor):
            if isinstance(which.locator, NullLocator):
                continue
            found = self.get_majorticklocs() if which is self.major else self.get_minorticklocs()
            texts = which.formatter.format_ticks(list(found)) if which.formatter else []
            seen = _visible_ticks(self, found) if len(found) else []
            if not any(seen):
                continue
            # One tick of the kind is enough: it is moved.
            ticks = self.get_major_ticks(1) if which is self.major else self.get_minor_ticks(1)
            kept = [text for text, shown in zip(texts, seen, strict=True) if shown]
            self.stamp(ticks[0], np.asarray(found, float)[seen], kept, renderer)
        self.label.draw(renderer)
        # The factor of all numbers, as 1e3.
        self.offsetText.set_text(self.get_major_formatter().get_offset())
        if self.offsetText.get_text():
            self.place_factor()
            self.offsetText.draw(renderer)
        renderer.close_group(__name__)
        self.stale = False

    def stamp(
        self, tick: Tick, places: Vector, texts: Sequence[str], renderer: RendererBase
    ) -> None:
        """Draw a tick at all places (n,), with its text, grid line and mark.

        Grid lines are one line with gaps (NaN), and marks one line of markers: few objects draw
        faster.
        """
        flat = np.zeros_like(places)
        if tick.gridline.get_visible():
            along = np.repeat(places, 3)
            across = np.tile([0.0, 1.0, np.nan], len(places))
            tick.gridline.set_data(*self.order(along, across))
            tick.gridline.draw(renderer)
        if tick.tick1line.get_visible():
            tick.tick1line.set_data(*self.order(places, flat))
            tick.tick1line.draw(renderer)
        if tick.label1.get_visible():
            for place, text in zip(places, texts, strict=True):
                if text:
                    self.move(tick, float(place))
                    tick.label1.set_text(text)
                    tick.label1.draw(renderer)

    @abstractmethod
    def order(self, along: Vector, across: Vector) -> tuple[Vector, Vector]:
        """Horizontal and vertical positions."""

    @abstractmethod
    def move(self, tick: Tick, place: float) -> None:
        """Move a tick's text."""

    @abstractmethod
    def place_factor(self) -> None:
        """Place the factor that all numbers of the axis have."""


class Across(_Stamped, XAxis):
    """The horizontal axis of a panel."""

    def order(self, along: Vector, across: Vector) -> tuple[Vector, Vector]:
        """As they are."""
        return along, across

    def move(self, tick: Tick, place: float) -> None:
        """Along the axis."""
        tick.label1.set_x(place)

    def place_factor(self) -> None:
        """At the right, in the line of the axis's label."""
        _, bottom = self.label.get_transform().transform(self.label.get_position())
        self.offsetText.set(y=bottom, va="top")


class Up(_Stamped, YAxis):
    """The vertical axis of a panel."""

    def order(self, along: Vector, across: Vector) -> tuple[Vector, Vector]:
        """The other way round."""
        return across, along

    def move(self, tick: Tick, place: float) -> None:
        """Along the axis."""
        tick.label1.set_y(place)

    def place_factor(self) -> None:
        """Above the numbers, beside the panel's title."""
        self.offsetText.set(
            x=-0.01, y=self.axes.bbox.ymax + GAP * self.figure.dpi * POINT, ha="right"
        )


class _PlainTicks(Formatter):
    """Numbers at ticks as plain text; set as formulas, they take a quarter of the drawing time."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        return exponent(super().__call__(x, pos))

    def get_offset(self) -> str:
        """The factor that all numbers of an axis have."""
        return exponent(super().get_offset())


class PlainNumbers(_PlainTicks, ScalarFormatter):
    """Of a linear axis."""


class PlainPowers(_PlainTicks, LogFormatterSciNotation):
    """Of a logarithmic axis."""


PLAIN: dict[type, type[Formatter]] = {
    ScalarFormatter: PlainNumbers,
    LogFormatterSciNotation: PlainPowers,
}
