"""The map of the tracks, by its data: positions, headings, limits, instants."""

import io
import re
import shutil
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from drawn_samples import (
    changed,
    different_targets,
    drawn,
    expected_hull,
    hulls,
    line,
    recording,
    scenario,
    shown,
    title,
)
from known_signals import ABOUT
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle
from PIL import Image

from podusv_cli.core.signal import Signal
from podusv_cli.figures import animation
from podusv_cli.figures.drawing import FIGURES
from podusv_cli.figures.style import image
from podusv_cli.figures.tracks import bounds
from podusv_cli.figures.trajectory import enlargement, hull_of

LENGTH = scenario().vessel.length


@pytest.fixture(scope="module")
def two():
    return shown(("a", recording()), ("b", recording(shift=0.7)))


def test_a_map_shows_tracks_and_target_with_north_up(two):
    whole = drawn("trajectory", two).axes[0]
    for run in two:
        curve = line(whole, run.label)
        assert np.array_equal(curve.get_xdata(), run.recording["y"])
        assert np.array_equal(curve.get_ydata(), run.recording["x"])
    target = line(whole, "target")
    assert np.array_equal(target.get_xdata(), two[0].recording["y_d"])
    assert np.array_equal(target.get_ydata(), two[0].recording["x_d"])
    assert (whole.get_xlabel(), whole.get_ylabel()) == ("$y$ [m], east", "$x$ [m], north")
    assert whole.get_aspect() == 1.0


def test_silhouettes_stand_where_the_vessels_are_and_point_where_they_head(two):
    whole = drawn("trajectory", two).axes[0]
    scale = enlargement(two)
    found = hulls(whole)
    assert len(found) == 2 * 8
    times = [np.ceil(1000.0 * at) / 10.0 for run in two for at in run.look.places]  # those logged
    assert len(set(times)) == 16  # staggered, so that none hides another
    for (bow, stern, color), t, run in zip(found, times, np.repeat(two, 8), strict=True):
        ahead, behind = expected_hull(run.recording, t, scale)
        assert bow == pytest.approx(ahead)
        assert stern == pytest.approx(behind)
        assert color == to_rgba(run.color)
    assert title(whole) == f"(a) hulls {scale:.0f} times as large"
    assert not any(patch.get_fill() for patch in whole.patches)
    styles = [patch.get_linestyle() for patch in whole.patches if isinstance(patch, Polygon)]
    assert styles == ["-"] * 8 + [two[1].linestyle] * 8


def test_hulls_are_enlarged_to_a_twentieth_of_the_target_s_way(two):
    log = two[0].recording
    spread = np.ptp(log["x_d"]) + np.ptp(log["y_d"])
    assert enlargement(two) == round(0.05 * spread / LENGTH)
    assert enlargement(two) > 1
    still = changed(log, x_d=np.zeros(1001), y_d=np.zeros(1001))
    assert enlargement(shown(("a", still))) == 1.0


def hull_at(x, y, psi):
    """The outline of a vessel there, with its bow first."""
    state = {"x": x, "y": y, "psi": psi}
    still = {name: lambda t, number=number: number + 0.0 * t for name, number in state.items()}
    (run,) = shown(("a", recording(**still)))
    return hull_of(run, 1.0, 1.0)


def test_a_hull_has_its_bow_ahead_and_its_beam_across():
    north, east = hull_at(0.0, 0.0, 0.0), hull_at(3.0, 4.0, np.pi / 2)
    assert north[0] == pytest.approx([0.0, 0.5 * LENGTH])  # the bow: east, north
    assert np.ptp(north, axis=0) == pytest.approx([scenario().vessel.beam, LENGTH])
    assert east[0] == pytest.approx([4.0 + 0.5 * LENGTH, 3.0])
    assert north[1][0] > 0.0
    assert east[1][1] < 3.0  # heading east, starboard is south


def test_the_last_place_on_the_map_of_a_run_that_diverged_is_marked():
    wild = recording(end=60.0, status="diverged", x=lambda t: -10.0 + np.exp(0.2 * t))
    runs = shown(("good", recording()), ("bad", wild), ("worse", recording(end=30.0, status="x")))
    whole = drawn("trajectory", runs).axes[0]
    bad, worse = (curve for curve in whole.lines if curve.get_marker() == "x")
    (x,) = bad.get_ydata()
    top = whole.get_ylim()[1]
    assert x < top < -10.0 + np.exp(0.02) * (x + 10.0)  # a row later it is outside
    assert worse.get_ydata() == [runs[2].recording["x"][-1]]
    assert (bad.get_color(), worse.get_color()) == (runs[1].color, runs[2].color)


def test_waypoints_are_marked_where_they_are_east_and_north():
    path = "{kind: waypoints, points: [[0, 0], [20, 5], [35, -3]]}"
    runs = shown(("a", recording(), scenario(path=path)), ("b", recording(), scenario(path=path)))
    whole, *_ = drawn("trajectory", runs).axes
    marks = line(whole, "waypoint")
    assert list(zip(marks.get_ydata(), marks.get_xdata(), strict=True)) == [
        (0, 0),
        (20, 5),
        (35, -3),
    ]
    usual = drawn("trajectory", shown(("a", recording()))).axes[0]
    assert "waypoint" not in [curve.get_label() for curve in usual.lines]


def gap(t, at, width):
    """1 where a run is apart from the other, falling off to both sides."""
    return np.exp(-(((t - at) / width) ** 2))


def test_a_close_up_shows_where_the_runs_are_farthest_apart():
    off = {"y": lambda t: np.sin(0.05 * t) + 4.0 * gap(t, 40.0, 5.0)}
    runs = shown(("a", recording()), ("b", recording(**off)))
    whole, apart, end, _ = drawn("trajectory", runs).axes
    assert title(apart).startswith("(b) largest gap, t = 40")
    assert title(end) == "(c) end, t = 100 s"
    east, north = (runs[0].recording[name][400] for name in ("y", "x"))
    assert np.mean(apart.get_xlim()) == pytest.approx(east + 2.0, abs=0.05)
    assert np.mean(apart.get_ylim()) == pytest.approx(north, abs=0.05)
    for (bow, _, _), run in zip(hulls(apart), runs, strict=True):
        assert bow == pytest.approx(expected_hull(run.recording, 40.0, 1.0)[0], abs=0.05)
    frames = [patch for patch in whole.patches if isinstance(patch, Rectangle)]
    assert [frame.get_x() for frame in frames] == [apart.get_xlim()[0], end.get_xlim()[0]]
    assert [text.get_text() for text in whole.texts] == ["b", "c"]


def test_a_close_up_of_nearly_the_whole_map_has_no_frame_and_hulls_lie_on_the_map():
    """A boat on a path of four of its lengths, as in the four-corner test."""
    size = 4.0 * LENGTH
    short = {
        "x": lambda t: size * t / 100.0,
        "y": lambda t: size * t / 100.0,
        "x_d": lambda t: size * t / 100.0,
        "y_d": lambda t: size * t / 100.0,
        "psi": lambda t: np.full_like(t, np.pi / 2.0),
    }
    whole, *_ = drawn("trajectory", shown(("a", recording(**short)))).axes
    assert title(whole) == "(a) hulls to scale"
    assert not [patch for patch in whole.patches if isinstance(patch, Rectangle)]
    whole.apply_aspect()
    (west, east), (south, north) = whole.get_xlim(), whole.get_ylim()
    for points in (hulls(whole)[-1][:2], hulls(whole)[0][:2]):
        for y, x in points:
            assert west <= y <= east
            assert south <= x <= north


def test_the_close_up_shows_the_last_twentieth_to_scale(two):
    whole, *_, end, _ = drawn("trajectory", two).axes
    for run in two:
        log, curve = run.recording, line(end, run.label)
        assert np.array_equal(curve.get_xdata(), log["y"][950:])
        assert np.array_equal(curve.get_ydata(), log["x"][950:])
    log = two[0].recording
    assert np.array_equal(line(end, "target").get_ydata(), log["x_d"][950:])
    for (bow, stern, _), run in zip(hulls(end), two, strict=True):
        ahead, behind = expected_hull(run.recording, 100.0, 1.0)
        assert bow == pytest.approx(ahead)
        assert stern == pytest.approx(behind)
    away = max(
        np.hypot(log["y_d"][-1] - r.recording["y"][-1], log["x_d"][-1] - r.recording["x"][-1])
        for r in two
    )
    reach = 1.3 * away
    assert 2.0 * LENGTH < reach < 20.0 * LENGTH
    middle = log["y_d"][-1], log["x_d"][-1]
    assert end.get_xlim() == pytest.approx((middle[0] - reach, middle[0] + reach))
    assert end.get_ylim() == pytest.approx((middle[1] - reach, middle[1] + reach))
    assert title(end) == "(c) end, t = 100 s"
    assert end.get_aspect() == 1.0
    *_, box = (patch for patch in whole.patches if isinstance(patch, Rectangle))
    assert (box.get_x(), box.get_x() + box.get_width()) == pytest.approx(end.get_xlim())
    assert (box.get_y(), box.get_y() + box.get_height()) == pytest.approx(end.get_ylim())


def test_the_close_up_marks_the_target_and_leaves_out_who_diverged():
    runs = shown(("good", recording()), ("bad", recording(end=60.0, status="diverged")))
    end = drawn("trajectory", runs).axes[-2]
    (cross,) = (curve for curve in end.lines if curve.get_marker() == "+")
    log = runs[0].recording
    assert (cross.get_xdata()[0], cross.get_ydata()[0]) == (log["y_d"][-1], log["x_d"][-1])
    assert "bad" not in [curve.get_label() for curve in end.lines]
    assert len(hulls(end)) == 1


def test_runs_that_coincide_are_told_apart_by_their_distance_from_the_first(two):
    *_, apart = drawn("trajectory", two).axes
    (curve,) = apart.lines
    log, first = two[1].recording, two[0].recording
    expected = np.hypot(log["x"] - first["x"], log["y"] - first["y"])
    assert (curve.get_label(), apart.get_yscale(), title(apart)) == ("b", "log", "(d) from a")
    assert curve.get_ydata() == pytest.approx(expected)
    equal = drawn("trajectory", shown(("a", recording()), ("b", recording()))).axes[-1]
    assert np.all(equal.lines[0].get_ydata() == 1e-4)


def test_a_run_alone_is_shown_with_its_distance_from_the_target():
    run = shown(("a", recording()))
    *_, distance = drawn("trajectory", run).axes
    assert title(distance) == "(c) from the target"
    assert np.array_equal(distance.lines[0].get_ydata(), run[0].recording["z_e"])


def test_of_tracks_that_coincide_the_first_is_the_broadest_and_none_has_markers():
    runs = shown(*((name, recording()) for name in "abc"))
    whole = drawn("trajectory", runs).axes[0]
    tracks = [line(whole, run.label) for run in runs]
    widths = [track.get_linewidth() for track in tracks]
    assert widths == sorted(widths, reverse=True)
    assert widths[0] > 2.0 * widths[-1]
    assert {track.get_marker() for track in tracks} == {"None"}


@pytest.mark.parametrize("columns", [1, 2])
@pytest.mark.parametrize("wide", [0.1, 1.0, 8.0])
def test_a_map_of_any_shape_has_equal_scales_and_fills_its_panel(wide, columns):
    far = {"x_d": lambda t: 0.5 * t / wide, "y_d": lambda t: 0.5 * t * wide}
    figure = drawn("trajectory", shown(("a", recording(**far)), ("b", recording(**far))), columns)
    image(figure, "png")
    whole = figure.axes[0]
    box = whole.get_window_extent()
    assert box.width * np.ptp(whole.get_ylim()) == pytest.approx(
        box.height * np.ptp(whole.get_xlim())
    )
    east, north = (np.ptp(far[name](np.array([0.0, 100.0]))) for name in ("y_d", "x_d"))
    assert max(east / np.ptp(whole.get_xlim()), north / np.ptp(whole.get_ylim())) > 0.75


def on_legs(leg=lambda t: 0.0 * t, **e_ct):
    """Runs on legs with these distances from them over time, by their names."""
    legs = scenario(path="{kind: legs, points: [[0, 0], [20, 5], [35, -3]]}")
    about = {
        **ABOUT,
        "e_ct": Signal("e_ct", "m", "cross-track error"),
        "leg": Signal("leg", "1", "legs done"),
    }
    logs = {name: recording(e_ct=law, leg=leg) for name, law in e_ct.items()}
    return shown(*((name, replace(log, about=about), legs) for name, log in logs.items()))


def test_along_legs_the_close_up_shows_where_a_run_is_farthest_from_its_path():
    runs = on_legs(
        near=lambda t: 0.1 + 9.0 * gap(t, 1.0, 2.0),  # in the approach
        off=lambda t: 3.0 * gap(t, 60.0, 5.0),
    )
    off = runs[1].recording
    _, view, distance = drawn("trajectory", runs).axes
    assert title(view) == "(b) farthest from the path, t = 60 s"
    assert np.mean(view.get_xlim()) == pytest.approx(off["y"][600])
    assert [line.get_label() for line in distance.lines] == ["near", "off"]


@pytest.mark.parametrize(
    ("after", "instant"),
    [
        (lambda t: 2.0 - 0.25 * (t - 50.0) + 0.9 * gap(t, 80.0, 3.0), 100.0),  # it goes through
        (lambda t: 2.0 * np.exp(50.0 - t) - 0.7 * gap(t, 71.0, 3.0), 71.0),  # it overshoots
        (lambda t: 0.3 + 1.7 * np.exp(50.0 - t) + 0.5 * gap(t, 77.0, 3.0), 77.0),  # never there
        (lambda t: np.where(t < 57.05, 2.0 - 0.47 * (t - 50.0), 0.0), 57.0),  # then exactly there
        (lambda t: 2.0 + 0.01 * (t - 50.0), 100.0),  # it goes away
    ],
)
def test_what_a_corner_leaves_is_no_distance_that_a_run_comes_to(after, instant):
    """A leg that begins at 50 s with 2 m, the radius of acceptance."""
    begins = 50.0
    law = lambda t: np.where(t < begins, 0.1, after(np.maximum(t, begins)))  # noqa: E731
    runs = on_legs(leg=lambda t: np.where(t < begins, 0.0, 1.0), a=law)
    _, view, _ = drawn("trajectory", runs).axes
    assert title(view) == f"(b) farthest from the path, t = {instant:g} s"


def test_the_caption_names_what_any_panel_may_show():
    off = {"y": lambda t: np.sin(0.05 * t) + 4.0 * gap(t, 40.0, 5.0)}
    still = changed(recording(), x_d=np.zeros(1001), y_d=np.zeros(1001))
    cases = {
        "apart": shown(("the first run", recording()), ("b", recording(**off))),
        "alone": shown(("a", still)),
        "on a path": on_legs(a=lambda t: 3.0 + 0.0 * t, b=lambda t: 2.0 + 0.0 * t),
    }
    shows = {}
    for name, runs in cases.items():
        titles = (title(axes).partition(" ")[2] for axes in drawn("trajectory", runs).axes)
        shows[name] = [re.sub(r" \d+ times as large|, t = .*", "", words) for words in titles]
    assert shows == {
        "apart": ["hulls", "largest gap", "end", "from the first run"],
        "alone": ["hulls to scale", "end", "from the target"],
        "on a path": ["hulls", "farthest from the path", "from the path"],
    }
    caption = FIGURES["trajectory"].caption
    assert all(words in caption for titles in shows.values() for words in titles)
    path, other = re.search("on a path (.*?), else (.*?);", caption).groups()
    assert "end" not in path
    assert "end" in other


def test_a_run_that_diverges_does_not_set_the_limits_of_the_map():
    wild = recording(end=60.0, status="diverged", x=lambda t: -10.0 + np.exp(t))
    runs = shown(("good", recording()), ("bad", wild))
    whole = drawn("trajectory", runs).axes[0]
    assert whole.get_ylim()[1] < 60.0
    assert line(whole, "bad").get_ydata()[-1] > 1e20


def test_every_differing_target_is_drawn_and_named():
    runs = different_targets()
    whole, *_, end, _ = drawn("trajectory", runs).axes
    labels = [curve.get_label() for curve in whole.lines if "target" in curve.get_label()]
    assert labels == ["target of a, c", "target of b, d"]
    second = line(whole, "target of b, d")
    assert np.array_equal(second.get_ydata(), runs[1].recording["x_d"])
    assert np.array_equal(second.get_xdata(), runs[1].recording["y_d"])
    assert second.get_color() == line(whole, "target of a, c").get_color() == "#444444"
    assert second.get_linestyle() != line(whole, "target of a, c").get_linestyle()
    assert whole.get_xlim()[1] > 30.0
    assert whole.get_ylim()[0] < -50.0
    assert [curve.get_label() for curve in end.lines[:-1]] == ["target of a, c", "a", "c"]
    assert end.lines[-1].get_label() == "target of a, c at this time"


# --- the animation, by its data


def staged(runs):
    axes = Figure().add_subplot()
    return axes, animation.draw_scene(axes, runs)


def test_frames_run_evenly_from_the_start_to_the_end_of_the_longest_run():
    runs = shown(("short", recording(end=30.0)), ("long", recording()))
    times = animation.frame_times(runs)
    assert (times[0], times[-1], len(times)) == (0.0, 100.0, 120)
    assert np.diff(times) == pytest.approx(np.full(119, 100.0 / 119))


@pytest.mark.parametrize("t", [0.0, 12.3, 50.0, 100.0])
def test_a_frame_shows_vessels_tracks_and_target_at_its_instant(two, t):
    axes, move = staged(two)
    move(t)
    row = round(t * 10)
    scale = enlargement(two)
    for (bow, stern, _), run in zip(hulls(axes), two, strict=True):
        ahead, behind = expected_hull(run.recording, t, scale)
        assert bow == pytest.approx(ahead)
        assert stern == pytest.approx(behind)
        track = line(axes, run.label)
        assert (track.get_xdata()[0], track.get_ydata()[0]) == (
            run.recording["y"][0],
            run.recording["x"][0],
        )
        assert track.get_xdata()[-1] == run.recording["y"][row]
        assert track.get_ydata()[-1] == run.recording["x"][row]
        assert np.isin(track.get_ydata(), run.recording["x"][: row + 1]).all()
    log = two[0].recording
    (dot,) = (curve for curve in axes.lines if curve.get_marker() == "o")
    assert (dot.get_xdata()[0], dot.get_ydata()[0]) == (log["y_d"][row], log["x_d"][row])
    assert axes.get_title() == f"t = {t:5.1f} s, hulls {scale:.0f} times as large"


def test_an_animation_is_a_map_with_every_target():
    runs = different_targets()
    axes, move = staged(runs)
    move(40.0)
    dots = [curve for curve in axes.lines if curve.get_marker() == "o"]
    assert [dot.get_ydata()[0] for dot in dots] == pytest.approx([20.0, -20.0])
    assert np.array_equal(line(axes, "target of b, d").get_ydata(), runs[1].recording["x_d"])
    assert (axes.get_xlim(), axes.get_ylim()) == tuple(map(pytest.approx, bounds(runs)))
    assert axes.get_aspect() == 1.0
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("$y$ [m], east", "$x$ [m], north")
    assert set("abcd") < set(axes.get_legend_handles_labels()[1])


def test_a_run_that_has_ended_stays_pale_where_it_was():
    runs = shown(("short", recording(end=30.0)), ("long", recording()))
    axes, move = staged(runs)
    move(80.0)
    bow, _, _ = hulls(axes)[0]
    assert bow == pytest.approx(expected_hull(runs[0].recording, 30.0, enlargement(runs))[0])
    assert axes.patches[0].get_alpha() < 0.5
    assert axes.patches[1].get_alpha() == 1.0
    move(10.0)
    assert axes.patches[0].get_alpha() == 1.0


def test_the_close_up_of_a_film_goes_with_the_first_target_and_has_hulls_to_scale(two):
    axes = Figure().add_subplot()
    move = animation.draw_scene(axes, two, near=True)
    for t in (20.0, 70.0):
        move(t)
        log, row = two[0].recording, round(10 * t)
        assert np.mean(axes.get_xlim()) == pytest.approx(log["y_d"][row])
        assert np.mean(axes.get_ylim()) == pytest.approx(log["x_d"][row])
        assert np.ptp(axes.get_xlim()) == pytest.approx(12.0 * LENGTH)
        assert hulls(axes)[1][0] == pytest.approx(expected_hull(two[1].recording, t, 1.0)[0])


def test_a_film_is_an_mp4_where_ffmpeg_is_there(monkeypatch):
    for tool, name in ((None, "animation.gif"), ("/usr/bin/ffmpeg", "animation.mp4")):
        monkeypatch.setattr(animation.shutil, "which", lambda _, tool=tool: tool)
        assert animation.file_name() == name


@pytest.mark.skipif(not shutil.which("ffmpeg"), reason="makes an MP4 with ffmpeg")
@pytest.mark.slow
def test_an_mp4_is_the_same_for_the_same_runs(two, monkeypatch):
    monkeypatch.setattr(animation, "FRAMES", 3)
    film = animation.animate(two, animation.MP4)
    assert film[4:8] == b"ftyp"
    assert animation.animate(two, animation.MP4) == film


@pytest.mark.slow
def test_a_film_has_a_picture_for_every_frame_and_the_same_bytes_twice(two, monkeypatch):
    monkeypatch.setattr(animation, "FRAMES", 4)
    first, second = animation.animate(two, animation.GIF), animation.animate(two, animation.GIF)
    assert first == second
    with Image.open(io.BytesIO(first)) as film:
        pictures = []
        assert (film.n_frames, film.info["duration"], film.info["loop"]) == (4, 80, 0)
        for number in range(4):
            film.seek(number)
            pictures.append(np.asarray(film.convert("L")))
    assert pictures[0].shape == (440, 770)
    assert all(np.any(a != b) for a, b in pairwise(pictures))
