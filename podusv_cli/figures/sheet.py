"""A figure is one decorated function of runs and width, in a module of this package."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import wraps
from itertools import chain, product
from string import ascii_lowercase

from matplotlib.figure import Figure

from podusv_cli.figures.shown import Shown

Family = Callable[[Sequence[Shown], int], Figure]


@dataclass(frozen=True)
class Sheet:
    """A figure that podusv can draw: its name, what it shows, in words and in signals, its place.

    `family` draws it for some runs, so many columns of a page wide. `source` says where a figure
    of this kind was published, "" for nowhere.
    """

    name: str
    caption: str
    signals: tuple[str, ...]
    place: int
    family: Family
    source: str = ""

    def fits(self, runs: Sequence[Shown]) -> bool:
        """Whether any run has anything to show here."""
        return any(run.has(name) for run in runs for name in self.signals)


def figure(
    name: str, *, caption: str, signals: tuple[str, ...], place: int = 100, source: str = ""
) -> Callable[[Family], Sheet]:
    """Register a function that draws runs which have one of these `signals`, as a decorator.

    Figures are shown in the order of their `place`, those of one place by name.
    """
    return lambda family: Sheet(name, caption, signals, place, _letter_panels(family), source)


def _letter_panels(family: Family) -> Family:
    """The family with (a), (b), ... above its panels, ahead of titles on the left."""

    @wraps(family)
    def draw_lettered(runs: Sequence[Shown], columns: int) -> Figure:
        """The figure, with (a), (b), ... before the titles where it has several panels."""
        figure = family(runs, columns)
        if len(figure.axes) > 1:
            letters = chain(ascii_lowercase, map("".join, product(ascii_lowercase, repeat=2)))
            for axes, letter in zip(figure.axes, letters, strict=False):
                axes.set_title(f"({letter}) {axes.get_title(loc='left')}".rstrip(), loc="left")
        return figure

    return draw_lettered
