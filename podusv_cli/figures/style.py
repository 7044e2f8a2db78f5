"""The look that all figures share: sizes, colours, line styles, labels, legend, saving."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image

from podusv_cli.core import quantities
from podusv_cli.core.signal import Signal
from podusv_cli.figures.page import Page
from podusv_cli.figures.shown import Shown
from podusv_cli.theory import derived

FORMATS = ("png", "pdf", "svg")
WIDTHS = {1: 3.46, 2: 7.09}  # inches: one column and two columns of a journal page
COLOURS = 256  # of a PNG; a curve and its soft edge take about ten, and the file a third

NO_STAMP: dict[str, dict[str, Any]] = {
    "pdf": {"CreationDate": None, "Producer": None, "Creator": None},
    "svg": {"Date": None, "Creator": None},
}


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


def new_figure(columns: int, height: float) -> Page:
    """An empty figure, `columns` journal columns wide and `height` inches high, without pyplot."""
    figure = Page(figsize=(WIDTHS[columns], height))
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


def legend(figure: Page, thin: str = "") -> None:
    """Every name in any panel once, above all panels; `thin` says what the thin curves are."""
    found = {
        label: handle
        for axes in figure.axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    if thin:
        found[thin] = Line2D([], [], color="#444444", linewidth=0.5)
    if found:
        figure.add_key(list(found.values()), list(found))


def image(figure: Figure, form: str) -> bytes:
    """The figure as a file's content: png, pdf or svg, the same bytes for the same figure."""
    buffer = io.BytesIO()
    if form != "png":
        figure.savefig(buffer, format=form, metadata=NO_STAMP[form])
        return buffer.getvalue()
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]
    drawn = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")  # type: ignore[no-untyped-call]
    few = drawn.quantize(COLOURS, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    palette = np.array(few.getpalette() or [], int).reshape(-1, 3)
    palette[np.asarray(few)[0, 0]] = 255  # the ground, else a mean with the palest edges
    few.putpalette(palette.ravel().tolist())
    few.save(buffer, "png", dpi=(figure.dpi, figure.dpi))
    return buffer.getvalue()
