"""The figure at the top of results/claim.md: networks beside fixed gains, and what differs.

    python examples/reproduce/network_line.py TABLE.csv FIGURE.png

Left: the settled error of the surge velocity over the gain that a network acts as. Right: the
sensitivity |S| of the surge loop at the plant's input, of the paper's law and of the equal gain.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from podusv_cli.figures.looks import TARGET_LOOK, nth_style
from podusv_cli.figures.style import house_style, image, new_figure
from podusv_cli.scenario.load import load
from podusv_cli.theory.loop_margins import loop_margins

CORRECTED = Path(__file__).parents[2] / "configs/mu_2017/corrected.yaml"
FIXED = "controller={kind: adaptive_neural, Gamma_u: 0, Gamma_r: 0, gamma_u: 0, gamma_r: 0, "
LAWS = {"network of 27 nodes": (), "fixed gain 13 208 kg/s": (FIXED + "k_ue: 13208, k_re: 191}",)}


def errors(axes: Axes, table: pd.DataFrame) -> None:
    """Settled velocity error over gain, a sign for each size of network, a line for fixed gains."""
    gains = np.array([300.0, 60_000.0])
    error = table.loc[0, "product"].median()  # N, of the fixed gains
    axes.loglog(gains, 1e3 * error / gains, label=f"{error:.3f} N / gain", **TARGET_LOOK)
    for place, (nodes, rows) in enumerate(table.groupby("nodes")):
        color, _, marker = nth_style(place)
        label = f"{nodes} nodes, sigma_u 0.03 to 3" if nodes else "fixed gains"
        axes.loglog(rows.gain, 1e3 * rows.rms_u_e, marker, color=color, ms=4, label=label)
    axes.set(xlabel="gain [kg/s]", ylabel="settled rms of u_e [mm/s]", title="15 networks")
    axes.legend(fontsize=6.5)


def sensitivities(axes: Axes) -> None:
    """|S| of the surge loop."""
    for place, (label, overrides) in enumerate(LAWS.items()):
        color, linestyle, _ = nth_style(place)
        scenario = load(CORRECTED, overrides).scenario
        loop = loop_margins(scenario.closed_loop(), scenario.time_grid()).loops["surge"]
        axes.loglog(loop.omega, loop.S, color=color, linestyle=linestyle, label=label)
    axes.axhline(1.0, zorder=0, **TARGET_LOOK)
    axes.set(xlabel="angular frequency [rad/s]", ylabel="|S|", ylim=(1e-4, 20), xlim=(1e-2, 1e4))
    axes.set_title("surge loop")
    axes.legend(fontsize=6.5)


def main() -> None:
    """Draw both panels."""
    table, place = pd.read_csv(sys.argv[1], index_col="nodes"), Path(sys.argv[2])
    with house_style():
        figure = new_figure(2, 2.9)
        left, right = figure.subplots(1, 2)
        errors(left, table)
        sensitivities(right)
        place.write_bytes(image(figure, "png"))


if __name__ == "__main__":
    main()
