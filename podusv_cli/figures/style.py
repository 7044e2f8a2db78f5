"""The look that all figures share: sizes, colours, line styles, labels, legend, saving."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.ticker import ScalarFormatter

from podusv_cli.core import escaping, quantities
from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import Signal
from podusv_cli.scenario.model import Scenario
from podusv_cli.theory import derived

FORMATS = ("png", "pdf", "svg")
WIDTHS = {1: 3.46, 2: 7.09}  # inches: one column and two columns of a journal page

HANDLE_WIDTH, LETTER_WIDTH = 0.5, 0.06  # inches, in a legend
OVERHANG = 0.1  # inches at the right, for half a label at an end that got its tick by the layout

# Okabe and Ito's palette and four of Tol's, with line styles and markers that tell the curves apart
# in grey print too.
LOOKS: tuple[tuple[str, Any, str], ...] = (
    ("#0072B2", "-", "o"),
    ("#D55E00", (0, (5, 1.5)), "s"),
    ("#009E73", (0, (1.2, 1.2)), "^"),
    ("#CC79A7", (0, (6, 1.5, 1.2, 1.5)), "D"),
    ("#56B4E9", (0, (3, 1, 1, 1, 1, 1)), "v"),
    ("#E69F00", (0, (9, 2)), "P"),
    ("#332288", (0, (2.5, 1.2)), "<"),
    ("#882255", (0, (8, 1.2, 3, 1.2)), ">"),
    ("#999933", (0, (4, 1.2, 1.2, 1.2, 1.2, 1.2, 1.2, 1.2)), "X"),
    ("#7A4B12", (0, (1.2, 2.4)), "*"),
)
MARKS = 24  # on the curves of a panel together
FEWEST, MOST = 3, 8  # on a curve
ALONE = 9  # places of a run that is shown alone, both ends among them
TARGET_LOOK: dict[str, Any] = {"color": "#444444", "linewidth": 0.8, "linestyle": "-"}
NO_STAMP: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "Producer": None, "Creator": None},
    "svg": {"Date": None, "Creator": None},
}


@dataclass(frozen=True, eq=False)
class Shown:
    """A run with the name, colour, line style and marker under which every figure shows it.

    `places` are fractions of a curve, in time, where its markers stand. `peaks` are those of
    signals that a claim about the runs names.
    """

    label: str
    recording: Recording
    scenario: Scenario
    color: str
    linestyle: Any
    marker: str
    places: Vector
    peaks: Mapping[str, float]

    @property
    def name(self) -> str:
        """The label as every text of a figure has to have it."""
        return escaping.figure(self.label)

    @property
    def length(self) -> float:
        """Of the vessel [m]."""
        return self.scenario.vessel.length

    @property
    def end(self) -> float:
        """Time of the last row [s]."""
        return float(self.recording["time"][-1])

    @property
    def steady_from(self) -> float:
        """Start of the part that counts as settled [s]."""
        return self.scenario.steady_from()

    @property
    def line_style(self) -> dict[str, Any]:
        """Keyword arguments of `Axes.plot`; a legend tells how a run ended that did not finish."""
        ending = "" if self.whole else f" ({self.recording.status} at {self.end:g} s)"
        return {"color": self.color, "linestyle": self.linestyle, "label": self.name + ending}

    @property
    def whole(self) -> bool:
        """Whether the run reached its end."""
        return self.recording.status == "finished"

    def has(self, name: str) -> bool:
        """Whether the run has the signal, logged or derivable."""
        return derived.has(self.recording, name, self.scenario.plugged)

    def signal(self, name: str) -> Vector:
        """A logged or derived signal."""
        return derived.signal(self.recording, name, self.scenario.plugged)

    def during(self, name: str, span: tuple[float, float] | None) -> tuple[Vector, Vector]:
        """Time and a signal, all of it or that of a part [s]."""
        t, y = self.recording["time"], self.signal(name)
        first, last = span or (t[0], t[-1])
        inside = slice(np.searchsorted(t, first), np.searchsorted(t, last, side="right"))
        return t[inside], y[inside]

    def row(self, t: float) -> int:
        """The first row that is not before a time [s], else the last row."""
        return min(int(np.searchsorted(self.recording["time"], t)), len(self.recording["time"]) - 1)

    def at(self, t: float, name: str) -> float:
        """A signal in the row of a time [s]."""
        return float(self.signal(name)[self.row(t)])


def nth_style(place: int) -> tuple[str, Any, str]:
    """Colour, line style and marker of the run in this place; the first 100 differ."""
    count = len(LOOKS)
    return LOOKS[place % count][0], *LOOKS[(place + place // count) % count][1:]


def places(place: int, count: int) -> Vector:
    """Fractions of a curve where the run in this place of so many has its markers.

    Those of one run stand midway between those of others, so that equal curves show all of them.
    """
    if count == 1:
        return np.linspace(0.0, 1.0, ALONE)
    marks = min(max(MARKS // count, FEWEST), MOST)
    return np.asarray((np.arange(marks) + (place + 0.5) / count) / marks)


@contextmanager
def house_style() -> Iterator[None]:
    """matplotlib's settings as in podusv.mplstyle, for figures made inside."""
    with mpl.rc_context():
        mpl.rcdefaults()
        settings = mpl.rc_params_from_file(
            Path(__file__).with_name("podusv.mplstyle"), use_default_template=False
        )
        mpl.rcParams.update(settings)
        yield


def new_figure(columns: int, height: float) -> Figure:
    """An empty figure, `columns` journal columns wide and `height` inches high, without pyplot."""
    inside = (0.0, 0.0, 1.0 - OVERHANG / WIDTHS[columns], 1.0)
    layout = ConstrainedLayoutEngine(rect=inside)
    figure = Figure(figsize=(WIDTHS[columns], height), layout=layout)
    FigureCanvasAgg(figure)
    return figure


def about(runs: Sequence[Shown], name: str) -> Signal:
    """What a signal is, by the first of the runs that have it, else as podusv derives it."""
    having = [run for run in runs if run.has(name)]
    if not having:
        return derived.DERIVED[name].signal
    return derived.about(having[0].recording, name, having[0].scenario.plugged)


def axis_label(runs: Sequence[Shown], name: str) -> str:
    """Symbol and unit of a signal as an axis shows them."""
    return label(about(runs, name))


def label(signal: Signal) -> str:
    """Symbol and unit of a signal."""
    return f"${signal.symbol}$ [{unit(signal)}]"


def unit(signal: Signal) -> str:
    """Unit of a signal with its powers raised."""
    return quantities.raised(signal.unit)


def legend(figure: Figure, columns: int, thin: str = "") -> None:
    """Every name in any panel once, above all panels; `thin` says what the thin curves are."""
    found = {
        label: handle
        for axes in figure.axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    if thin:
        found[thin] = Line2D([], [], color="#444444", linewidth=0.5)
    width = sum(HANDLE_WIDTH + LETTER_WIDTH * len(label) for label in found)
    rows = math.ceil(width / WIDTHS[columns])
    each = math.ceil(len(found) / rows) if found else 1
    figure.legend(list(found.values()), list(found), loc="outside upper center", ncols=each)


def image(figure: Figure, form: str) -> bytes:
    """The figure as a file's content: png, pdf or svg, the same bytes for the same figure."""
    _settle(figure)
    buffer = io.BytesIO()
    if form == "png":  # `savefig` would draw twice
        FigureCanvasAgg(figure).print_png(buffer, metadata=NO_STAMP[form])  # type: ignore[no-untyped-call]
    else:
        figure.savefig(buffer, format=form, metadata=NO_STAMP[form])
    return buffer.getvalue()


class _PlainTicks(ScalarFormatter):
    """Numbers at ticks as plain text; set as formulas, they take a quarter of the drawing time."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        return super().__call__(x, pos).removeprefix(r"$\mathdefault{").removesuffix("}$")


def _settle(figure: Figure) -> None:
    """Lay the figure out once and for all; saving alone would go through all its text twice."""
    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
        if type(axis.get_major_formatter()) is ScalarFormatter:
            axis.set_major_formatter(_PlainTicks())
    layout = figure.get_layout_engine()
    if layout:
        layout.execute(figure)
    figure.set_layout_engine("none")
