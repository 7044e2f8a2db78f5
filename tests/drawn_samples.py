"""Runs made by hand, every signal a curve of its own, for tests of what figures show."""

from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from known_signals import ABOUT
from matplotlib.patches import Polygon

from podusv_cli.core.past_run import PastRun
from podusv_cli.core.recording import Recording
from podusv_cli.figures.drawing import FIGURES
from podusv_cli.figures.shown import dress_runs
from podusv_cli.figures.style import house_style
from podusv_cli.scenario.about import about_of
from podusv_cli.scenario.load import load_text

TEXT = """
name: {name}
vessel: {{preset: paper_nonlinear}}
path: {path}
disturbance: {{kind: harmonic}}
actuator: {actuator}
controller: {law}
metrics: {{steady_fraction: 0.25}}
simulation: {{duration: {duration}}}
"""
PLAIN = (
    "u",
    "v",
    "r",
    "psi_e",
    "tau_u",
    "tau_r",
    "tau_u_cmd",
    "tau_r_cmd",
    "b_u",
    "b_v",
    "b_r",
    "alpha_u",
    "alpha_r",
    "beta_u",
    "beta_r",
    "b_hat_u",
    "b_hat_r",
    "f_hat_u",
    "f_hat_r",
)
CENTER = np.array([[0.0, 0.0, 0.0], [1.0, 0.5, -0.5]])
WIDTH = np.array([0.5, 1.0, 2.0])


USUAL = {
    "path": "{kind: line_circle, rate: 0.03}",
    "actuator": "{kind: saturated}",
    "law": "{kind: pid}",
    "duration": 100.0,
}


@contextmanager
def no_figures_but(*names):
    """Only these figures: to draw them all takes its time."""
    whole = dict(FIGURES)
    for name in whole.keys() - {*names}:
        del FIGURES[name]
    try:
        yield
    finally:  # in their order
        FIGURES.clear()
        FIGURES.update(whole)


def scenario(name="drawn", **given):
    text = TEXT.format(name=name, **USUAL | given)
    return load_text(text, "drawn.yaml").scenario


def recording(end=100.0, period=0.1, status="finished", shift=0.0, without=(), **given):
    """A log up to `end` [s]; signals not given are sines, no two alike and none beyond 2."""
    t = np.arange(round(end / period) + 1) * period
    signals = {name: np.sin(0.1 * t + i + shift) + 0.03 * i for i, name in enumerate(PLAIN)}
    signals |= {"x": 0.45 * t - 5.0 + shift, "y": np.sin(0.05 * t) - shift, "psi": 0.02 * t + shift}
    signals |= {"x_d": 0.5 * t, "y_d": 2.0 * np.sin(0.03 * t), "z_e": 1.5 + 0.5 * np.cos(t)}
    signals["saturated"] = ((t >= 2.0) & (t < 5.0)) | ((t >= 30.0) & (t < 30.5))
    signals["W_hat_u"] = np.column_stack([np.sin(t + shift), np.cos(2.0 * t)])
    signals["W_hat_r"] = np.column_stack([np.sin(3.0 * t), 2.0 * np.cos(t + shift)])
    signals |= {name: values(t) if callable(values) else values for name, values in given.items()}
    kept = {n: np.asarray(s, dtype=float) for n, s in signals.items() if n not in without}
    fixed = {"rbf_center": CENTER, "rbf_width": WIDTH}
    return Recording(status, "pid", {"time": t} | kept, fixed, about=ABOUT)


def shown(*runs):
    """Recordings by label (with a scenario of their own, or the usual one) as figures take them."""
    usual = scenario()
    return dress_runs([looked_at(label, log, *(own or [usual])) for label, log, *own in runs])


def looked_at(label, log, plan):
    """A recording with its scenario as figures take them."""
    return PastRun(label, about_of(plan), log)


def drawn(name, runs, columns=2):
    with house_style():
        return FIGURES[name].family(runs, columns)


def line(axes, label):
    """The one line of this run, or with this label; a legend also tells how a run ended."""
    (found,) = (line for line in axes.lines if line.get_label().partition(" (")[0] == label)
    return found


def panels(figure):
    """A figure's panels by the label of their vertical axis."""
    return {axes.get_ylabel(): axes for axes in figure.axes}


def changed(run, **signals):
    return replace(run, signals={**run.signals, **signals})


def title(axes):
    """On the left, after the panel's letter."""
    return axes.get_title(loc="left")


def hulls(axes):
    """Bow, middle of the stern and colour of every silhouette."""
    corners = [(p.get_xy()[:5], p.get_edgecolor()) for p in axes.patches if isinstance(p, Polygon)]
    return [(xy[0], (xy[2] + xy[3]) / 2.0, color) for xy, color in corners]


def expected_hull(log, t, scale):
    """Bow and stern [east, north] of the vessel at a time, independent of `hull`."""
    row = np.argmin(np.abs(log["time"] - t))
    middle = np.array([log["y"][row], log["x"][row]])
    ahead = (
        0.5
        * scale
        * scenario().vessel.length
        * np.array([np.sin(log["psi"][row]), np.cos(log["psi"][row])])
    )
    return middle + ahead, middle - ahead


def different_targets():
    turned = recording(x_d=lambda t: -0.5 * t, y_d=lambda t: 30.0 + 0.0 * t)
    other = scenario(path="{kind: line_circle, rate: 0.06}")
    return shown(("a", recording()), ("b", turned, other), ("c", recording()), ("d", turned, other))
