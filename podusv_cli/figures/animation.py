"""The vessels chasing their target, as an animated picture."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.patches import Polygon
from PIL import Image

from podusv_cli.figures.page import Page
from podusv_cli.figures.shown import Shown
from podusv_cli.figures.style import house_style, legend
from podusv_cli.figures.tracks import bounds, targets
from podusv_cli.figures.trajectory import enlargement, hull_of, map_axes

FILE = "animation.gif"
FRAMES = 120
FRAME_MS = 80
SIZE = 4.0  # inches
DPI = 110
STRIDE = 10  # rows between points of a track
PALE = 0.25


def animate(runs: Sequence[Shown]) -> bytes:
    """A GIF: tracks grow, hulls (enlarged) and targets move; same runs, same bytes."""
    with house_style():
        figure = Page(figsize=(SIZE, SIZE), dpi=DPI)
        canvas = FigureCanvasAgg(figure)
        move = stage(figure.add_subplot(), runs)
        legend(figure)
        frames = []
        for t in frame_times(runs):
            move(t)
            canvas.draw()  # type: ignore[no-untyped-call]
            pixels = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
            picture = Image.fromarray(pixels).convert("RGB")
            frames.append(picture.quantize(colors=64, dither=Image.Dither.NONE))
    buffer = io.BytesIO()
    frames[0].save(
        buffer, "GIF", save_all=True, append_images=frames[1:], duration=FRAME_MS, loop=0
    )
    return buffer.getvalue()


def frame_times(runs: Sequence[Shown]) -> list[float]:
    """The instants [s] that are shown, from the start to the end of the longest run."""
    return [
        float(t)
        for t in np.linspace(min(run.start for run in runs), max(run.end for run in runs), FRAMES)
    ]


def stage(axes: Axes, runs: Sequence[Shown]) -> Callable[[float], None]:
    """Draw what stands still; the function moves the rest to a time [s].

    A run that has ended stays where it is, its hull pale.
    """
    chased = [
        (
            target.recording,
            axes.plot([], [], "o", color=target.line_style["color"], markersize=4)[0],
        )
        for target in targets(runs)
        if target.is_ahead
    ]
    for target in (target for target in targets(runs) if target.in_sight):
        axes.plot(*target.track(), **target.line_style)
    scale = enlargement(runs)
    tracks = [axes.plot([], [], **run.line_style)[0] for run in runs]
    hulls = [Polygon(np.zeros((5, 2)), color=run.color) for run in runs]
    for outline in hulls:
        axes.add_patch(outline)
    map_axes(axes, *bounds(runs))

    def move(t: float) -> None:
        axes.set_title(f"t = {t:5.1f} s, hulls {scale:.0f} times as large")
        for run, track, outline in zip(runs, tracks, hulls, strict=True):
            log, row = run.recording, run.row(t)
            rows = np.append(np.arange(0, row, STRIDE), row)
            track.set_data(log["y"][rows], log["x"][rows])
            outline.set_xy(hull_of(run, t, scale))
            outline.set_alpha(1.0 if t <= run.end else PALE)
        for log, dot in chased:
            row = min(int(np.searchsorted(log["time"], t)), len(log["time"]) - 1)
            dot.set_data([log["y_d"][row]], [log["x_d"][row]])

    return move
