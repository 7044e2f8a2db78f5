"""Draw what each law does: the pictures of docs/laws/, one a page.

python examples/law_figures.py docs/images/laws [PAGE]...

Each picture has runs of a shipped scenario: the tracks, and the distance to the target or path.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

import podusv
from podusv_cli.figures.looks import TARGET_LOOK, nth_style
from podusv_cli.figures.style import house_style, image, new_figure

# The scenario of a page's picture, and the laws of it that are drawn.
SHOWN = {
    "adaptive_neural": ("laws/rivals", ("adaptive_neural", "dsc", "adaptive_crab_tuned")),
    "pid": ("laws/rivals", ("pid", "pid_published")),
    "velocity_vector": ("laws/rivals", ("velocity_vector", "los_pid")),
    "momentum_vector": ("laws/momentum", ("velocity_vector", "momentum_vector")),
    "hand_position": ("laws/rivals", ("hand_position", "adrc")),
    "sliding_mode": ("laws/rivals", ("sliding_mode", "super_twisting")),
    "los_pid": ("laws/legs", ("los_pid", "velocity_vector")),
    "alos": ("laws/legs", ("alos", "ilos")),
    "cascade": ("lefeber_2003/circle", ("cascade", "about_target")),
    "los_backstepping": ("fossen_2003/course", ("paper", "one_length")),
    "ardupilot": ("laws/autopilots", ("ardupilot", "px4")),
    "mss": ("laws/autopilots", ("mss_alos", "mss_ilos")),
    "policy": ("laws/learned", ("policy", "velocity_vector")),
}
LEAST = 1e-4  # m, the lower end of the axis of errors


def error(run: podusv.Run) -> tuple[np.ndarray, str]:
    """The distance that the law makes small, and what the axis calls it."""
    if "z_e" in run.past.recording.signals:
        return run["z_e"], "distance to target [m]"
    return np.abs(run["e_ct"]), "distance to leg [m]"


def draw(panels: tuple[Axes, Axes], runs: dict[str, podusv.Run]) -> None:
    """Tracks from above on the left, errors over time on the right."""
    tracks, errors = panels
    for place, (name, run) in enumerate(runs.items()):
        color, linestyle, _ = nth_style(place)
        if not place and "y_d" in run.past.recording.signals:
            tracks.plot(run["y_d"], run["x_d"], zorder=0, label="target", **TARGET_LOOK)
        tracks.plot(run["y"], run["x"], color=color, linestyle=linestyle, label=name)
        distance, label = error(run)
        errors.semilogy(run["time"], np.maximum(distance, LEAST), color=color, linestyle=linestyle)
        errors.set(xlabel="time [s]", ylabel=label)
    tracks.set(xlabel="y, east [m]", ylabel="x, north [m]")
    tracks.set_aspect("equal", adjustable="datalim")
    tracks.legend(fontsize=6.5)


def main() -> None:
    """Draw the pictures of the pages that are named, else of all."""
    folder, pages = Path(sys.argv[1]), sys.argv[2:] or SHOWN
    for page in pages:
        shown, laws = SHOWN[page]
        singles = podusv.load(f"podusv:{shown}.yaml").singles()
        with house_style():
            figure = new_figure(2, 2.4)
            draw(figure.subplots(1, 2), {law: podusv.simulate(singles[law]) for law in laws})
            (folder / f"{page}.png").write_bytes(image(figure, "png"))


if __name__ == "__main__":
    main()
