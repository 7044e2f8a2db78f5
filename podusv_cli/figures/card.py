"""A picture of 1200 x 630 to share: where the runs part, their distances, and what is claimed."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

from podusv_cli.core import escaping
from podusv_cli.figures.page import EDGE, Page
from podusv_cli.figures.shown import Shown, shortened
from podusv_cli.figures.style import house_style, image, legend
from podusv_cli.figures.trajectory import close_up, distances, views

FILE = "card.png"
SIZE = 6.0, 3.15  # inches, at 200 points an inch
TITLE, TEXT, SMALL = 10.0, 7.5, 5.5  # points
LINE = 0.14  # inches
LETTERS = {TITLE: 62, TEXT: 84, SMALL: 120}  # in a line


@dataclass(frozen=True)
class Words:
    """What a card says: its title, a claim with verdict and numbers, and where it is from."""

    title: str
    claim: str = ""
    verdict: str = ""
    numbers: str = ""
    origin: str = ""


def card(runs: Sequence[Shown], words: Words) -> bytes:
    """The card as PNG; the same runs and words give the same bytes."""
    with house_style():
        return image(figure(runs, words), "png")


def figure(runs: Sequence[Shown], words: Words) -> Page:
    """The card as a figure."""
    page = Page(figsize=SIZE)
    cells = page.add_gridspec(1, 2, width_ratios=(1.0, 1.4))
    view = views(runs)[0]
    close_up(page.add_subplot(cells[0, 0]), view, runs)
    distances(page.add_subplot(cells[0, 1]), [run for run in runs if run in view.target.runs])
    legend(page)
    _frame(page, words)
    return page


def _frame(figure: Page, words: Words) -> None:
    """The title above the legend, the claim and its origin below the panels."""
    width, height = SIZE
    above = 2.0 * LINE
    for key in figure.legends:
        key.set_bbox_to_anchor((0.5, 1.0 - (above + EDGE) / height))
    figure.head += above
    figure.text(
        2.0 * EDGE / width, 1.0 - 2.0 * EDGE / height, _cut(words.title, TITLE), va="top",
        fontsize=TITLE, fontweight="bold",
    )  # fmt: skip
    claim = textwrap.wrap(f"{words.verdict}: {words.claim}", LETTERS[TEXT]) if words.claim else []
    lines = [(line, TEXT, "bold" if not i else "normal") for i, line in enumerate(claim[:2])]
    lines += [(text, SMALL, "normal") for text in (words.numbers, words.origin) if text]
    for text, size, weight in reversed(lines):
        figure.text(
            2.0 * EDGE / width, (figure.foot + EDGE) / height, _cut(text, size), va="bottom",
            fontsize=size, fontweight=weight,
        )  # fmt: skip
        figure.foot += LINE


def _cut(text: str, size: float) -> str:
    """As much of a line as a card has room for."""
    return escaping.figure(shortened(" ".join(text.split()), LETTERS[size]))
