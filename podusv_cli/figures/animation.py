"""The vessels chasing their target, as an animated picture."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from PIL import Image

from podusv_cli.figures.style import TARGET_LOOK, Shown, house_style
from podusv_cli.figures.trajectory import bounds, enlargement, hull

FRAMES = 120
FRAME_MS = 80
SIZE = 4.0  # inches
DPI = 110


def animate(runs: Sequence[Shown]) -> bytes:
    """A GIF: tracks grow, hulls (enlarged) and target move; same runs, same bytes."""
    with house_style():
        figure = Figure(figsize=(SIZE, SIZE), dpi=DPI, layout="constrained")
        canvas = FigureCanvasAgg(figure)
        move = _stage(figure, runs)
        longest = max(float(run.recording["time"][-1]) for run in runs)
        frames = []
        for t in np.linspace(0.0, longest, FRAMES):
            move(float(t))
            canvas.draw()  # type: ignore[no-untyped-call]
            pixels = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
            picture = Image.fromarray(pixels).convert("RGB")
            frames.append(picture.quantize(colors=64, dither=Image.Dither.NONE))
    buffer = io.BytesIO()
    frames[0].save(
        buffer, "GIF", save_all=True, append_images=frames[1:], duration=FRAME_MS, loop=0
    )
    return buffer.getvalue()


def _stage(figure: Figure, runs: Sequence[Shown]) -> Callable[[float], None]:
    """Draw what stands still; the function moves the rest to a time [s]."""
    axes = figure.add_subplot()
    first = runs[0].recording
    axes.plot(first["y_d"], first["x_d"], **TARGET_LOOK, label="target")
    (target,) = axes.plot([], [], "o", color=TARGET_LOOK["color"], markersize=4)
    scale = enlargement(runs)
    tracks = [axes.plot([], [], **run.look)[0] for run in runs]
    hulls = [Polygon(np.zeros((5, 2)), color=run.color) for run in runs]
    for outline in hulls:
        axes.add_patch(outline)
    east, north = bounds(runs)
    axes.set_xlim(*east)
    axes.set_ylim(*north)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel("$y$ [m], east")
    axes.set_ylabel("$x$ [m], north")
    axes.legend(loc="best")

    def move(t: float) -> None:
        axes.set_title(f"t = {t:5.1f} s")
        for run, track, outline in zip(runs, tracks, hulls, strict=True):
            log = run.recording
            row = min(int(np.searchsorted(log["time"], t)), len(log["time"]) - 1)
            track.set_data(log["y"][: row + 1 : 10], log["x"][: row + 1 : 10])
            x, y, psi = (float(log[name][row]) for name in ("x", "y", "psi"))
            outline.set_xy(hull(x, y, psi, length=scale * run.length, beam=scale * run.beam))
        row = min(int(np.searchsorted(first["time"], t)), len(first["time"]) - 1)
        target.set_data([first["y_d"][row]], [first["x_d"][row]])

    return move
