"""Draw the gallery of docs/figures.md, a picture of each figure.

python examples/figure_gallery.py docs/images/figures [FIGURE]...

Below each picture the page has the command that draws it, at the resolution of print.
"""

from __future__ import annotations

import io
import sys
from dataclasses import replace
from pathlib import Path

from PIL import Image

import podusv
from podusv_cli.figures.drawing import FIGURES, draw
from podusv_cli.figures.shown import dress_runs

WIDEST, COLOURS = 760, 24  # pixels of a picture on the page, and its colours
LEARNED = ("mu_2017/corrected", "adaptive_neural")
# The shipped scenario whose run is drawn, and the law of it.
SHOWN = {
    "trajectory": ("demo", "momentum_vector"),
    "errors": ("mu_2017/corrected", "adaptive_neural"),
    "path": ("laws/legs", "alos"),
    "controls": ("mu_2017/figures", "adaptive_neural"),
    "filters": ("mu_2017/figures", "adaptive_neural"),
    "adaptation": LEARNED,
    "velocities": ("trials/zigzag_20", "zigzag"),
    "loads": LEARNED,
    "sea": ("sea/state_4", "velocity_vector"),
    "estimates": ("sea/sensors", "velocity_vector"),
    "spectrum": LEARNED,
    "stability": ("theory/monitor", "adaptive_neural"),
    "validity": ("theory/monitor", "adaptive_neural"),
    "pods": ("pod/kept", "pid"),
}


def command(name: str) -> str:
    """What draws this figure."""
    shown, law = SHOWN[name]
    several = podusv.load(f"podusv:{shown}.yaml").controllers
    chosen = f" --controller {law}" if several else ""
    return f"podusv run podusv:{shown}.yaml{chosen} --figure {name}"


def run_of(name: str) -> podusv.Run:
    """The run that a figure is drawn of."""
    shown, law = SHOWN[name]
    singles = podusv.load(f"podusv:{shown}.yaml").singles()
    return podusv.simulate(singles[law])


def shrink(picture: bytes) -> Image.Image:
    """A picture as a page shows it."""
    drawn = Image.open(io.BytesIO(picture)).convert("RGB")
    drawn.thumbnail((WIDEST, drawn.height))
    return drawn.quantize(COLOURS)


def main() -> None:
    """Draw the figures that are named, else all."""
    folder, names = Path(sys.argv[1]), sys.argv[2:] or SHOWN
    for name in names:
        run = replace(run_of(name).past, label=SHOWN[name][1])
        ((_, picture),) = draw(dress_runs([run]), [FIGURES[name]], ["png"])
        shrink(picture).save(folder / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main()
