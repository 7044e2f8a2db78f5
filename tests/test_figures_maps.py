"""The map of the tracks and the animation, by their data: positions, headings, limits, instants."""

import io
from itertools import pairwise

import numpy as np
import pytest
from drawn_samples import changed, drawn, line, recording, scenario, shown
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle
from PIL import Image

from podusv_cli.figures import animation
from podusv_cli.figures.trajectory import bounds, enlargement, hull

LENGTH = scenario().vessel.length


@pytest.fixture(scope="module")
def two():
    return shown(("a", recording()), ("b", recording(shift=0.7)))


def hulls(axes):
    """Bow, middle of the stern and colour of every silhouette."""
    corners = [(p.get_xy()[:5], p.get_edgecolor()) for p in axes.patches if isinstance(p, Polygon)]
    return [(xy[0], (xy[2] + xy[3]) / 2.0, color) for xy, color in corners]


def expected_hull(log, t, scale):
    """Bow and stern [east, north] of the vessel at a time, independent of `hull`."""
    row = np.argmin(np.abs(log["time"] - t))
    middle = np.array([log["y"][row], log["x"][row]])
    ahead = 0.5 * scale * LENGTH * np.array([np.sin(log["psi"][row]), np.cos(log["psi"][row])])
    return middle + ahead, middle - ahead


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


def test_a_map_leaves_a_small_margin_around_tracks_and_target(two):
    east, north = bounds(two)
    tracks = [(run.recording["y"], run.recording["x"]) for run in two]
    tracks.append((two[0].recording["y_d"], two[0].recording["x_d"]))
    y, x = (np.concatenate(parts) for parts in zip(*tracks, strict=True))
    margin = 0.06 * np.ptp(x)
    assert east == pytest.approx((y.min() - margin, y.max() + margin))
    assert north == pytest.approx((x.min() - margin, x.max() + margin))
    whole = drawn("trajectory", two).axes[0]
    assert whole.get_xlim() == pytest.approx(east)
    assert whole.get_ylim() == pytest.approx(north)


def test_silhouettes_stand_where_the_vessels_are_and_point_where_they_head(two):
    whole = drawn("trajectory", two).axes[0]
    scale = enlargement(two)
    found = hulls(whole)
    assert len(found) == 2 * 9
    times = np.tile(np.arange(9) * 12.5, 2)
    for (bow, stern, color), t, run in zip(found, times, np.repeat(two, 9), strict=True):
        ahead, behind = expected_hull(run.recording, t, scale)
        assert bow == pytest.approx(ahead)
        assert stern == pytest.approx(behind)
        assert color == to_rgba(run.color)
    assert whole.get_title() == f"hulls every 12.5 s, {scale:.0f} times as large"


def test_hulls_are_enlarged_to_a_twentieth_of_the_target_s_way(two):
    log = two[0].recording
    spread = np.ptp(log["x_d"]) + np.ptp(log["y_d"])
    assert enlargement(two) == round(0.05 * spread / LENGTH)
    assert enlargement(two) > 1
    still = changed(log, x_d=np.zeros(1001), y_d=np.zeros(1001))
    assert enlargement(shown(("a", still))) == 1.0


def test_a_hull_has_its_bow_ahead_and_its_beam_across():
    north = hull(0.0, 0.0, 0.0, length=2.0, beam=0.5)
    assert north[0] == pytest.approx([0.0, 1.0])  # the bow: east 0, north 1
    assert np.ptp(north, axis=0) == pytest.approx([0.5, 2.0])
    east = hull(3.0, 4.0, np.pi / 2, length=2.0, beam=0.5)
    assert east[0] == pytest.approx([5.0, 3.0])
    starboard = hull(0.0, 0.0, 0.0, length=2.0, beam=0.5)[1]
    assert starboard[0] > 0.0
    assert east[1][1] < 3.0  # heading east, starboard is south


def test_silhouettes_of_a_short_run_stand_at_the_same_instants():
    runs = shown(("long", recording()), ("short", recording(end=30.0, status="diverged")))
    found = hulls(drawn("trajectory", runs).axes[0])
    assert len(found) == 9 + 3
    assert found[-1][0] == pytest.approx(
        expected_hull(runs[1].recording, 25.0, enlargement(runs))[0]
    )


def test_the_start_of_every_run_is_marked_once():
    runs = shown(("a", recording()), ("b", recording()), ("c", recording(shift=0.7)))
    start = line(drawn("trajectory", runs).axes[0], "start")
    marks = set(zip(start.get_xdata(), start.get_ydata(), strict=True))
    assert marks == {(r.recording["y"][0], r.recording["x"][0]) for r in runs}
    assert len(start.get_xdata()) == 2
    assert start.get_marker() == "o"


def test_the_close_up_shows_the_last_twentieth_to_scale(two):
    whole, end = drawn("trajectory", two).axes
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
    assert end.get_title() == "last 5 s, hulls to scale at t = 100 s, target +"
    assert end.get_aspect() == 1.0
    (box,) = (patch for patch in whole.patches if isinstance(patch, Rectangle))
    assert (box.get_x(), box.get_x() + box.get_width()) == pytest.approx(end.get_xlim())
    assert (box.get_y(), box.get_y() + box.get_height()) == pytest.approx(end.get_ylim())


@pytest.mark.parametrize(("away", "lengths"), [(0.1, 2.0), (1e4, 20.0)])
def test_the_close_up_is_neither_too_close_nor_too_far(away, lengths):
    log = recording()
    off = changed(log, x=log["x_d"] - away, y=log["y_d"])
    end = drawn("trajectory", shown(("a", off))).axes[1]
    assert np.ptp(end.get_xlim()) == pytest.approx(2.0 * lengths * LENGTH)


def test_the_close_up_marks_the_target_and_leaves_out_who_diverged():
    runs = shown(("good", recording()), ("bad", recording(end=60.0, status="diverged")))
    end = drawn("trajectory", runs).axes[1]
    (cross,) = (curve for curve in end.lines if curve.get_marker() == "+")
    log = runs[0].recording
    assert (cross.get_xdata()[0], cross.get_ydata()[0]) == (log["y_d"][-1], log["x_d"][-1])
    assert "bad" not in [curve.get_label() for curve in end.lines]
    assert len(hulls(end)) == 1


def test_the_close_up_of_runs_of_different_length_shows_one_instant():
    runs = shown(("long", recording()), ("short", recording(end=60.0)))
    end = drawn("trajectory", runs).axes[1]
    for (bow, _, _), run in zip(hulls(end), runs, strict=True):
        assert bow == pytest.approx(expected_hull(run.recording, 60.0, 1.0)[0])
    assert "at t = 60 s" in end.get_title()
    assert line(end, "long").get_ydata()[-1] == runs[0].recording["x"][600]


def test_a_run_that_diverges_does_not_set_the_limits_of_the_map():
    wild = recording(end=60.0, status="diverged", x=lambda t: -10.0 + np.exp(t))
    runs = shown(("good", recording()), ("bad", wild))
    whole = drawn("trajectory", runs).axes[0]
    assert whole.get_ylim()[1] < 60.0
    assert line(whole, "bad").get_ydata()[-1] > 1e20


def test_where_all_diverged_the_map_is_the_target_s():
    wild = recording(end=60.0, status="diverged", x=lambda t: -10.0 + np.exp(t))
    whole = drawn("trajectory", shown(("bad", wild))).axes[0]
    assert whole.get_ylim()[0] < -10.0
    assert 30.0 < whole.get_ylim()[1] < 60.0


def different_targets():
    turned = recording(x_d=lambda t: -0.5 * t, y_d=lambda t: 30.0 + 0.0 * t)
    other = scenario(rate=0.06)
    return shown(("a", recording()), ("b", turned, other), ("c", recording()), ("d", turned, other))


def test_every_differing_target_is_drawn_and_named():
    runs = different_targets()
    whole, end = drawn("trajectory", runs).axes
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
    assert end.get_title() == "last 5 s, hulls to scale at t = 100 s, target of a, c +"


def test_one_target_is_drawn_as_long_as_any_run_lasts():
    runs = shown(("short", recording(end=30.0, status="diverged")), ("long", recording()))
    target = line(drawn("trajectory", runs).axes[0], "target")
    assert target.get_ydata()[-1] == runs[1].recording["x_d"][-1]


def test_a_long_track_is_drawn_in_even_steps():
    (run,) = shown(("a", recording(period=0.01)))
    curve = line(drawn("trajectory", [run]).axes[0], "a")
    assert 2500 < len(curve.get_xdata()) <= 4000
    assert np.array_equal(curve.get_ydata(), run.recording["x"][::3])


def staged(runs):
    axes = Figure().add_subplot()
    return axes, animation.stage(axes, runs)


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


def test_a_film_has_a_picture_for_every_frame_and_the_same_bytes_twice(two, monkeypatch):
    monkeypatch.setattr(animation, "FRAMES", 4)
    first, second = animation.animate(two), animation.animate(two)
    assert first == second
    with Image.open(io.BytesIO(first)) as film:
        pictures = []
        assert (film.n_frames, film.info["duration"], film.info["loop"]) == (4, 80, 0)
        for number in range(4):
            film.seek(number)
            pictures.append(np.asarray(film.convert("L")))
    assert pictures[0].shape == (440, 440)
    assert all(np.any(a != b) for a, b in pairwise(pictures))
