"""`podusv plot`: what it draws, what it refuses, what it says."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from drawn_samples import no_figures_but, recording, scenario
from storage_samples import log as encode

from podusv_cli import __version__
from podusv_cli.core.errors import UsageError
from podusv_cli.core.recording import Recording
from podusv_cli.figures import animation
from podusv_cli.figures.drawing import FIGURES
from podusv_cli.figures.style import Look, house_style
from podusv_cli.scenario.resolved import resolved_yaml
from podusv_cli.storage import run_folder
from podusv_cli.workflows import plot as plotting
from podusv_cli.workflows.request import Request

LAWLESS = ("W_hat_u", "W_hat_r", "b_hat_u", "b_hat_r", "f_hat_u", "f_hat_r", "rbf_center")


def keep(target, log, plan=None):
    """A finished run folder that holds a log made by hand."""
    plan = plan or scenario()
    text = resolved_yaml(plan)
    encoded = encode(log, resolved_yaml=text, title="", source="", version=__version__)
    with run_folder.RunWriter(target) as writer:
        writer.add("log.h5", encoded)
        writer.add("resolved.yaml", text.encode())
        writer.add("figures/errors.png", b"as it was")
        writer.add_json("metrics.json", {"metrics": {}})
        writer.add_json("provenance.json", {})
        return writer.finish(log.status)


def pid(**options):
    log = recording(without=LAWLESS, **options)
    return Recording(log.status, "pid", log.signals, {}, message=log.message, about=log.about)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def one(place):
    return keep(place / "first" / "pid", pid(), scenario("first"))


@pytest.fixture(scope="module")
def other(place):
    return keep(place / "second" / "pid", pid(shift=0.3), scenario("second"))


@pytest.fixture(scope="module")
def stillborn(place):
    whole = pid()
    signals = {name: values[:0] for name, values in whole.signals.items()}
    message = "diverged at t = 0 s: tau_u_cmd is not finite"
    return keep(
        place / "stillborn",
        Recording("diverged", "pid", signals, {}, message=message, about=whole.about),
    )


def plot(*runs, out, figures=("velocities",), formats=("svg",), animate=False, **choice):
    choice = plotting.PlotChoice(**{"look": Look(1), "animated": animate, **choice})
    return plotting.plot(runs, Request(out=out, names=figures, formats=formats), choice)


def words(path):
    """What an SVG says, as its comments keep it."""
    return [part.partition(" -->")[0] for part in path.read_text().split("<!-- ")[1:]]


@pytest.mark.slow
def test_finished_runs_are_drawn_again_in_every_format(one, other, tmp_path):
    drawn = plot(one, other, out=tmp_path / "new", formats=("png", "pdf"))
    assert drawn.files == [tmp_path / "new" / f"velocities.{form}" for form in ("png", "pdf")]
    assert all(path.read_bytes() for path in drawn.files)
    assert not drawn.replaced


def test_without_a_name_all_figures_are_drawn_that_the_runs_have_signals_for(one, tmp_path):
    with no_figures_but("errors", "loads", "adaptation"):
        drawn = plot(one, out=tmp_path, figures=())
    assert [path.stem for path in drawn.files] == ["errors", "loads"]


def test_a_figure_that_the_runs_have_no_signals_for_is_refused_with_what_there_is(one, tmp_path):
    with pytest.raises(UsageError) as caught:
        plot(one, out=tmp_path / "x", figures=("errors", "adaptation"))
    text = str(caught.value)
    for word in ("'adaptation'", *FIGURES["adaptation"].signals, "pid", "trajectory, errors"):
        assert word in text
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize(("figures", "formats"), [(("trajectry",), ("png",)), ((), ("pgn",))])
def test_what_there_is_not_is_refused_with_the_likely_name(one, tmp_path, figures, formats):
    with pytest.raises(UsageError, match=r"did you mean '(trajectory|png)'"):
        plot(one, out=tmp_path, figures=figures, formats=formats)


@pytest.mark.parametrize("animate", [True, False])
@pytest.mark.parametrize("figures", [("errors",), ()])
def test_a_run_that_ended_at_once_is_refused_in_a_sentence(stillborn, tmp_path, figures, animate):
    with pytest.raises(UsageError, match="nothing to draw: stillborn: diverged at t = 0 s"):
        plot(stillborn, out=tmp_path, figures=figures, animate=animate)


def test_beside_others_it_is_left_out_and_named(one, stillborn, tmp_path):
    drawn = plot(one, stillborn, out=tmp_path)
    assert drawn.empty == {"stillborn": "diverged at t = 0 s: tau_u_cmd is not finite"}
    assert "stillborn" not in words(drawn.files[0])


def test_runs_of_one_name_are_told_apart_by_their_scenario(one, other, tmp_path):
    (path,) = plot(one, other, out=tmp_path).files
    assert {"pid (first)", "pid (second)"} < set(words(path))


def test_runs_of_one_name_and_scenario_are_told_apart_by_their_folders(place, one, tmp_path):
    twin = keep(place / "third" / "pid", pid(shift=0.1), scenario("first"))
    (path,) = plot(one, twin, out=tmp_path).files
    assert {"first/pid", "third/pid"} < set(words(path))


@pytest.mark.slow
def test_a_folder_that_nobody_named_goes_by_its_scenario(place, one, tmp_path):
    stamped = keep(place / "20260102T030405Z-0123abcd", pid(), scenario("mine"))
    (path,) = plot(one, stamped, out=tmp_path).files
    assert {"pid", "mine"} < set(words(path))


def test_a_run_given_twice_is_drawn_once(one, tmp_path):
    (path,) = plot(one, one, out=tmp_path).files
    assert words(path).count("pid") == 1


@pytest.mark.slow
def test_a_new_drawing_replaces_an_old_one_and_says_so(one, other, tmp_path):
    (path,) = plot(one, out=tmp_path).files
    before = path.read_bytes()
    assert not plot(one, out=tmp_path).replaced  # the same bytes
    assert path.read_bytes() == before
    assert plot(other, out=tmp_path).replaced == [path]
    assert path.read_bytes() != before


def test_files_of_a_finished_run_are_never_replaced(one, tmp_path):
    with pytest.raises(UsageError, match=r"figures/errors\.png belongs to the finished folder"):
        plot(one, out=one / "figures", figures=("velocities", "errors"), formats=("png",))
    assert (one / "figures" / "errors.png").read_bytes() == b"as it was"
    assert not (one / "figures" / "velocities.png").exists()
    link = tmp_path / "link"
    link.symlink_to(one / "figures")
    with pytest.raises(UsageError, match="belongs to the finished folder"):
        plot(one, out=link, figures=("errors",), formats=("png",))


@pytest.mark.slow
def test_differences_beyond_the_controller_are_told(one, place, tmp_path):
    longer = keep(place / "longer", pid(), scenario(duration=200.0))
    drawn = plot(one, longer, out=tmp_path)
    assert drawn.differences == {"simulation.duration": {"pid": 100.0, "longer": 200.0}}


@pytest.mark.slow
def test_the_film_is_a_file_beside_the_figures(one, tmp_path, monkeypatch):
    monkeypatch.setattr(animation, "FRAMES", 3)
    monkeypatch.setattr(plotting, "file_name", lambda: animation.GIF)
    drawn = plot(one, out=tmp_path, animate=True)
    assert [path.name for path in drawn.files] == ["velocities.svg", "animation.gif"]
    assert drawn.files[1].read_bytes().startswith(b"GIF89a")


def test_a_folder_that_is_no_run_is_refused(tmp_path):
    (tmp_path / "mine.yaml").touch()
    (tmp_path / "folders" / "of" / "runs").mkdir(parents=True)
    for name in ("", "mine.yaml", "folders", "nowhere"):
        why = "it does not exist" if name == "nowhere" else "it has no manifest.json"
        with pytest.raises(UsageError, match=f" is no run folder: {why}"):
            plot(tmp_path / name, out=tmp_path / "x")


def command(*arguments, cwd):
    call = [sys.executable, "-m", "podusv_cli", "plot", *map(str, arguments)]
    return subprocess.run(call, cwd=cwd, capture_output=True, text=True, env=os.environ)


@pytest.mark.slow
def test_the_command_prints_files_and_warns_beside_them(one, place, stillborn, tmp_path):
    brief = keep(place / "brief", pid(end=40.0), scenario(duration=40.0))
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "errors.png").write_text("a picture of my own")
    done = command(one, brief, stillborn, "--figure", "errors", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "figures/errors.png\n")
    for word in (
        "replaced what was in figures/errors.png",
        "stillborn: nothing to draw: diverged at t = 0 s",
        "warning: the runs differ in more than the controller:",
        "simulation.duration: pid 100, brief 40",
    ):
        assert word in done.stderr


# --- signals, a part of the time, names, size, type


def curves(monkeypatch, *given, **options):
    """What a figure of these runs is made of, drawn nowhere."""
    kept = []

    def draw(shown, sheets, formats, extras, look):
        kept.append((shown, sheets, look))
        return {}

    with monkeypatch.context() as patch:
        patch.setattr(plotting, "draw_in_parallel", draw)
        plot(*given, figures=(), **options)
    ((shown, sheets, look),) = kept
    with house_style(look.style):
        return [look.given_to(sheet.family(shown, look.columns)) for sheet in sheets]


def test_any_signal_logged_or_derived_is_drawn_in_a_panel_of_its_own(one, tmp_path, monkeypatch):
    (figure,) = curves(monkeypatch, one, out=tmp_path, signals=("psi", "x_e", "psi"))
    assert [axes.get_ylabel() for axes in figure.axes] == [r"$\psi$ [rad]", "$x_e$ [m]"]
    log = pid()
    assert figure.axes[1].lines[0].get_ydata() == pytest.approx(log["x_d"] - log["x"])
    assert plot(one, out=tmp_path, figures=(), signals=("psi", "u")).files == [
        tmp_path / "psi-u.svg"
    ]


def test_all_components_of_a_vector_are_drawn_under_one_name(place, tmp_path, monkeypatch):
    log = recording()
    folder = keep(place / "vector", replace(log, fixed={}, controller="pid"))
    (figure,) = curves(monkeypatch, folder, out=tmp_path, signals=("W_hat_u",))
    drawn = [line.get_ydata() for line in figure.axes[0].lines]
    assert np.array_equal(np.transpose(drawn), log["W_hat_u"])
    assert [text.get_text() for text in figure.legends[0].texts] == ["vector"]


def test_an_unknown_signal_is_refused_with_the_nearest_names(one, tmp_path):
    with pytest.raises(UsageError, match=r"unknown signal 'psii'; did you mean 'psi'\?.*psi_e"):
        plot(one, out=tmp_path, signals=("psii",))


def test_only_the_part_that_is_asked_for_is_drawn(one, tmp_path, monkeypatch):
    (figure,) = curves(monkeypatch, one, out=tmp_path, signals=("u",), since=10.0, until=60.0)
    t = figure.axes[0].lines[0].get_xdata()
    assert (t[0], t[-1]) == (10.0, 60.0)
    with pytest.raises(UsageError, match=r"no run has two instants from 400 to inf s .*100 s"):
        plot(one, out=tmp_path, since=400.0)


def test_a_run_that_diverged_later_shows_no_end_in_the_part(place, tmp_path, monkeypatch):
    bad = keep(place / "bad", pid(end=60.0, status="diverged"))
    for until, name in ((50.0, "bad"), (70.0, "bad (diverged at 60 s)")):
        (figure,) = curves(monkeypatch, bad, out=tmp_path, signals=("u",), until=until)
        assert [text.get_text() for text in figure.legends[0].texts] == [name]


def test_runs_keep_the_order_of_the_arguments_and_take_the_names_given(
    one, other, tmp_path, monkeypatch
):
    def names(*runs, **options):
        (figure,) = curves(monkeypatch, *runs, out=tmp_path, signals=("u",), **options)
        return [text.get_text() for text in figure.legends[0].texts]

    assert names(one, other) == ["pid (first)", "pid (second)"]
    assert names(other, one) == ["pid (second)", "pid (first)"]
    assert names(other, one, labels=("new", "old")) == ["new", "old"]
    for labels in (("new",), ("same", "same")):
        with pytest.raises(UsageError, match="--label: the 2 runs need a name each"):
            plot(one, other, out=tmp_path, labels=labels)


@pytest.mark.parametrize(
    ("size", "width", "height"), [("4", 4.0, None), ("6.5x3", 6.5, 3.0), ("", 7.09, None)]
)
def test_a_figure_has_the_size_that_is_asked_for(one, tmp_path, monkeypatch, size, width, height):
    look = plotting.look_of(2, size, "podusv")
    (figure,) = curves(monkeypatch, one, out=tmp_path, signals=("u",), look=look)
    assert figure.get_figwidth() == width
    assert height in (None, figure.get_figheight())
    assert look.columns == (1 if size == "4" else 2)


def test_the_style_of_a_paper_has_serif_type_of_eight_points(one, tmp_path, monkeypatch):
    look = plotting.look_of(1, "", "paper")
    (figure,) = curves(monkeypatch, one, out=tmp_path, signals=("u",), look=look)
    label = figure.axes[0].yaxis.label
    assert (label.get_fontsize(), label.get_fontfamily()[0]) == (8.0, "STIXGeneral")
    assert label.get_math_fontfamily() == "stix"


@pytest.mark.parametrize(
    ("size", "style", "told"),
    [
        ("3y", "podusv", "--size '3y': must be WIDTH"),
        ("0.5", "podusv", "from 1 to 40"),
        ("5x90", "podusv", "from 1 to 40"),
        ("", "papr", "did you mean 'paper'"),
    ],
)
def test_a_size_or_style_that_there_is_not_is_refused(size, style, told):
    with pytest.raises(UsageError, match=told):
        plotting.look_of(2, size, style)
