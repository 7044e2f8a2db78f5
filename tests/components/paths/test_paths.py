"""Paths: derivatives, breaks, the three readings of (53), and splines through waypoints."""

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from conftest import example, kinds, target_at
from pydantic import ValidationError
from rotation import one_in
from scipy.interpolate import CubicSpline

from podusv_cli.components.paths.base import Path
from podusv_cli.components.paths.circle import Circle
from podusv_cli.components.paths.ellipse import Ellipse
from podusv_cli.components.paths.figure_eight import FigureEight
from podusv_cli.components.paths.line import Line
from podusv_cli.components.paths.line_circle import LineCircle
from podusv_cli.components.paths.sinusoid import Sinusoid
from podusv_cli.components.paths.waypoints import Waypoints
from podusv_cli.core.signal import PSI_D

POINTS = ((0.0, 0.0), (5.0, 1.0), (8.0, 6.0), (8.0, 12.0), (3.0, 15.0))
ORDERS = ("position", "velocity", "acceleration")

PATHS: dict[str, Any] = {
    name: example(kind)
    for name, kind in kinds("paths").items()
    if issubclass(kind, Path) and not kind.follows
} | {
    "literal": LineCircle(reading="literal"),
    "sine": LineCircle(reading="sine"),
    "velocity, other speed": LineCircle(speed=0.4),
    "early switch": LineCircle(switch=20.0),
    "port circle": Circle(turn="port", x=3.0, angle=1.0),
    "oblique line": Line(course=2.0, x=1.0, y=-4.0),
    "bends": Waypoints(points=POINTS),
    "corners": Waypoints(points=POINTS, legs="straight"),
    "a point on a straight leg": Waypoints(points=((0, 0), (5, 0), (9, 0)), legs="straight"),
    "corners and a stop": Waypoints(points=POINTS, legs="straight", after="stop"),
    "oblique sine": Sinusoid(course=2.0, x=1.0, y=-4.0),
    "oblique ellipse to port": Ellipse(x=2.0, angle=0.7, length=4.0, breadth=9.0, turn="port"),
    "two points": Waypoints(points=POINTS[:2]),
    "a stop": Waypoints(points=POINTS, after="stop"),
    "a loop": Waypoints(points=POINTS, after="loop"),
    "a loop of two points": Waypoints(points=POINTS[:2], after="loop"),
    "a closed loop": Waypoints(points=(*POINTS, POINTS[0]), after="loop"),
}
every_path = pytest.mark.parametrize("path", PATHS.values(), ids=PATHS.keys())


def jumps(path: Path, until: float) -> Iterator[tuple[float, str]]:
    """Times where a component of the target jumps, found by bisection, and the lowest that does."""
    for start in np.arange(0.0, until, 2.0):
        for axes, order in zip((slice(0, 2), slice(2, 4), slice(4, 6)), ORDERS, strict=True):
            low, high = start, start + 2.0
            for _ in range(36):
                middle = 0.5 * (low + high)
                a, b, c = (target_at(path, t)[axes] for t in (low, middle, high))
                low, high = (low, middle) if abs(b - a).sum() > abs(c - b).sum() else (middle, high)
                if abs(b - a).max() + abs(c - b).max() < 1e-6:  # too little for a jump
                    break
            if abs(target_at(path, high) - target_at(path, low))[axes].max() > 1e-6:
                yield 0.5 * (low + high), order
                break


@pytest.mark.parametrize("path", one_in(2, [*PATHS.values()]), ids=PATHS.keys())
def test_breaks_are_exactly_the_jumps(path):
    found = list(jumps(path, 130.0))
    stated = [(known.time, known.what) for known in path.breaks()]
    assert [order for _, order in found] == [order for _, order in stated]
    assert [t for t, _ in found] == pytest.approx([t for t, _ in stated], abs=1e-9)


@every_path
def test_velocity_and_acceleration_are_derivatives(path):
    h = 1e-3
    broken = [known.time for known in path.breaks()]
    for t in np.random.default_rng(3).uniform(h, 150.0, 200):
        if any(abs(t - time) < 3 * h for time in broken):
            continue
        before, now, after = (target_at(path, t + shift) for shift in (-h, 0.0, h))
        np.testing.assert_allclose(now[2:], (after - before)[:4] / (2 * h), atol=2e-6)


@every_path
def test_the_heading_s_rates_are_derivatives_and_a_course_is_its_heading(path):
    h, times = 1e-3, np.random.default_rng(4).uniform(0.01, 150.0, 100)
    rows = [path.whole_targets(times + shift)[:, PSI_D:] for shift in (-h, 0.0, h)]
    if not path.heads:
        assert not np.any(rows)
        return
    slopes = (rows[2] - rows[0])[:, :2] / (2 * h)
    np.testing.assert_allclose(rows[1][:, 1:], slopes, atol=2e-6)
    if isinstance(path, Ellipse):
        x, y = path.whole_targets(times)[:, 2:4].T
        np.testing.assert_allclose(np.cos(rows[1][:, 0]), x / np.hypot(x, y), atol=1e-12)
        np.testing.assert_allclose(np.sin(rows[1][:, 0]), y / np.hypot(x, y), atol=1e-12)


def test_the_straight_part_is_the_first_line_of_53():
    for reading in ("literal", "velocity", "sine"):
        for t in (0.0, 37.5, 100.0):
            found = target_at(LineCircle(reading=reading), t)
            np.testing.assert_array_equal(found, [0.5 * t, 0, 0.5, 0, 0, 0])


def test_the_literal_reading_is_the_second_line_of_53_and_jumps_half_a_metre():
    path = LineCircle(reading="literal")
    for s in (0.25, 20.0, 150.0):
        expected = [50 + 0.5 * math.cos(0.03 * s), 0.5 * math.sin(0.03 * s)]
        np.testing.assert_allclose(target_at(path, 100 + s)[:2], expected, rtol=1e-12)
    gap = target_at(path, 100 + 1e-9) - target_at(path, 100.0)
    assert math.hypot(gap[0], gap[1]) == pytest.approx(0.5, abs=1e-8)
    assert math.hypot(*target_at(path, 170.0)[2:4]) == pytest.approx(0.015)


def test_the_velocity_reading_is_the_printed_terms_integrated():
    path = LineCircle()
    for s in (1e-6, 20.0, 150.0):
        now = target_at(path, 100 + s)
        np.testing.assert_allclose(
            now[2:4], 0.5 * np.array([math.cos(0.03 * s), math.sin(0.03 * s)])
        )
        assert math.hypot(now[0] - 50, now[1] - 0.5 / 0.03) == pytest.approx(0.5 / 0.03, rel=1e-12)
    turned = 100 + 2 * math.pi / 0.03
    assert turned == pytest.approx(309.4395, abs=1e-4)
    np.testing.assert_allclose(target_at(path, turned)[:4], [50, 0, 0.5, 0], atol=1e-10)


def test_only_the_sine_reading_keeps_the_speed_along_x():
    times = np.linspace(0, 309, 200)
    speeds = {
        reading: {round(target_at(LineCircle(reading=reading), t)[2], 12) for t in times}
        for reading in ("literal", "velocity", "sine")
    }
    assert speeds["sine"] == {0.5}
    assert len(speeds["literal"]) > 2
    assert len(speeds["velocity"]) > 2


@pytest.mark.parametrize(("turn", "sense"), [("starboard", 1.0), ("port", -1.0)])
def test_a_circle_turns_the_named_way_at_constant_speed(turn, sense):
    path = Circle(x=1.0, y=-2.0, radius=8.0, speed=0.4, turn=turn)
    for t in np.linspace(0, 200, 50):
        now = target_at(path, t)
        assert math.hypot(now[0] - 1, now[1] + 2) == pytest.approx(8.0, rel=1e-12)
        assert math.hypot(now[2], now[3]) == pytest.approx(0.4, rel=1e-12)
        # Positive where the heading grows, x north and y east: to starboard.
        assert np.sign(now[2] * now[5] - now[3] * now[4]) == sense


def test_a_spline_passes_its_points_when_chords_at_speed_would():
    path = Waypoints(points=POINTS, speed=0.8)
    chords = [math.dist(a, b) for a, b in pairwise(POINTS)]
    knots = np.concatenate([[0.0], np.cumsum(chords)]) / 0.8
    for knot, point in zip(knots, POINTS, strict=True):
        np.testing.assert_allclose(target_at(path, knot)[:2], point, atol=1e-12)
    natural = CubicSpline(knots, POINTS, bc_type="natural")
    for t in np.random.default_rng(5).uniform(0, knots[-1], 50):
        expected = np.concatenate([natural(t), natural(t, 1), natural(t, 2)])
        np.testing.assert_allclose(target_at(path, t), expected, atol=1e-12)


def test_after_the_last_point_the_target_goes_straight_on():
    path = Waypoints(points=POINTS)
    end = sum(math.dist(a, b) for a, b in pairwise(POINTS)) / 0.5
    last = target_at(path, end)
    np.testing.assert_allclose(last[4:], 0.0, atol=1e-12)
    later = target_at(path, end + 40.0)
    np.testing.assert_allclose(later[:2], last[:2] + 40.0 * last[2:4], rtol=1e-12)
    np.testing.assert_array_equal(later[2:], [*last[2:4], 0.0, 0.0])


def test_after_the_last_point_the_target_may_stop():
    path = Waypoints(points=POINTS, after="stop")
    ((end, _),) = [(known.time, known.what) for known in path.breaks()]
    assert end == pytest.approx(sum(math.dist(a, b) for a, b in pairwise(POINTS)) / 0.5)
    for t in (end + 1e-9, end + 40.0):
        np.testing.assert_allclose(target_at(path, t), [*POINTS[-1], 0, 0, 0, 0], atol=1e-12)
    before = target_at(Waypoints(points=POINTS), 0.7 * end)
    np.testing.assert_array_equal(target_at(path, 0.7 * end), before)


def test_after_the_last_point_the_target_may_go_round_again():
    path, closed = (Waypoints(points=p, after="loop") for p in (POINTS, (*POINTS, POINTS[0])))
    period = sum(math.dist(a, b) for a, b in pairwise((*POINTS, POINTS[0]))) / 0.5
    for t in np.random.default_rng(5).uniform(0, period, 20):
        once = target_at(path, t)
        np.testing.assert_allclose(target_at(path, t + 3 * period), once, atol=1e-9)
        np.testing.assert_array_equal(target_at(closed, t), once)
    np.testing.assert_allclose(target_at(path, period - 1e-9), target_at(path, 0.0), atol=1e-8)


def test_two_points_make_a_line():
    straight = Line(course=math.atan2(3, 4), speed=0.5)
    path = Waypoints(points=((0.0, 0.0), (4.0, 3.0)))
    for t in (0.0, 3.3, 10.0, 55.0):
        np.testing.assert_allclose(target_at(path, t), target_at(straight, t), atol=1e-12)


@pytest.mark.parametrize("points", [(), ((1.0, 2.0),), ((0.0, 0.0), (1.0, 1.0), (1.0, 1.0))])
def test_points_without_a_way_are_refused(points):
    with pytest.raises(ValidationError):
        Waypoints(points=points)


FAR = ((0.0, 0.0), (1e200, 1e200), (2e200, 0.0))


@pytest.mark.parametrize(
    "wrong",
    [{"points": FAR}, {"speed": 1e300}, {"speed": 5e-324}, {"speed": 5e-324, "legs": "straight"}],
)
def test_a_course_beyond_all_numbers_is_refused(wrong):
    with pytest.raises(ValueError, match="beyond all numbers"):
        Waypoints(**{"points": POINTS} | wrong)


def test_a_sine_stays_within_its_amplitude_and_returns_to_its_axis_every_half_wavelength():
    path = Sinusoid(x=2.0, y=1.0, course=0.7, speed=0.4, amplitude=2.5, wavelength=20.0)
    seen = path.targets(np.linspace(0.0, 100.0, 4001))[:, :2] - (2.0, 1.0)
    along, across = seen @ (np.cos(0.7), np.sin(0.7)), seen @ (-np.sin(0.7), np.cos(0.7))
    np.testing.assert_allclose(along, 0.4 * np.linspace(0.0, 100.0, 4001), atol=1e-12)
    assert np.abs(across).max() == pytest.approx(2.5, rel=1e-6)
    np.testing.assert_allclose(across[::1000], 0.0, atol=1e-12)
    assert across[500] > 0  # to starboard first


def test_a_figure_eight_is_the_lemniscate_of_gerono_with_the_stated_speeds():
    path = FigureEight(x=3.0, y=-2.0, length=20.0, breadth=8.0, period=120.0)
    seen = path.targets(np.linspace(0.0, 120.0, 4801))
    north, east = (seen[:, 0] - 3.0) / 10.0, (seen[:, 1] + 2.0) / 4.0
    np.testing.assert_allclose(east**2, 4 * north**2 * (1 - north**2), atol=1e-12)
    speed, rate = np.hypot(*seen[:, 2:4].T), 2 * math.pi / 120.0
    assert speed[0] == pytest.approx(rate * math.hypot(10.0, 8.0))
    assert speed[1200] == pytest.approx(rate * 8.0)
    assert np.ptp(seen[:, :2], axis=0) == pytest.approx([20.0, 8.0], rel=1e-5)


def test_straight_legs_pass_every_point_at_the_given_speed():
    path = Waypoints(points=POINTS, speed=0.4, legs="straight")
    knots = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(POINTS, axis=0).T))]) / 0.4
    np.testing.assert_allclose(path.targets(knots)[:, :2], POINTS, atol=1e-12)
    between = path.targets(np.linspace(0.0, 0.999 * knots[-1], 101))
    np.testing.assert_allclose(np.hypot(*between[:, 2:4].T), 0.4, rtol=1e-12)


def test_a_square_has_a_corner_at_each_point_the_first_included():
    square = Waypoints(
        points=((0, 0), (8, 0), (8, 8), (0, 8)), speed=0.5, legs="straight", after="loop"
    )
    assert [known.time for known in square.breaks()] == pytest.approx([16.0, 32.0, 48.0, 64.0])
    assert {known.what for known in square.breaks()} == {"velocity"}
    before, after = square.targets((63.9999, 64.0001))[:, 2:4]
    np.testing.assert_allclose([before, after], [[0.0, -0.5], [0.5, 0.0]], atol=1e-12)
