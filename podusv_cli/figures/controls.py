"""Control inputs: early peak, whole run and settled part, the paper's figures 5 to 7."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from podusv_cli.figures.curves import Span, compress, differ, draw_signal
from podusv_cli.figures.panels import PEAKS, TIME
from podusv_cli.figures.sheet import figure
from podusv_cli.figures.style import Shown, axis_label, legend, new_figure

EARLY = 0.005  # of the run: where the peaks are
EARLY_ROWS = 20  # at least
LOADS = (("tau_u", "tau_u_cmd"), ("tau_r", "tau_r_cmd"))


@figure(
    "controls", place=3, signals=("tau_u", "tau_r"), source="the paper's figures 5 to 7",
    caption="surge force and yaw moment on the hull, thin what the law asked for: the first "
    "moments, the whole run, the settled part" + PEAKS,
)  # fmt: skip
def controls(runs: Sequence[Shown], columns: int) -> Figure:
    """Surge force and yaw moment: what acts on the hull, and thin what the law asked for."""
    wide = columns == 2
    figure = new_figure(columns, 3.6 if wide else 4.9)
    spans = _spans(runs)
    shape = (len(LOADS), len(spans)) if wide else (len(spans), len(LOADS))
    panels = figure.subplots(*shape, sharex="col" if wide else "row")
    for place, names in enumerate(LOADS):
        loads = panels[place] if wide else panels[:, place]
        for axes, (part, span) in zip(loads, spans.items(), strict=True):
            _panel(axes, runs, names, span)
            if not wide:
                axes.set_title(f"{axis_label(runs, names[0])}, {part}")
            elif place == 0:
                axes.set_title(part)
        if wide:
            loads[0].set_ylabel(axis_label(runs, names[0]))
    for axes in panels[-1]:
        axes.set_xlabel(TIME)
    limited = any(differ(run, *names) for run in runs for names in LOADS)
    legend(figure, columns, "asked for by the law" if limited else "")
    return figure


def _spans(runs: Sequence[Shown]) -> dict[str, Span]:
    """Names and limits [s] of the parts to show."""
    end = max(run.end for run in runs)
    period = min(float(run.recording["time"][1]) for run in runs)
    settled = min(run.steady_from for run in runs)
    return {
        "early": (0.0, min(end, max(EARLY * end, EARLY_ROWS * period))),
        "whole run": (0.0, end),
        "settled": (settled if settled < end else 0.0, end),
    }


def _panel(axes: Axes, runs: Sequence[Shown], names: tuple[str, str], span: Span) -> None:
    applied, asked = names
    draw_signal(axes, runs, asked, span=span, beside=applied)
    draw_signal(axes, runs, applied, span=span)
    axes.set_xlim(*span)
    compress(axes, runs, applied)
