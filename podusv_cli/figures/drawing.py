"""Which figures there are, and drawing them into files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

from matplotlib.figure import Figure

from podusv_cli.figures.controls import controls
from podusv_cli.figures.errors import errors
from podusv_cli.figures.style import LOOKS, Shown, house_style, image
from podusv_cli.figures.trajectory import trajectory
from podusv_cli.recording import Recording

FIGURES: dict[str, Callable[[Sequence[Shown], int], Figure]] = {
    "trajectory": trajectory,
    "errors": errors,
    "controls": controls,
}


def dressed(
    runs: Sequence[tuple[str, Recording]], *, length: float, beam: float, steady_fraction: float
) -> list[Shown]:
    """Recordings with their looks, in order."""
    return [
        Shown(
            label, recording, *LOOKS[i % len(LOOKS)], length=length, beam=beam,
            steady_from=(1.0 - steady_fraction) * float(recording["time"][-1]),
        )
        for i, (label, recording) in enumerate(runs)
    ]  # fmt: skip


def draw(
    runs: Sequence[Shown], names: Iterable[str], formats: Iterable[str], columns: int = 2
) -> Iterator[tuple[str, bytes]]:
    """File name and content of each figure in each format."""
    formats = tuple(formats)
    with house_style():
        for name in names:
            figure = FIGURES[name](runs, columns)
            for form in formats:
                yield f"{name}.{form}", image(figure, form)
