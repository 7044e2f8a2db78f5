"""The animation, by its data: positions, headings, limits, instants."""

import io
from itertools import pairwise

import numpy as np
import pytest
from drawn_samples import different_targets, expected_hull, hulls, line, recording, shown
from matplotlib.figure import Figure
from PIL import Image

from podusv_cli.figures import animation
from podusv_cli.figures.trajectory import bounds, enlargement


@pytest.fixture(scope="module")
def two():
    return shown(("a", recording()), ("b", recording(shift=0.7)))


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


@pytest.mark.slow
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
