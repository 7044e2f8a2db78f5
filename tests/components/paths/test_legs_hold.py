"""Legs whose last waypoint is held: targets by hand, boats in a current, what stays as it is."""

import math

import numpy as np
import pytest

import podusv
from podusv_cli.components.paths.legs_hold import LegsHold
from podusv_cli.core.kernel import bundle, call

SOURCE = "podusv:laws/legs_hold.yaml"
END = (40.0, 30.0)


def boat(law, **changes):
    task = {"controllers": None, "controller": {"kind": law}}
    return podusv.simulate(SOURCE, task | changes)


def away(run):
    """Distance to the last waypoint."""
    return np.hypot(run["x"] - END[0], run["y"] - END[1])


def aimed(x, y, course, **fields):
    """Target (6) of a boat at (x, y) that has done both legs."""
    path = LegsHold(points=((0, 0), (40, 0), END), speed=1.2, radius=4.0, **fields)
    target, k = np.full(6, np.nan), bundle(path.constants_with(0.5))
    place = np.array([2.0, 0.0, 0.0, course])
    call(path.evaluate, x=np.array([x, y]), place=place, k=k, table=path.table(), target=target)
    return target


@pytest.mark.parametrize(
    ("distance", "speed"), [(4.6, 0.3), (5.2, 0.6), (6.39, 1.195), (6.41, 1.2), (60.0, 1.2)]
)
def test_beyond_the_radius_the_speed_back_grows_with_the_distance(distance, speed):
    """0.5 (distance - 4), at most 1.2: half a metre ahead, straight to the waypoint."""
    angle = 2.3
    x, y = END[0] + distance * math.cos(angle), END[1] + distance * math.sin(angle)
    back = np.array([-math.cos(angle), -math.sin(angle)])
    target = aimed(x, y, 0.123)
    np.testing.assert_allclose(target[2:4], speed * back, atol=1e-12)
    np.testing.assert_allclose(target[:2], [x, y] + 0.5 * back, atol=2e-6)
    assert not target[4:].any()


def test_within_the_radius_the_target_rests_and_keeps_its_course():
    target = aimed(END[0] - 1.0, END[1] + 2.0, 0.7)
    assert math.hypot(*target[2:4]) < 1e-5
    assert math.atan2(target[3], target[2]) == pytest.approx(0.7)
    ahead = (target[0] - END[0] + 1.0, target[1] - END[1] - 2.0)
    np.testing.assert_allclose(ahead, [0.5 * math.cos(0.7), 0.5 * math.sin(0.7)], atol=2e-6)


def test_round_the_waypoint_the_target_goes_clockwise_at_the_speed():
    """Half a metre ahead on the circle is an angle of an eighth; 1.2^2/4 inwards."""
    angle = -1.9
    target = aimed(END[0] + 7.0 * math.cos(angle), END[1] + 7.0 * math.sin(angle), 0, hold="circle")
    c, s = math.cos(angle + 0.125), math.sin(angle + 0.125)
    wanted = [END[0] + 4 * c, END[1] + 4 * s, -1.2 * s, 1.2 * c, -0.36 * c, -0.36 * s]
    np.testing.assert_allclose(target, wanted, atol=1e-12)


@pytest.mark.parametrize("law", ["los_pid", "ardupilot", "velocity_vector"])
def test_a_boat_stays_about_the_waypoint_in_a_current(law):
    held = boat(law)
    late = held["time"] > held.metrics.path_time + 60.0
    assert away(held)[late].max() < 4.0 + 3.0
    gone = boat(law, **{"path.kind": "legs"})
    assert away(gone)[-1] > 200.0
    for name in ("x", "tau_u_cmd", "e_ct", "leg"):  # the way there is that of legs
        until = held["time"] < held.metrics.path_time
        np.testing.assert_array_equal(held[name][until], gone[name][until])
    named = {"path_time", "path_done", "e_ct_max", "e_ct_rms", "energy"}
    assert dict(held.metrics[[*named]]) == dict(gone.metrics[[*named]])


def test_the_course_is_that_of_the_last_leg_and_then_back_from_beyond_the_radius():
    run = boat("los_pid", **{"simulation.duration": 200.0})
    legs = {0: 0.0, 1: math.pi / 2}
    kept = None
    for leg, x, y, said in zip(*(run[n] for n in ("leg", "x", "y", "hold_course")), strict=True):
        if leg < 2:
            kept = legs[int(leg)]
        elif math.hypot(x - END[0], y - END[1]) > 4.0:
            kept = math.atan2(END[1] - y, END[0] - x)
        assert said == pytest.approx(kept, abs=1e-12)
    assert len(np.unique(run["hold_course"])) > 100


def test_a_boat_goes_round_the_waypoint_at_the_radius():
    """In calm water a round of 2 pi 4 m takes 25.1 s at 1 m/s."""
    calm = {"disturbance": {"kind": "none"}, "path.hold": "circle"}
    run = boat("momentum_vector", **calm)
    late = run["time"] > 250.0
    assert away(run)[late] == pytest.approx(4.0, abs=0.05)
    angle = np.unwrap(np.arctan2(run["y"] - END[1], run["x"] - END[0])[late])
    turn = (angle[-1] - angle[0]) / (run["time"][late][-1] - run["time"][late][0])
    assert turn == pytest.approx(1.0 / 4.0, rel=0.02)


def test_the_radius_follows_from_the_hull_where_none_is_given():
    path = podusv.load(SOURCE, {"path.radius": None, "path.acceptance": None}).path
    assert path.radius == path.acceptance > 0.0
    assert {*path.by_rule} == {"radius", "acceptance"}
