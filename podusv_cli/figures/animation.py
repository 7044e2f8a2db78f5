"""The vessels chasing their target, as an animated picture."""

from __future__ import annotations

import io
import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

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

GIF, MP4 = "animation.gif", "animation.mp4"
# About ten seconds in all, however long the run is.
FRAMES = 120
FRAME_MS = 80
SIZE = 7.0, 4.0  # inches
DPI = 110
STRIDE = 10  # rows between points of a track
NEAR = 12.0  # lengths, the close-up's width
PALE = 0.25
# Raw pictures in, H.264 out that every browser plays; the same bytes for the same pictures.
ENCODE = (
    "-i",
    "-",
    "-c:v",
    "libx264",
    "-pix_fmt",
    "yuv420p",
    "-threads",
    "1",
    "-map_metadata",
    "-1",
    "-fflags",
    "+bitexact",
    "-flags:v",
    "+bitexact",
    "-movflags",
    "+faststart",
)


def file_name() -> str:
    """MP4 where ffmpeg is there to make it, else GIF."""
    return MP4 if shutil.which("ffmpeg") else GIF


def animate(runs: Sequence[Shown], name: str) -> bytes:
    """The film, as the file of this name holds it: tracks grow, hulls and targets move.

    On a map, where hulls are enlarged, and close up about the first target. The same runs give the
    same bytes. Raises CalledProcessError where ffmpeg fails.
    """
    return _mp4(_frames(runs)) if name == MP4 else _gif(_frames(runs))


def _frames(runs: Sequence[Shown]) -> Iterator[Image.Image]:
    """The pictures of an animation: the whole track on the left, the hull near on the right."""
    with house_style():
        figure = Page(figsize=SIZE, dpi=DPI)
        canvas = FigureCanvasAgg(figure)
        whole, near = figure.subplots(1, 2)
        moves = [draw_scene(whole, runs), draw_scene(near, runs, near=True)]
        legend(figure)
        for t in frame_times(runs):
            for move in moves:
                move(t)
            canvas.draw()  # type: ignore[no-untyped-call]
            yield Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")  # type: ignore[no-untyped-call]


def _gif(frames: Iterator[Image.Image]) -> bytes:
    """The pictures as a GIF that repeats without end, with 64 colours each to keep it small."""
    first, *rest = (frame.quantize(colors=64, dither=Image.Dither.NONE) for frame in frames)
    buffer = io.BytesIO()
    first.save(buffer, "GIF", save_all=True, append_images=rest, duration=FRAME_MS, loop=0)
    return buffer.getvalue()


def _mp4(frames: Iterator[Image.Image]) -> bytes:
    """The pictures as an MP4 film, by ffmpeg. Raises CalledProcessError."""
    pictures = list(frames)
    size = "x".join(map(str, pictures[0].size))
    raw = ("-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", str(1000 / FRAME_MS))
    # ffmpeg cannot write such a film into a pipe.
    with TemporaryDirectory() as folder:  # its index is written last, at the beginning
        place = Path(folder, MP4)
        subprocess.run(
            ["ffmpeg", "-loglevel", "error", *raw, *ENCODE, str(place)],
            input=b"".join(picture.tobytes() for picture in pictures),
            check=True,
            capture_output=True,
        )
        return place.read_bytes()


def frame_times(runs: Sequence[Shown]) -> list[float]:
    """The instants [s] that are shown, from the start to the end of the longest run."""
    return [
        float(t)
        for t in np.linspace(min(run.start for run in runs), max(run.end for run in runs), FRAMES)
    ]


def draw_scene(axes: Axes, runs: Sequence[Shown], *, near: bool = False) -> Callable[[float], None]:
    """Draw what stands still on `axes`, and return a function that moves the rest to a time [s].

    A run that has ended stays where it is, its hull pale. With `near`, the map goes with the first
    moving target, or the first run where there is none, and hulls are to scale.
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
    scale = 1.0 if near else enlargement(runs)
    reach = 0.5 * NEAR * max(run.length for run in runs)
    followed = chased[0][0] if chased else runs[0].recording
    place = ("y_d", "x_d") if chased else ("y", "x")
    tracks = [axes.plot([], [], **run.line_style)[0] for run in runs]
    # A hull has five corners; they are moved in each frame.
    hulls = [Polygon(np.zeros((5, 2)), color=run.color) for run in runs]
    for outline in hulls:
        axes.add_patch(outline)
    map_axes(axes, *bounds(runs))

    def move(t: float) -> None:
        """Put hulls and tracks where they are at time `t` [s]."""
        if near:
            row = min(int(np.searchsorted(followed["time"], t)), len(followed["time"]) - 1)
            east, north = (float(followed[name][row]) for name in place)
            # `auto=None`: equal scales may widen these limits; of fixed ones matplotlib would warn.
            axes.set_xlim(east - reach, east + reach, auto=None)
            axes.set_ylim(north - reach, north + reach, auto=None)
        words = "hulls to scale" if near else f"hulls {scale:.0f} times as large"
        axes.set_title(f"t = {t:5.1f} s, {words}")
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
