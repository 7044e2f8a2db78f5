"""Figures by their data: lines, labels, limits; never by pixels."""

import numpy as np
import pytest
from conftest import corrected, run

from podusv_cli.actuators.saturated import Saturated
from podusv_cli.config.loading import load_text
from podusv_cli.controllers.pid import Pid
from podusv_cli.figures.drawing import FIGURES, draw, dressed
from podusv_cli.figures.style import LOOKS, WIDTHS, axis_label, house_style, thinned
from podusv_cli.figures.trajectory import hull
from podusv_cli.signals import SIGNALS

TEXT = """
vessel: {preset: paper_nonlinear}
path: {kind: line_circle}
disturbance: {kind: harmonic}
actuator: {kind: saturated}
controller: {kind: pid}
simulation: {duration: 40.0}
"""


@pytest.fixture(scope="module")
def shown():
    scenario = load_text(TEXT, "drawn.yaml").scenario
    laws = {"adaptive": corrected(actuator=Saturated()), "pid": corrected(controller=Pid())}
    return dressed([(label, run(loop, 40.0), scenario) for label, loop in laws.items()])


def drawn(name, shown, columns=2):
    with house_style():
        return FIGURES[name].family(shown, columns)


def test_errors_show_the_logged_numbers(shown):
    axes = {a.get_ylabel(): a for a in drawn("errors", shown).axes}
    assert list(axes) == [axis_label(name) for name in ("x_e", "y_e", "z_e", "psi_e")]
    assert axes[axis_label("z_e")].get_yscale() == "log"
    line = axes[axis_label("x_e")].lines[0]
    log = shown[0].recording
    assert np.isin(line.get_ydata(), log["x_d"] - log["x"]).all()
    assert line.get_ydata().max() == (log["x_d"] - log["x"]).max()


def test_every_run_has_its_own_look(shown):
    lines = drawn("errors", shown).axes[0].lines
    assert [line.get_label() for line in lines] == ["adaptive", "pid"]
    assert len({(line.get_color(), line.get_linestyle()) for line in lines}) == 2


def test_looks_differ_in_colour_and_in_line_style():
    assert len({color for color, _ in LOOKS}) == len(LOOKS)
    assert len({str(style) for _, style in LOOKS}) == len(LOOKS)


def test_controls_show_the_peak_and_the_settled_part(shown):
    early, settled = drawn("controls", shown).axes[:2]
    assert early.get_xlim() == pytest.approx((0.0, 0.005 * 40))
    assert settled.get_xlim() == pytest.approx((32.0, 40.0))
    applied = next(line for line in settled.lines if line.get_label() == "adaptive")
    assert np.abs(applied.get_ydata()).max() <= 8.0


def test_controls_draw_what_was_asked_only_where_it_was_not_given(shown):
    labels = {line.get_label() for line in drawn("controls", shown).axes[0].lines}
    assert labels == {"adaptive", "adaptive, asked", "pid"}


def test_a_map_has_equal_scales_and_the_target(shown):
    whole = drawn("trajectory", shown).axes[0]
    assert whole.get_aspect() == 1.0
    target = next(line for line in whole.lines if line.get_label() == "target")
    log = shown[0].recording
    assert target.get_xdata()[-1] == log["y_d"][-1]
    assert target.get_ydata()[-1] == log["x_d"][-1]
    hulls = [patch.get_xy() for patch in whole.patches]
    assert len(hulls) == 2 * 9


def test_a_hull_points_where_the_vessel_heads():
    north = hull(0.0, 0.0, 0.0, length=2.0, beam=0.5)
    assert north[0] == pytest.approx([0.0, 1.0])  # the bow: east 0, north 1
    east = hull(3.0, 4.0, np.pi / 2, length=2.0, beam=0.5)
    assert east[0] == pytest.approx([5.0, 3.0])


def test_a_law_without_memory_has_no_adaptation_to_show(shown):
    assert FIGURES["adaptation"].fits(shown)
    assert not FIGURES["adaptation"].fits(shown[1:])
    assert not list(draw(shown[1:], ["adaptation"], ("png",)))


@pytest.mark.parametrize("columns", [1, 2])
@pytest.mark.parametrize("name", FIGURES)
def test_every_figure_fits_its_page(shown, name, columns):
    figure = drawn(name, shown, columns)
    assert figure.get_size_inches()[0] == WIDTHS[columns]
    used = [axes for axes in figure.axes if axes.axison]
    assert all("[" in axes.get_ylabel() for axes in used if axes.get_ylabel())


@pytest.mark.parametrize("form", ["png", "pdf", "svg"])
def test_the_same_runs_give_the_same_bytes(shown, form):
    first, second = (dict(draw(shown, ["errors"], (form,))) for _ in range(2))
    assert first == second


def test_thinning_keeps_every_extreme():
    t = np.linspace(0, 1, 100_000)
    y = np.sin(50 * t)
    y[[777, 54_321]] = 9.0, -9.0
    few, kept = thinned(t, y)
    assert len(few) < 3000
    assert np.all(np.diff(few) > 0)
    assert (kept.max(), kept.min()) == (9.0, -9.0)


def test_every_signal_has_a_label_with_its_unit():
    assert all(f"[{signal.unit}]" in axis_label(name) for name, signal in SIGNALS.items())


def test_the_style_stays_inside(shown):
    import matplotlib as mpl

    before = mpl.rcParams["font.size"]
    drawn("errors", shown)
    assert mpl.rcParams["font.size"] == before
