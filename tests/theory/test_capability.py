"""Loads that are held at rest: known polars, a plain balance of forces, and runs beside them."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from pose_samples import marched

from podusv_cli.core.errors import UsageError
from podusv_cli.scenario.load import load, load_text
from podusv_cli.theory.capability import HEALTHY, capability

CYBERSHIP = {
    "vessel": {"preset": "cybership2"},
    "actuator": {"kind": "saturated_full"},
    "disturbance": {"kind": "none"},
    "path": {"kind": "hold"},
    "start": {"x": 0.0, "y": 0.0, "psi": 0.0},
    "controller": {"kind": "pose_pid"},
    "simulation": {"step": 0.02, "duration": 600.0},
}
THRUSTERS = load("podusv:dp/thrusters.yaml").scenario
PODS = {"kind": "pod", "preset": "cybership2_thrusters", "sway_weight": 1.0}
PROPELLERS = [
    {
        "x": -0.5,
        "y": y,
        "T_nn": 3.65e-3,
        "T_nn_astern": 3.65e-3,
        "n_max": 33.0,
        "n_max_astern": 33.0,
        "n_rate": 200.0,
        "n_lag": 0.1,
        "angle_limit": 0.0,
    }
    for y in (-0.1, 0.1)
]
ALONG = {"controller": {"kind": "pid"}, "path": {"kind": "line", "speed": 0.0}}  # of two demands
LOST = THRUSTERS.actuator.without_each()["pods[2]"].model_dump(mode="json")  # the bow tunnel


def held(load_kind, degrees, scenario):
    """What is held from these directions, by set of thrusters."""
    own = scenario
    if isinstance(scenario, dict):
        own = load_text(yaml.safe_dump(scenario), "s.yaml").scenario
    angles = np.radians(np.asarray(degrees, float))
    found = capability(own.vessel, own.actuator, load_kind, angles, own=own.sea)
    return found.held


AROUND = np.arange(0.0, 360.0, 15.0)


def test_three_limits_hold_the_forces_of_a_box():
    cosine, sine = np.abs(np.cos(np.radians(AROUND))), np.abs(np.sin(np.radians(AROUND)))
    box = CYBERSHIP | {"actuator": {"kind": "saturated_full", "surge_limit": 3, "sway_limit": 1.5}}
    with np.errstate(divide="ignore"):
        expected = np.minimum(3.0 / cosine, 1.5 / sine)
    np.testing.assert_allclose(held("force", AROUND, box)[HEALTHY], expected, rtol=2e-3)


def test_two_pods_that_turn_every_way_hold_a_circle_and_one_of_them_a_line():
    """milliAmpere: 500 N each at arms of 1.8 m, so halves of the force make no moment."""
    ferry = load("podusv:dp/ferry.yaml").scenario
    found = held("force", AROUND, ferry)
    np.testing.assert_allclose(found[HEALTHY], 1000.0, rtol=2e-3)
    line = np.where(AROUND % 180.0 == 0.0, 500.0, 0.0)
    for lost in ("pods[0]", "pods[1]"):
        np.testing.assert_allclose(found[f"without {lost}"], line, rtol=2e-3)


def balance(hull, speed, angle):
    """Loads (3,) of a current from this direction on a hull at rest, term by term."""
    u, v = speed * math.cos(angle), speed * math.sin(angle)  # through the water
    m11, m22 = hull.m - hull.X_udot, hull.m - hull.Y_vdot
    X = (hull.X_u + hull.X_uu * abs(u) + hull.X_uuu * u * u) * u
    Y = (hull.Y_v + hull.Y_vv * abs(v)) * v
    N = (hull.N_v + hull.N_vv * abs(v)) * v + (m11 - m22) * u * v  # Munk's moment
    return np.array([X, Y, N])


def test_a_current_is_held_as_far_as_the_first_of_three_limits_goes():
    """By steps of speed along each direction, until a balance needs more than a limit."""
    hull, limits = load_text(yaml.safe_dump(CYBERSHIP), "s.yaml").scenario.vessel, (2.0, 2.0, 1.5)
    speeds = np.arange(0.0, 1.0, 2e-4)
    first = [
        next(s for s in speeds if (np.abs(balance(hull, s, angle)) > limits).any())
        for angle in np.radians(AROUND)
    ]
    np.testing.assert_allclose(held("current", AROUND, CYBERSHIP)[HEALTHY], first, rtol=3e-3)


@settings(max_examples=10)
@given(direction=st.floats(0.05, 0.45), at=st.floats(1.0, 10.0))
def test_a_wind_from_the_side_is_held_up_to_the_root_of_the_sway_force(direction, at):
    """Y = rho/2 V^2 CD_t A_L from abeam; V at 10 m is more by the profile."""
    wide = CYBERSHIP | {"disturbance": {"kind": "wind", "speed": 1.0, "at": at}}
    one = load_text(yaml.safe_dump(wide), "s.yaml").scenario
    air = one.vessel.windage
    at_height = math.sqrt(2.0 * 2.0 / (1.225 * air.CD_t * air.A_L))
    share = 1.0 + 2.5 * math.sqrt(0.0026) * math.log(at / 10.0)
    assert held("wind", [90.0], one)[HEALTHY][0] == pytest.approx(at_height / share, rel=2e-3)


def test_an_underactuated_vessel_holds_loads_along_its_keel_alone():
    kept = CYBERSHIP | {"actuator": {"kind": "saturated", "surge_limit": 8.0}} | ALONG
    found = held("force", [0.0, 1.0, 90.0, 179.0, 180.0], kept)[HEALTHY]
    np.testing.assert_allclose(found, [8.0, 0.0, 0.0, 0.0, 8.0], rtol=2e-3)


def test_what_does_nothing_to_a_hull_is_held_without_limit():
    slippery = {"preset": "cybership2_linear", "X_u": 0.0}
    found = held("current", [0.0, 90.0], CYBERSHIP | {"vessel": slippery})[HEALTHY]
    assert found[0] == math.inf
    assert 0.0 < found[1] < 10.0


@pytest.mark.parametrize(
    ("sort", "degrees", "actuator"),
    [
        pytest.param("current", 60.0, PODS, marks=pytest.mark.long),
        pytest.param("force", 40.0, LOST, marks=pytest.mark.long),
        ("wind", 130.0, {"kind": "saturated_full"}),
    ],
)
def test_a_run_holds_just_below_and_drifts_away_just_above(sort, degrees, actuator):
    angle = math.radians(degrees)
    given = CYBERSHIP | {"actuator": actuator}
    [size] = held(sort, [degrees], given)[HEALTHY]

    def left(part):
        s = part * float(size)
        load_of = {
            "current": {"kind": "current", "speed": s, "direction": angle + math.pi},
            "wind": {"kind": "wind", "speed": s, "direction": angle},
            "force": {
                "kind": "step",
                "ramp": 100.0,
                "b_u": -s * math.cos(angle),
                "b_v": -s * math.sin(angle),
            },
        }[sort]
        log = marched(yaml.safe_dump(given | {"disturbance": load_of}))
        away = np.hypot(log["x"], log["y"])
        return away[-1], away[3 * len(away) // 4]

    end, before = left(0.99)
    assert end <= before + 1e-9
    assert end < 1e-3
    end, before = left(1.01)
    assert end > 1.1 * before
    assert end > 0.5


def test_thrusters_feel_the_water_of_a_current():
    """Two fixed propellers ahead: X(V) = 2 (T_nn n^2 - T_nV n V), solved by halves."""
    pods = [one | {"T_nV": 0.03} for one in PROPELLERS]
    slowed = CYBERSHIP | {"actuator": {"kind": "pod", "pods": pods}} | ALONG
    hull = load_text(yaml.safe_dump(slowed), "s.yaml").scenario.vessel
    low, high = 0.0, 3.0
    for _ in range(50):
        V = 0.5 * (low + high)
        thrust = 2.0 * (3.65e-3 * 33.0**2 - 0.03 * 33.0 * V)
        low, high = (V, high) if thrust > -balance(hull, V, 0.0)[0] else (low, V)
    assert held("current", [0.0], slowed)[HEALTHY][0] == pytest.approx(low, rel=3e-3)


def test_a_small_weight_of_the_sway_force_costs_no_capability():
    """The allocation then leaves a part of it, which the demand makes up for."""
    ferry = load("podusv:dp/ferry.yaml", ["actuator.sway_weight=0.001"]).scenario
    assert held("force", [90.0], ferry)[HEALTHY][0] == pytest.approx(1000.0, rel=5e-3)


def test_the_ship_of_the_page_holds_what_the_page_says():
    page = Path(__file__).parents[2].joinpath("docs/capability.md").read_text()
    found = held("current", [0.0, 90.0, 130.0], THRUSTERS)
    ahead, _, least = found[HEALTHY]
    _, abeam, aft = found["without pods[2]"]
    assert f"holds {ahead:.2f} m/s from ahead and {least:.2f} m/s from anywhere" in page
    assert f"{abeam:.2f} m/s from abeam, and none at 130 deg" in page
    assert aft == 0.0


def test_what_has_no_limit_and_what_the_wind_cannot_act_on_are_refused():
    with pytest.raises(UsageError, match="ideal_full has no limits, so it holds every load"):
        held("force", [0.0], CYBERSHIP | {"actuator": {"kind": "ideal_full"}})
    bare = {"vessel": {"preset": "cybership2", "windage": None}}
    with pytest.raises(UsageError, match="the vessel has no windage"):
        held("wind", [0.0], CYBERSHIP | bare)


def test_what_cannot_be_allocated_without_the_main_propeller_has_no_number():
    """Two tunnels hold a force from abeam, though they steer no ship by themselves: 0 is untrue."""
    tunnel = PROPELLERS[0] | {"y": 0.0, "mount": "90 deg", "T_nn": 1e-3, "T_nn_astern": 1e-3}
    pods = [PROPELLERS[0] | {"y": 0.0}, tunnel | {"x": -0.4}, tunnel | {"x": 0.4}]
    actuator = {"kind": "pod", "pods": pods, "sway_weight": 1.0}
    found = held("force", [0.0, 90.0], CYBERSHIP | {"actuator": actuator})
    assert found[HEALTHY][1] == pytest.approx(2.0 * 1e-3 * 33.0**2, rel=2e-3)
    assert np.isnan(found["without pods[0]"]).all()
