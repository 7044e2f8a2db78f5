"""Figures of studies, searches and benches: each a name, a caption, and what draws it.

Import this module where a figure is drawn, because matplotlib is slow to import.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from podusv_cli.figures.page import Page
from podusv_cli.figures.style import house_style, image
from podusv_cli.pages.page import Picture
from podusv_cli.process.extras import Extras, Failure
from podusv_cli.process.interrupts import interrupts_enabled
from podusv_cli.process.workers import run_shares

COLUMNS = 2  # of a journal page, in width
ON_PHONE = 4.5  # inches; drawn so wide, text can be read in a window of 400 pixels


@dataclass(frozen=True)
class Sketch:
    """A figure that is still to be drawn: its file's name, its caption, and what draws it."""

    name: str
    caption: str
    draw: Callable[[], Figure]


def render_sketches(
    sketches: Iterable[Sketch], extras: Extras
) -> tuple[dict[str, bytes], list[Picture]]:
    """PNG pictures of figures, drawn in processes of their own: by file name, and for a report.

    A figure that cannot be drawn is noted in `extras`, and so is an interrupt.
    """
    files: dict[str, bytes] = {}
    pictures: list[Picture] = []
    wanted = extras.make_or_record("the list of figures", lambda: list(sketches)) or []
    outcomes = (
        () if extras.interrupted else run_shares([partial(_images, sketch) for sketch in wanted])
    )
    # After an interrupt there are no outcomes, and nothing is paired.
    for sketch, outcome in zip(wanted, outcomes, strict=bool(outcomes)):
        extras.interrupted |= outcome.interrupted
        if outcome.result:
            whole, phone = outcome.result
            files[f"{sketch.name}.png"] = whole
            pictures.append(Picture(sketch.name, sketch.caption, whole, phone=phone))
        elif not outcome.interrupted:
            extras.missing.append(Failure(f"figure {sketch.name}", outcome.failure))
    return files, pictures


def _images(sketch: Sketch, tell: Callable[[float], None]) -> tuple[bytes, bytes]:
    """The figure as a PNG, and as one for a phone where its panels fit there, else b""."""
    with interrupts_enabled(), house_style(), np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of numbers near the end of all, as diverged runs have
        figure = sketch.draw()
        whole = image(figure, "png")
        narrow = isinstance(figure, Page) and figure.narrow(ON_PHONE)
        return whole, image(figure, "png") if narrow else b""
