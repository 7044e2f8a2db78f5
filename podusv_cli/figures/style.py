"""The look that all figures share: sizes, colours, line styles, labels, thinning, saving."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter

from podusv_cli.config.scenario import Scenario
from podusv_cli.derived import DERIVED, Derived
from podusv_cli.kernels import Vector
from podusv_cli.recording import Recording
from podusv_cli.signals import SIGNALS

FORMATS = ("png", "pdf", "svg")
WIDTHS = {1: 3.46, 2: 7.09}  # inches: one column and two columns of a journal page

# Okabe and Ito's palette, with line styles that tell the curves apart in grey print too.
LOOKS: tuple[tuple[str, Any], ...] = (
    ("#0072B2", "-"),
    ("#D55E00", (0, (5, 1.5))),
    ("#009E73", (0, (1.2, 1.2))),
    ("#CC79A7", (0, (6, 1.5, 1.2, 1.5))),
    ("#56B4E9", (0, (3, 1, 1, 1, 1, 1))),
    ("#E69F00", (0, (9, 2))),
)
TARGET_LOOK: dict[str, Any] = {"color": "#444444", "linewidth": 0.8, "linestyle": "-"}
NO_STAMP: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "Producer": None, "Creator": None},
    "svg": {"Date": None, "Creator": None},
}


@dataclass(frozen=True)
class Shown:
    """A run with the name, colour and line style under which every figure shows it."""

    label: str
    recording: Recording
    scenario: Scenario
    color: str
    linestyle: Any

    @property
    def length(self) -> float:
        """Of the vessel [m]."""
        return self.scenario.vessel.length

    @property
    def beam(self) -> float:
        """Of the vessel [m]."""
        return self.scenario.vessel.beam

    @property
    def steady_from(self) -> float:
        """Start of the part that counts as settled [s]."""
        fraction = self.scenario.metrics.steady_fraction
        return (1.0 - fraction) * self.scenario.simulation.duration

    @property
    def look(self) -> dict[str, Any]:
        """Keyword arguments of `Axes.plot`."""
        return {"color": self.color, "linestyle": self.linestyle, "label": self.label}

    @property
    def whole(self) -> bool:
        """Whether the run reached its end."""
        return self.recording.status == "finished"

    def has(self, name: str) -> bool:
        """Whether the run has the signal, logged or derivable."""
        return all(part in self.recording for part in DERIVED.get(name, Derived((name,))).needs)

    def signal(self, name: str) -> Vector:
        """A logged or derived signal."""
        if name not in DERIVED:
            return self.recording[name]
        return DERIVED[name].compute(self.recording)


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
    figure = Figure(figsize=(WIDTHS[columns], height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def axis_label(name: str) -> str:
    """Symbol and unit of a signal as an axis shows them."""
    signal = SIGNALS[name]
    return f"${signal.symbol}$ [{signal.unit}]"


def thinned(t: Vector, y: Vector, points: int = 1500) -> tuple[Vector, Vector]:
    """At most about `points` samples that keep every extreme: the least and largest of each bin."""
    if len(t) <= points:
        return t, y
    edges = np.linspace(0, len(t), points // 2 + 1).astype(int)
    kept = {0, len(t) - 1}
    for low, high in pairwise(edges):
        kept |= {low + int(np.argmin(y[low:high])), low + int(np.argmax(y[low:high]))}
    chosen = np.array(sorted(kept))
    return t[chosen], y[chosen]


def draw_signal(
    axes: Axes, shown: Shown, name: str, *, between: tuple[float, float] | None = None, **look: Any
) -> None:
    """Plot a signal over time, or over a part of it [s]; does nothing where it was not logged."""
    if not shown.has(name):
        return
    t, y = shown.recording["time"], shown.signal(name)
    if between:
        inside = (t >= between[0]) & (t <= between[1])
        t, y = t[inside], y[inside]
    axes.plot(*thinned(t, y), **{**shown.look, **look})


def frame_finished(axes: Axes, runs: Sequence[Shown]) -> None:
    """Where only some runs finished, fit the vertical axis to those.

    A run that diverges leaves every scale; drawn to fit, it would hide all others.
    """
    labels = {run.label for run in runs if run.whole}
    values = [np.asarray(line.get_ydata()) for line in axes.lines if line.get_label() in labels]
    if not values or len(labels) == len(runs):
        return
    low, high = float(np.min(np.concatenate(values))), float(np.max(np.concatenate(values)))
    if axes.get_yscale() == "log":
        axes.set_ylim(low / 1.5, high * 1.5)
    else:
        margin = 0.05 * (high - low) or 1.0
        axes.set_ylim(low - margin, high + margin)


def image(figure: Figure, form: str) -> bytes:
    """The figure as a file's content: png, pdf or svg, the same bytes for the same figure."""
    _settle(figure)
    buffer = io.BytesIO()
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
