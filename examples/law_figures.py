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
from podusv_cli.core.kernel import Vector
from podusv_cli.core.past_run import PastRun
from podusv_cli.core.recording import Recording
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
    "pose_pid": ("dp/four_corners", ("pid", "pd")),
    "pose_backstepping": ("dp/four_corners", ("backstepping", "backstepping_plain")),
    "pose_sliding_mode": ("dp/four_corners", ("sliding_mode", "backstepping_plain")),
    "maneuvering": ("skjetne_2005/limits", ("gradient", "tracking")),
    "policy": ("laws/learned", ("policy", "velocity_vector")),
}
LEAST = 1e-4  # m, the lower end of the axis of errors


def error(log: Recording) -> tuple[Vector, str]:
    """The distance that the law makes small [m], and what the axis calls it."""
    if "z_e" in log.signals:
        return log["z_e"], "distance to target [m]"
    return np.abs(log["e_ct"]), "distance to leg [m]"


def reference(run: PastRun) -> tuple[str, Vector]:
    """What a run is to follow, its name and its points [m]: the legs, or the target's track."""
    if run.about.follows:
        return "legs", np.array(run.about.waypoints)
    log = run.counted_recording
    return "target", np.column_stack([log["x_d"], log["y_d"]])


def draw(panels: tuple[Axes, Axes], runs: dict[str, PastRun]) -> None:
    """Tracks from above on the left, errors over time on the right, up to the path's end."""
    tracks, errors = panels
    name, points = reference(next(iter(runs.values())))
    tracks.plot(points[:, 1], points[:, 0], zorder=0, label=name, **TARGET_LOOK)
    for place, (law, run) in enumerate(runs.items()):
        log, (color, linestyle, _) = run.counted_recording, nth_style(place)
        tracks.plot(log["y"], log["x"], color=color, linestyle=linestyle, label=law)
        distance, label = error(log)
        errors.semilogy(log["time"], np.maximum(distance, LEAST), color=color, linestyle=linestyle)
        errors.set(xlabel="time [s]", ylabel=label)
    tracks.set(xlabel="y, east [m]", ylabel="x, north [m]")
    if np.ptp(points, axis=0).min() > 0.0:
        tracks.set_aspect("equal", adjustable="datalim")
    else:  # along a line all that happens is across it
        tracks.set_title("not to scale", fontsize=6.5)
    tracks.legend(fontsize=6.5)


def main() -> None:
    """Draw the pictures of the pages that are named, else of all."""
    folder, pages = Path(sys.argv[1]), sys.argv[2:] or SHOWN
    for page in pages:
        shown, laws = SHOWN[page]
        singles = podusv.load(f"podusv:{shown}.yaml").singles()
        with house_style():
            figure = new_figure(2, 2.4)
            draw(figure.subplots(1, 2), {law: podusv.simulate(singles[law]).past for law in laws})
            (folder / f"{page}.png").write_bytes(image(figure, "png"))


if __name__ == "__main__":
    main()
