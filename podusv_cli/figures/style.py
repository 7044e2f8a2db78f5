"""The look that all figures share: sizes, style files, legend, saving."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image

from podusv_cli.figures.page import Page

FORMATS = ("png", "pdf", "svg")
WIDTHS = {1: 3.46, 2: 7.09}  # inches: one column and two columns of a journal page
INCH = 25.4  # millimetres
COLOURS = 256  # of a PNG; a curve and its soft edge take about ten, and the file a third

NO_STAMP: dict[str, dict[str, Any]] = {
    "pdf": {"CreationDate": None, "Producer": None, "Creator": None},
    "svg": {"Date": None, "Creator": None},
}


class Style(NamedTuple):
    """Style files, each on top of those before it, and the widths of a page's columns [inches]."""

    files: tuple[str, ...]
    widths: Mapping[int, float] = WIDTHS


PRINTED = ("podusv", "paper")
STYLES = {
    "podusv": Style(("podusv",)),
    "paper": Style(PRINTED),
    # as the publishers' guides for authors ask for
    "ieee": Style(PRINTED, {1: 3.5, 2: 7.16}),
    "elsevier": Style(PRINTED, {1: 90.0 / INCH, 2: 190.0 / INCH}),
}


@dataclass(frozen=True)
class Look:
    """Width in columns of a page, a size [inches] in place of that, and a style.

    Without a height figures have the height of their contents.
    """

    columns: int = 2
    width: float | None = None
    height: float | None = None
    style: Style = STYLES["podusv"]

    def given_to(self, figure: Figure) -> Figure:
        """The figure, resized if it is a page and the look has a size of its own."""
        width = self.width or self.style.widths[self.columns]
        if isinstance(figure, Page) and (width != figure.get_figwidth() or self.height):
            figure.resize(width, self.height or figure.get_figheight())
        return figure


@contextmanager
def house_style(style: Style = STYLES["podusv"]) -> Iterator[None]:
    """matplotlib's settings as in the style's files beside this module, for figures made inside."""
    with mpl.rc_context():
        # as mpl.rcdefaults(), which reads all style sheets of matplotlib for it
        mpl.rcParams.update({k: v for k, v in mpl.rcParamsDefault.items() if k != "backend"})
        for name in style.files:
            place = Path(__file__).with_name(f"{name}.mplstyle")
            mpl.rcParams.update(mpl.rc_params_from_file(place, use_default_template=False))
        yield


def new_figure(columns: int, height: float) -> Page:
    """An empty figure, `columns` journal columns wide and `height` inches high, without pyplot."""
    figure = Page(figsize=(WIDTHS[columns], height))
    FigureCanvasAgg(figure)
    return figure


def remark(axes: Axes, text: str) -> None:
    """A line of text in the middle of a panel that has nothing to draw."""
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color="#444444")
    axes.set(xticks=[], yticks=[])


def legend(figure: Page, thin: str = "", held: Mapping[str, str] = MappingProxyType({})) -> None:
    """Put every name in any panel once into a legend above all panels.

    `thin` says what the thin curves are. `held` are the `constants` without a panel, below.
    """
    handles = {
        label: handle
        for axes in figure.axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    if thin:
        handles[thin] = Line2D([], [], color="#444444", linewidth=0.5)
    if handles:
        figure.add_key(list(handles.values()), list(handles))
    if held:
        figure.add_line(f"constant: {'; '.join(held.values())}")


def image(figure: Figure, form: str) -> bytes:
    """The figure as a file's content: png, pdf or svg, the same bytes for the same figure."""
    buffer = io.BytesIO()
    if form != "png":
        figure.savefig(buffer, format=form, metadata=NO_STAMP[form])
        return buffer.getvalue()
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]
    drawn = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")  # type: ignore[no-untyped-call]
    # A palette makes the file a third; the same figure gives the same bytes.
    few = drawn.quantize(COLOURS, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    palette = np.array(few.getpalette() or [], int).reshape(-1, 3)
    palette[np.asarray(few)[0, 0]] = 255  # the ground, else a mean with the palest edges
    few.putpalette(palette.ravel().tolist())
    few.save(buffer, "png", dpi=(figure.dpi, figure.dpi))
    return buffer.getvalue()
