"""Figures by their data: which line shows which numbers, under which label, on which scale."""

import math
from itertools import combinations, product
from pathlib import Path

import numpy as np
import pytest
from drawn_samples import CENTER, WIDTH, drawn, line, looked_at, panels, recording, scenario, shown
from known_signals import ABOUT
from matplotlib.cbook import is_math_text
from matplotlib.text import Text
from pose_samples import BOAT, HELD, POSES, loaded_pose, marched
from rerun_samples import made
from rotation import one_in
from scenario_samples import SOUND

from podusv_cli.comparison.claims import peaks
from podusv_cli.comparison.parsing import parse_claims
from podusv_cli.core import escaping
from podusv_cli.core.past_run import PastRun
from podusv_cli.core.spectrum import periodogram
from podusv_cli.figures.animation import draw_scene
from podusv_cli.figures.curves import thin_curve
from podusv_cli.figures.drawing import FIGURES, draw
from podusv_cli.figures.looks import LOOKS, nth_style
from podusv_cli.figures.shown import FEWEST, axis_label, dress_runs, label, places
from podusv_cli.figures.style import STYLES, WIDTHS, Look, house_style, image, new_figure
from podusv_cli.scenario.about import about_of
from podusv_cli.scenario.load import load
from podusv_cli.workflows.members import from_folder

QUICK = ("errors", "trajectory", "pods", "adaptation")


@pytest.fixture(scope="module")
def two():
    at_target = scenario(law="{kind: pid, standoff: 0.0}")
    return shown(("a", recording(), at_target), ("b", recording(shift=0.7), at_target))


def activation(log):
    nu = np.column_stack([log["u"], log["v"], log["r"]])
    outputs = [np.exp(-0.5 * (((nu - c) / WIDTH) ** 2).sum(axis=1)) for c in CENTER]
    return np.maximum(*outputs)


# By hand: label of the axis, and the numbers that belong there.
GRIDS = {
    "errors": {
        "$x_e$ [m]": lambda log: log["x_d"] - log["x"],
        "$y_e$ [m]": lambda log: log["y_d"] - log["y"],
        "$z_e$ [m]": lambda log: log["z_e"],
        r"$\psi_e$ [rad]": lambda log: log["psi_e"],
    },
    "velocities": {
        "$u$ [m/s]": lambda log: log["u"],
        "$v$ [m/s]": lambda log: log["v"],
        "$r$ [rad/s]": lambda log: log["r"],
        r"$\psi$ [rad]": lambda log: log["psi"],
    },
    "adaptation": {
        r"$|\hat W_u|$ [m/s$^2$]": lambda log: np.hypot(*log["W_hat_u"].T),
        r"$|\hat W_r|$ [rad/s$^2$]": lambda log: np.hypot(*log["W_hat_r"].T),
        r"$\hat b_u$ [N]": lambda log: log["b_hat_u"],
        r"$\hat b_r$ [N m]": lambda log: log["b_hat_r"],
        r"$\hat f_u$ [m/s$^2$]": lambda log: log["f_hat_u"],
        r"$\hat f_r$ [rad/s$^2$]": lambda log: log["f_hat_r"],
        r"$\max\Phi$ [1]": activation,
    },
}


@pytest.mark.parametrize("name", GRIDS)
def test_every_panel_shows_its_signal_of_every_run(two, name):
    found = panels(drawn(name, two))
    assert list(found) == list(GRIDS[name])
    for signal, expected in GRIDS[name].items():
        assert [curve.get_label() for curve in found[signal].lines] == ["a", "b"]
        for run, curve in zip(two, found[signal].lines, strict=True):
            assert np.array_equal(curve.get_xdata(), run.recording["time"])
            assert curve.get_ydata() == pytest.approx(expected(run.recording), abs=1e-12)


def test_only_the_distance_is_on_a_logarithmic_axis(two):
    scales = {label: axes.get_yscale() for label, axes in panels(drawn("errors", two)).items()}
    assert scales.pop("$z_e$ [m]") == "log"
    distance = panels(drawn("errors", two))["$z_e$ [m]"]
    assert distance.get_ylim() == pytest.approx((1.0 / 2.0**0.05, 2.0 * 2.0**0.05), rel=1e-3)
    assert set(scales.values()) == {"linear"}


def test_what_no_run_logged_has_no_panel_and_a_run_without_it_no_line():
    lacking = recording(without=("b_hat_u", "b_hat_r"))
    runs = shown(("a", lacking), ("b", recording(without=("b_hat_u",))))
    found = panels(drawn("adaptation", runs))
    assert r"$\hat b_u$ [N]" not in found
    assert [curve.get_label() for curve in found[r"$\hat b_r$ [N m]"].lines] == ["b"]


def test_every_run_has_its_own_look_and_its_name_in_the_legend(two):
    figure = drawn("errors", two)
    for axes in figure.axes:
        looks = [(curve.get_color(), curve.get_linestyle()) for curve in axes.lines]
        assert looks == [("#0072B2", "-"), ("#D55E00", "--")]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["a", "b"]
    colors = [handle.get_color() for handle in legend.get_lines()]
    assert colors == ["#0072B2", "#D55E00"]


def test_ten_runs_differ_in_colour_in_line_style_and_in_marker():
    for parts in zip(*(nth_style(i) for i in range(10)), strict=True):
        assert len(set(map(str, parts))) == 10
    assert [nth_style(i) for i in range(len(LOOKS))] == list(LOOKS)
    assert len({str(nth_style(i)) for i in range(100)}) == 100


@pytest.mark.parametrize("count", [2, 4, 9, 30])
def test_markers_of_runs_that_coincide_are_all_seen(count):
    at = np.sort(np.concatenate([places(i, count) for i in range(count)]))
    assert len(at) >= count * FEWEST
    assert np.diff(at) == pytest.approx(1.0 / len(at))
    assert (at[0], at[-1]) == pytest.approx((0.5 / len(at), 1.0 - 0.5 / len(at)))


def test_markers_stand_on_the_curve_at_their_times(two):
    for axes in panels(drawn("velocities", two)).values():
        for run, curve in zip(two, axes.lines, strict=True):
            assert curve.get_marker() == run.marker
            at = curve.get_xdata()[curve.get_markevery()]
            assert at == pytest.approx(run.look.places * 100.0, abs=0.1)
    (alone,) = shown(("a", recording()))
    assert line(panels(drawn("velocities", [alone]))["$u$ [m/s]"], "a").get_marker() == "None"


def standoffs(*kept):
    laws = [scenario(law=f"{{kind: pid, standoff: {standoff}}}") for standoff in kept]
    runs = shown(*((f"run{i}", recording(), law) for i, law in enumerate(laws)))
    lines = panels(drawn("errors", runs))["$z_e$ [m]"].lines
    return {curve.get_label(): curve.get_ydata()[0] for curve in lines[len(runs) :]}


def test_a_line_is_at_the_standoff():
    assert standoffs(0.5, 0.0) == {"standoff 0.5 m": 0.5}
    assert standoffs(0.0) == {}
    assert standoffs(0.5, 0.8) == {"standoffs": 0.8}  # both have this label


@pytest.mark.parametrize(("passage", "lowest"), [(1, 5e-3), (50, 1e-6)])
def test_the_distance_is_shown_down_to_a_step_s_way_or_where_the_vessel_stays(passage, lowest):
    near = {"z_e": lambda t: np.where(np.abs(t - 50.0) < 0.05 * passage, 1e-6, 1.0)}
    runs = shown(("a", recording(u=lambda t: 0.5 + 0.0 * t, **near)))
    bottom = panels(drawn("errors", runs))["$z_e$ [m]"].get_ylim()[0]
    assert runs[0].about.step == 0.01
    assert 0.5 * lowest < bottom <= lowest * 1.0001


def test_a_run_that_did_not_finish_is_told_in_the_legend_and_marked_at_its_end():
    runs = shown(("good", recording()), ("bad", recording(end=60.0, status="diverged")))
    figure = drawn("velocities", runs)
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words == ["good", "bad (diverged at 60 s)"]
    for axes in figure.axes:
        (cross,) = (curve for curve in axes.lines if curve.get_marker() == "x")
        assert list(cross.get_xdata()) == [60.0]
        assert cross.get_color() == runs[1].color


def test_thinning_keeps_the_extremes_of_every_bin_in_order():
    t = np.linspace(0, 1, 100_000)
    y = np.sin(50 * t)
    y[[777, 54_321]] = 9.0, -9.0
    few, kept = thin_curve(t, y)
    assert len(few) <= 1500 + 2
    assert np.all(np.diff(few) > 0)
    assert (kept.max(), kept.min()) == (9.0, -9.0)
    smooth = np.sin(50 * t)
    assert np.interp(t, *thin_curve(t, smooth)) == pytest.approx(smooth, abs=0.1)
    assert np.array_equal(thin_curve(t[:1500], y[:1500])[1], y[:1500])
    assert len(thin_curve(t[:2500], y[:2500])[0]) <= 1500 + 2
    level = thin_curve(t, np.zeros_like(t))[0]
    assert (level[0], level[-1]) == (t[0], t[-1])


def test_every_signal_has_a_label_with_its_unit():
    for signal in ABOUT.values():
        symbol, unit = label(signal).removesuffix("]").split(" [")
        assert symbol == f"${signal.symbol}$"
        assert unit.replace("$", "").replace("^", "") == signal.unit
    assert axis_label(shown(("a", recording())), "f_hat_u") == r"$\hat f_u$ [m/s$^2$]"


@pytest.mark.parametrize("columns", [1, 2])
@pytest.mark.parametrize("name", FIGURES)
def test_every_figure_is_as_wide_as_its_page_and_names_its_axes(two, name, columns):
    if not FIGURES[name].fits(two):
        pytest.skip("the sample logs lack what this figure shows")
    figure = drawn(name, two, columns)
    assert figure.get_size_inches()[0] == {1: 3.46, 2: 7.09}[columns] == WIDTHS[columns]
    assert all("[" in axes.get_ylabel() for axes in figure.axes if axes.get_ylabel())
    assert any(axes.get_xlabel() for axes in figure.axes)


def pages(styles, quick):
    """Every figure in these styles and both widths; but for the `quick` ones they are slow.

    Of the quick ones every second is long.
    """
    every = [*product(FIGURES, styles, (1, 2))]
    some = [page for page in every if quick(*page)]
    return [*one_in(2, some)] + [
        pytest.param(*page, marks=pytest.mark.slow) for page in every if page not in some
    ]


@pytest.mark.parametrize(
    ("name", "style", "columns"),
    pages(("ieee", "elsevier"), lambda name, style, columns: name in QUICK and style == "ieee"),
)
def test_type_can_be_read_at_the_widths_of_publishers(two, name, columns, style):
    if not FIGURES[name].fits(two):
        pytest.skip("the sample logs lack what this figure shows")
    look = Look(columns, style=STYLES[style])
    with house_style(look.style):
        figure = look.given_to(FIGURES[name].family(two, columns))
        assert image(figure, "pdf")[:4] == b"%PDF"
        texts = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text()]
    widths = {"ieee": (88.9, 181.864), "elsevier": (90.0, 190.0)}[style]
    assert figure.get_size_inches()[0] * 25.4 == pytest.approx(widths[columns - 1])  # mm
    assert min(text.get_fontsize() for text in texts) >= 7.0


@pytest.mark.parametrize(
    ("name", "style", "columns"),
    pages(("podusv", "ieee"), lambda name, style, columns: style == "podusv" and columns == 1),
)
def test_no_text_leaves_the_page_and_no_label_title_or_name_covers_another(
    two, name, style, columns
):
    if not FIGURES[name].fits(two):
        pytest.skip("the sample logs lack what this figure shows")
    look = Look(columns, style=STYLES[style])
    with house_style(look.style):
        figure = look.given_to(FIGURES[name].family(two, columns))
        image(figure, "png")
        page, panels = figure.bbox, [axes.get_window_extent() for axes in figure.axes]
        kept = [
            (text.get_text(), text.get_window_extent())
            for axes in figure.axes
            for text in (axes.xaxis.label, axes.yaxis.label, axes._left_title, axes.title)
            if text.get_text()
        ]
        kept += [(text.get_text(), text.get_window_extent()) for text in figure.legends[0].texts]
    for words, box in kept:
        assert box.x0 >= page.x0 - 1.0, words
        assert box.x1 <= page.x1 + 1.0, words
        assert box.y0 >= page.y0 - 1.0, words
        assert box.y1 <= page.y1 + 1.0, words
        assert not any(box.padded(-2.0).overlaps(panel) for panel in panels), words
    for (one, box), (other, beside) in combinations(kept, 2):
        assert not box.padded(-2.0).overlaps(beside), (one, other)


SPREAD = {
    "within a decade": {"z_e": lambda t: 1.6 + 0.03 * t},
    "far from zero": {"psi_e": lambda t: -1.234567e8 + 1e-3 * t},
}


@pytest.mark.parametrize("columns", [1, 2])
@pytest.mark.parametrize("case", SPREAD)
def test_numbers_have_room_beside_labels(case, columns, monkeypatch):
    """Ticks on a logarithmic axis within a decade have numbers too, and some axes a factor."""
    boxes, draw_text = {}, Text.draw

    def drawn_text(text, renderer):
        if text.get_visible() and text.get_text():
            boxes.setdefault(text.get_text(), []).append(text.get_window_extent(renderer))
        draw_text(text, renderer)

    monkeypatch.setattr(Text, "draw", drawn_text)
    page = drawn("errors", shown(*((name, recording(**SPREAD[case])) for name in "ab")), columns)
    with house_style():
        image(page, "png")
    labels = {words: boxes.pop(words) for words in [axes.get_ylabel() for axes in page.axes]}
    for text, each in boxes.items():
        for box in each:
            assert box.x0 >= page.bbox.x0 - 1.0, text
            assert not any(box.overlaps(label) for (label,) in labels.values()), text


def test_a_figure_whose_signals_no_run_has_is_not_drawn():
    runs = shown(("a", recording(without=FIGURES["filters"].signals)))
    assert not FIGURES["filters"].fits(runs)
    names = [name for name, _ in draw(runs, [FIGURES["filters"], FIGURES["velocities"]], ("png",))]
    assert names == ["velocities.png"]


@pytest.mark.slow
@pytest.mark.parametrize("form", ["png", pytest.param("pdf", marks=pytest.mark.slow), "svg"])
def test_the_same_runs_give_the_same_bytes_without_a_date(two, form):
    first, second = (
        dict(draw(two, [FIGURES["errors"]], (form,)))[f"errors.{form}"] for _ in range(2)
    )
    assert first == second
    assert not any(word in first for word in (b"CreationDate", b"dc:date", b"Software"))
    assert first.startswith({"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}[form])


# --- labels of runs in figures

# An odd and an even number of $, what they would enclose, and what a legend would leave out.
ODD = ["_a$x^{2$b \\frac{ 3$", "$\\undefined$\udcff\x1b[31m\n"]
SCENARIO = (
    SOUND.replace("kind: ideal", "kind: pod, preset: otter")
    .replace("pid", "dsc")
    .replace("{kind: none}", "[{kind: wind, speed: 1.0}, {kind: current, speed: 0.1}]")
)
SCENARIO += "measurement: {kind: sensors}\n"
BRIEF = "name: x\nsimulation: {step: 0.01, duration: 0.1, compiled: false}\n"


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Runs of which every figure can be drawn, along paths of their own."""
    place = tmp_path_factory.mktemp("runs")
    folders = [made(place / x, f"path.x={x}", text=SCENARIO + BRIEF) for x in ("1", "2")]
    (one,), (other,) = map(from_folder, folders)
    return labelled([(part.folder.recording, part.about) for part in (one, other)])


@pytest.fixture
def followed():
    """The same along legs, which no moving target has."""
    path = "{kind: waypoints, points: [[0, 0], [20, 0]], speed: 0.5}"
    legs = {"e_ct": np.cos, "along_leg": np.sqrt, "leg": np.floor}
    log, following = recording(**legs), scenario(path=path)
    return labelled([(log, about_of(following))] * 2)


def labelled(parts):
    return dress_runs(
        [PastRun(label, about, log) for label, (log, about) in zip(ODD, parts, strict=True)]
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name not in QUICK)) for name in FIGURES]
)
def test_every_figure_shows_labels_as_they_are(runs, followed, name):
    runs = runs if FIGURES[name].fits(runs) else followed
    assert FIGURES[name].fits(runs)
    with house_style():
        figure = FIGURES[name].family(runs, 2)
        assert b"<svg" in image(figure, "svg")
    legend, *_ = figure.legends or [None]
    named = [text.get_text() for text in legend.get_texts()] if legend else []
    ours = [text for text in named if text in (run.name for run in runs)]
    assert ours == [run.name for run in runs] or not ours
    assert not any(map(is_math_text, ours))


def test_an_animation_shows_labels_as_they_are(runs):
    with house_style():
        figure = new_figure(1, 3.0)
        draw_scene(figure.add_subplot(), runs)(0.05)
        figure.legend()
        assert image(figure, "png")


def test_a_long_name_without_a_space_is_cut_where_there_is_no_room():
    long = "a_law_with_" + 20 * "many_words_"
    runs = shown((long, recording()), ("b", recording(shift=0.1)))
    titles = [axes.get_title(loc="left") for axes in drawn("trajectory", runs).axes]
    (told,) = (title for title in titles if "from a_law" in title)
    assert told.endswith("...")
    assert len(told) < 60


@pytest.mark.parametrize("text", [*ODD, "", "_", "$", "a\\$b", "50$ or 60$", "ψ _ x"], ids=ascii)
def test_the_text_of_a_figure_reads_as_it_was(text):
    found = escaping.figure(text)
    assert not is_math_text(found)
    assert not found.startswith("_")
    assert found.replace(r"\$", "$").removeprefix(" ") == escaping.visible(text)


def test_a_run_whose_name_looks_hidden_is_in_the_legend(runs):
    with house_style():
        figure = FIGURES["errors"].family(runs, 2)
    assert [text.get_text() for text in figure.legends[0].get_texts()][:2] == [
        f" {escaping.visible(ODD[0])}".replace("$", r"\$"),
        escaping.visible(ODD[1]).replace("$", r"\$"),
    ]


# --- the spectrum of the settled demand, and lines at peaks that claims name

CONFIGS = Path(__file__).parents[2] / "configs"


def test_the_periodogram_has_the_power_of_the_signal():
    t = np.arange(0, 100, 0.01)
    y = 3.0 + 2.0 * np.sin(0.5 * t) + 0.1 * np.cos(40.0 * t)
    rates, power = periodogram(t, y)
    assert np.sum(power) == pytest.approx(2.0 + 0.005, rel=2e-3)
    assert math.sqrt(np.sum(power[rates > 2.0])) == pytest.approx(0.1 / math.sqrt(2.0), rel=1e-4)
    assert rates[np.argmax(power)] == pytest.approx(0.5, abs=rates[1])
    alternating = 100.0 * (-1.0) ** np.arange(1000)
    assert math.sqrt(np.sum(periodogram(t[:1000], alternating)[1])) == pytest.approx(
        100.0, rel=2e-3
    )
    assert [len(part) for part in periodogram(t[:3], y[:3])] == [0, 0]


def test_a_claim_that_names_a_peak_is_found_and_drawn_in_the_panel_of_the_demand():
    loaded = load(CONFIGS / "mu_2017/figures_compare_standoff.yaml")
    found = peaks(parse_claims(loaded))
    assert found == {"tau_u_cmd": 300.0, "tau_r_cmd": 1000.0}
    runs = dress_runs([looked_at("a", recording(), scenario())], found)
    with house_style():
        axes = FIGURES["controls"].family(runs, 2).axes
    levels = {
        panel.get_ylabel(): sorted(
            line.get_ydata()[0] for line in panel.lines if "claim" in line.get_label()
        )
        for panel in axes[::3]
    }
    assert list(levels.values()) == [[], [-300.0, 300.0], [], [-1000.0, 1000.0]]


def test_the_spectrum_shows_a_cycle_of_the_settled_demand():
    cycling = recording(period=0.01, tau_u_cmd=lambda t: np.sin(0.5 * t) + 50.0 * np.sin(70.0 * t))
    surge, yaw = drawn(
        "spectrum", shown(("calm", recording(period=0.01)), ("cycling", cycling))
    ).axes
    peaks_at = {}
    for curve in surge.lines:
        rates, rms = curve.get_xdata(), curve.get_ydata()
        peaks_at[curve.get_label()] = rates[np.argmax(rms)], max(rms)
    assert peaks_at["cycling"] == pytest.approx((70.0, 50.0 / math.sqrt(2.0)), rel=0.3)
    assert peaks_at["calm"][0] < 1.0
    assert [line.get_label() for line in yaw.lines] == ["disturbance", "calm", "cycling"]


def test_a_sway_force_that_is_asked_for_has_panels_of_its_own():
    text = BOAT + POSES + HELD
    runs = shown(("a", marched(text), loaded_pose(text)))
    surge, yaw, sway = drawn("spectrum", runs).axes
    assert [axes.get_title() for axes in (surge, yaw, sway)] == ["surge", "yaw", "sway"]
    settled = runs[0].during("tau_v_cmd", (runs[0].steady_from, runs[0].counts_to))
    rates, power = periodogram(*settled)
    (curve,) = (line for line in sway.lines if line.get_label() == "a")
    np.testing.assert_array_equal(curve.get_ydata(), np.sqrt(power[1:]))
    np.testing.assert_array_equal(curve.get_xdata(), rates[1:])
    rows = [axes.get_ylabel() for axes in drawn("controls", runs).axes[::3]]
    assert rows == [r"$\tau_u$ [N]", r"$\tau_r$ [N m]", r"$\tau_v$ [N]"]
