"""Virtual controls against what the filter makes of them, and the filter's error."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from podusv_cli.figures.curves import compress, draw_run, draw_signal
from podusv_cli.figures.panels import PEAKS, grid
from podusv_cli.figures.scales import scaling
from podusv_cli.figures.sheet import figure
from podusv_cli.figures.shown import Shown, about, axis_label, unit
from podusv_cli.figures.style import legend

PAIRS = (("alpha_u", "beta_u"), ("alpha_r", "beta_r"))
ERRORS = ("y_u", "y_r")


@figure(
    "filters",
    place=4,
    signals=("alpha_u", "alpha_r"),
    caption="virtual controls and the filter: thin what goes in, alpha of (21) and (30), thick"
    " what comes out, beta of (22) and (31); below, the filter's error y = beta - alpha" + PEAKS,
)
def filters(runs: Sequence[Shown], columns: int) -> Figure:
    """Virtual control thin behind the filter's output; below or beside, what lies between them.

    A law without a filter uses its virtual control as it is; that is drawn like an output.
    """
    filtered = any(run.has(name) for run in runs for name in ERRORS)
    figure, panels = grid(len(PAIRS) * (2 if filtered else 1), columns)
    for axes, (alpha, beta) in zip(panels, PAIRS, strict=False):
        draw_signal(axes, runs, alpha, beside=beta)
        for run in (run for run in runs if run.has(alpha)):
            used = run.during(beta if run.has(beta) else alpha, None)
            draw_run(axes, run, used, fitted=run in scaling(runs))
        names = [name for name in (alpha, beta) if any(run.has(name) for run in runs)]
        symbols = [about(runs, name).symbol for name in names]
        axes.set_ylabel(f"${', '.join(symbols)}$ [{unit(about(runs, alpha))}]")
        compress(axes, runs, alpha)
    for axes, error in zip(panels[len(PAIRS) :], ERRORS, strict=False):
        draw_signal(axes, runs, error)
        axes.set_ylabel(axis_label(runs, error))
        compress(axes, runs, error)
    legend(figure, "virtual control before the filter" if filtered else "")
    return figure
