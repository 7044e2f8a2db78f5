"""Figures 5, 6 and 7 of results/paper.md: force and moment of one law each, early and settled.

    python examples/reproduce/paper_figures.py

Reads the runs that `make reproduce` leaves in results/runs/, writes results/mu_2017/figure_N.png.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from podusv_cli.figures.looks import TARGET_LOOK, nth_style
from podusv_cli.figures.style import house_style, image, new_figure
from podusv_cli.storage.run_folder import open_run

RESULTS = Path(__file__).parents[2] / "results"
EARLY, LATE = 3.0, 20.0  # s: every peak is in the first three; the claims call 20 s early
DRAWN = {  # figure of the paper: comparison and law
    5: ("figures_compare", "adaptive_neural"),
    6: ("figures_compare_standoff", "full_backstepping"),
    7: ("figures_compare_standoff", "pid"),
}
SIGNALS = {"tau_u_cmd": r"$\tau_u$ [N]", "tau_r_cmd": r"$\tau_r$ [N m]"}


def draw(axes: tuple[Axes, Axes], time: np.ndarray, demand: np.ndarray, label: str) -> None:
    """One demand: its first seconds with the peak, and the settled part."""
    color = nth_style(0)[0]
    peak = int(np.argmax(np.abs(demand * (time <= EARLY))))
    for panel, shown in zip(axes, (time <= EARLY, time >= LATE), strict=True):
        panel.axhline(0.0, zorder=0, **TARGET_LOOK)
        panel.plot(time[shown], demand[shown], color=color, drawstyle="steps-post")
        panel.set(xlabel="time [s]", ylabel=label)
    axes[0].set_title(f"peak {demand[peak]:.4g} at {time[peak]:.3g} s", fontsize=7)
    axes[1].set_title(f"after {LATE:.0f} s", fontsize=7)


def main() -> None:
    """Draw the three figures."""
    for number, (comparison, law) in DRAWN.items():
        log = open_run(RESULTS / "runs/mu_2017" / comparison / law).recording
        with house_style():
            figure = new_figure(2, 1.9)
            panels = figure.subplots(1, 4)
            for place, (signal, label) in enumerate(SIGNALS.items()):
                draw(tuple(panels[2 * place : 2 * place + 2]), log["time"], log[signal], label)
            target = RESULTS / f"mu_2017/figure_{number}.png"
            target.write_bytes(image(figure, "png"))


if __name__ == "__main__":
    main()
