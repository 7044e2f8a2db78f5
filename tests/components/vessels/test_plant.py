"""The vessel: kinematics (1)-(3), kinetics (4)-(7) and (12), and their exact solutions."""

import math
from typing import Any

import numpy as np
import pytest
from conftest import NONLINEAR, PAPER, VESSELS, Constant, adrift, run
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.optimize import root

from podusv_cli.components.disturbances.harmonic import Harmonic, HarmonicDisturbance
from podusv_cli.components.vessels.plant import plant, surge_force, sway_force, yaw_moment
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.kernel import bundle
from podusv_cli.core.kinematics import earth_velocity, wrap

speed = st.floats(-3, 3)
velocities = st.tuples(speed, speed, speed).map(np.array)
DAMPING = [name for name in Vessel.model_fields if name[0] in "XYN" and "dot" not in name]
# No two of its numbers alike, and no symmetry of the added mass: each must stand in its place.
UNLIKE = Vessel(
    **VESSELS["cybership2"].model_dump()
    | {"Y_rdot": -0.4, "N_vdot": -0.7, "x_g": 0.03}
    | {"coriolis": 0.3}
    | {name: -0.1 - 0.17 * place for place, name in enumerate(DAMPING)}
)
every_vessel = pytest.mark.parametrize("vessel", VESSELS.values(), ids=VESSELS.keys())


def accelerations(vessel: Vessel, nu: Any, load: Any = (0.0, 0.0, 0.0)) -> Any:
    """nu' from the plant kernel; the load goes in half as tau, half as b."""
    rate, half = np.full(6, np.nan), 0.5 * np.asarray(load)
    plant(np.concatenate([[1.0, 2.0, 0.3], nu]), half, half, bundle(vessel.constants()), rate)
    return rate[3:]


def inertia(p: Vessel) -> Any:
    """(5), with the added masses that symmetry does not make equal kept apart."""
    return np.array(
        [
            [p.m - p.X_udot, 0, 0],
            [0, p.m - p.Y_vdot, p.m * p.x_g - p.Y_rdot],
            [0, p.m * p.x_g - p.N_vdot, p.I_z - p.N_rdot],
        ]
    )


def coriolis(p: Vessel, nu: Any) -> Any:
    """(6), as much of it as the vessel has."""
    u, v, r = nu
    a_31 = (p.m - p.Y_vdot) * v + (p.m * p.x_g - p.Y_rdot) * r
    a_32 = -(p.m - p.X_udot) * u
    return p.coriolis * np.array([[0, 0, -a_31], [0, 0, -a_32], [a_31, a_32, 0]])


def damping(p: Vessel, nu: Any) -> Any:
    """(7), positive where it brakes, with the nonlinear derivatives."""
    u, v, r = nu
    V, R = abs(v), abs(r)
    return -np.array(
        [
            [p.X_u + p.X_uu * abs(u) + p.X_uuu * u**2, 0, 0],
            [0, p.Y_v + p.Y_vv * V + p.Y_rv * R, p.Y_r + p.Y_vr * V + p.Y_rr * R],
            [0, p.N_v + p.N_vv * V + p.N_rv * R, p.N_r + p.N_vr * V + p.N_rr * R],
        ]
    )


def balance(p: Vessel, nu: Any, load: Any) -> Any:
    """M nu' from (4)."""
    return np.asarray(load) - (coriolis(p, nu) + damping(p, nu)) @ nu


def without_cross_damping(p: Vessel) -> Vessel:
    crossed = ("Y_rv", "Y_r", "Y_vr", "Y_rr", "N_v", "N_vv", "N_rv", "N_vr")
    return p.model_copy(update=dict.fromkeys(crossed, 0.0))


@given(nu=velocities, load=velocities, psi=st.floats(-10, 10))
def test_the_plant_is_the_matrix_equation(nu, load, psi):
    c, s = math.cos(psi), math.sin(psi)
    J = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    for p in (*VESSELS.values(), UNLIKE):
        rate = np.full(6, np.nan)
        plant(np.array([5, -7, psi, *nu]), load, np.zeros(3), bundle(p.constants()), rate)
        np.testing.assert_allclose(rate[:3], J @ nu, atol=1e-14)
        expected = np.linalg.solve(inertia(p), balance(p, nu, load))
        np.testing.assert_allclose(rate[3:], expected, rtol=1e-12, atol=1e-12)


@given(nu=velocities, load=velocities)
def test_with_all_coriolis_terms_the_share_changes_no_bit(nu, load):
    """Beside the same sums without it."""
    for p in VESSELS.values():
        p, k = p.model_copy(update={"coriolis": 1.0}), bundle(p.constants())
        forces = [force(*nu, k) for force in (surge_force, sway_force, yaw_moment)]
        surge, sway, yaw = np.array(forces) + 0.5 * load + 0.5 * load
        lever = k.m22 * k.m33 - k.m23 * k.m32
        told = [surge / k.m11, (k.m33 * sway - k.m23 * yaw) / lever]
        told.append((k.m22 * yaw - k.m32 * sway) / lever)
        np.testing.assert_array_equal(accelerations(p, nu, load), told)


@given(nu=velocities, tau=st.tuples(speed, speed), b=velocities)
def test_the_paper_s_vessel_is_equation_12(nu, tau, b):
    (u, v, r), (tau_u, tau_r) = nu, tau
    u_dot = 33.8 / 25.8 * v * r - 0.72 / 25.8 * u + (tau_u + b[0]) / 25.8
    v_dot = -25.8 / 33.8 * u * r - 0.8896 / 33.8 * v + b[1] / 33.8
    r_dot = (25.8 - 33.8) / 2.76 * u * v - 1.9 / 2.76 * r + (tau_r + b[2]) / 2.76
    found = accelerations(PAPER, nu, np.array([tau_u, 0, tau_r]) + b)
    np.testing.assert_allclose(found, [u_dot, v_dot, r_dot], rtol=1e-12, atol=1e-13)


def test_the_three_vessels_share_the_paper_s_inertia_and_linear_damping():
    for p in (PAPER, NONLINEAR, VESSELS["cybership2"]):
        assert (p.m11, p.m22, p.m33) == pytest.approx((25.8, 33.8, 2.76))
        assert (-p.X_u, -p.Y_v, -p.N_r) == pytest.approx((0.72, 0.8896, 1.9), rel=4e-3)
    added = {name for name in DAMPING if getattr(NONLINEAR, name) != getattr(PAPER, name)}
    assert added == {"X_uu", "X_uuu", "Y_vv", "N_rr"}
    assert all(getattr(NONLINEAR, name) == getattr(VESSELS["cybership2"], name) for name in added)


@given(nu=velocities)
def test_coriolis_forces_do_no_work(nu):
    for p in VESSELS.values():
        undamped = p.model_copy(update=dict.fromkeys(DAMPING, 0.0))
        power = nu @ inertia(p) @ accelerations(undamped, nu)
        assert abs(power) <= 1e-13 * inertia(p).max() * np.abs(nu).max() ** 3 + 1e-300


@given(nu=velocities)
def test_kinetic_energy_never_grows_in_calm_water(nu):
    for p in (PAPER, NONLINEAR, without_cross_damping(VESSELS["cybership2"])):
        power = nu @ inertia(p) @ accelerations(p, nu)
        assert power <= 1e-13 * np.abs(nu).max() ** 3
        if np.abs(nu).max() > 1e-3:
            assert power < 0


def test_the_published_cross_damping_of_cybership2_feeds_energy_in():
    # Y_r + N_v = -7.2 outweighs 2 sqrt(Y_v N_r) = 2.6: no property above can be asked of it.
    p, nu = VESSELS["cybership2"], np.array([0.0, 0.05, -0.1])
    assert nu @ inertia(p) @ accelerations(p, nu) > 0


def test_coasting_under_linear_damping_is_an_exponential():
    loop = adrift(vessel=PAPER, start=(3.0, -2.0, 0.7, 1.5, 0.0, 0.0))
    out = run(loop, 60.0, 0.05)
    decay = 0.72 / 25.8
    np.testing.assert_allclose(out["u"], 1.5 * np.exp(-decay * out["time"]), rtol=1e-12)
    way = 1.5 / decay * (1 - np.exp(-decay * out["time"]))
    np.testing.assert_allclose(out["x"], 3 + way * math.cos(0.7), atol=1e-12)
    np.testing.assert_allclose(out["y"], -2 + way * math.sin(0.7), atol=1e-12)


@every_vessel
def test_a_balanced_turn_is_a_circle(vessel):
    u, r = 0.8, 0.2
    v = float(root(lambda v: balance(vessel, np.array([u, v[0], r]), np.zeros(3))[1], [0.0]).x[0])
    surge, _, yaw = -balance(vessel, np.array([u, v, r]), np.zeros(3))
    start = (0.0, 0.0, 0.5, u, v, r)
    # Short of the time in which the turn's own instability lets rounding grow.
    out = run(adrift(vessel=vessel, controller=Constant(surge=surge, yaw=yaw), start=start), 20.0)
    heading = 0.5 + r * out["time"]
    course = heading + math.atan2(v, u)
    radius = math.hypot(u, v) / r
    np.testing.assert_allclose(out["psi"], heading, rtol=1e-9)
    np.testing.assert_allclose(out["x"], radius * (np.sin(course) - np.sin(course[0])), atol=1e-8)
    np.testing.assert_allclose(out["y"], radius * (np.cos(course[0]) - np.cos(course)), atol=1e-8)


@pytest.mark.parametrize("p", [PAPER, NONLINEAR], ids=["paper", "paper_nonlinear"])
def test_a_constant_load_ends_in_its_static_balance(p):
    load = np.array([0.4, 0.3, 0.2])
    b_u, b_v, b_r = (Harmonic(mean=mean) for mean in load)
    sea = HarmonicDisturbance(b_u=b_u, b_v=b_v, b_r=b_r)
    out = run(adrift(vessel=p, disturbance=sea, start=(0.0,) * 6), 1500.0, 0.05)
    end = np.array([out[name][-1] for name in "uvr"])
    static = root(lambda nu: balance(p, nu, load), np.round(end, 1)).x
    assert np.abs(balance(p, static, load)).max() < 1e-12
    np.testing.assert_allclose(end, static, rtol=1e-8)


@given(x=st.lists(st.floats(-50, 50), min_size=6, max_size=6).map(np.array))
def test_earth_velocity_keeps_the_speed_and_the_turn(x):
    rate = np.full(6, np.nan)
    earth_velocity(x, rate)
    assert math.hypot(rate[0], rate[1]) == pytest.approx(math.hypot(x[3], x[4]), rel=1e-12)
    assert rate[2] == x[5]


@given(angle=st.floats(-1e6, 1e6))
def test_wrapping_changes_whole_turns_only(angle):
    wrapped = wrap(angle)
    assert -math.pi < wrapped <= math.pi
    turns = (angle - wrapped) / (2 * math.pi)
    assert turns == pytest.approx(round(turns), abs=1e-9)


def test_wrapping_at_its_edges():
    assert wrap(math.pi) == math.pi
    assert wrap(-math.pi) == math.pi
    assert wrap(math.nextafter(math.pi, 4)) == pytest.approx(-math.pi)
    assert wrap(0.0) == 0.0


@pytest.mark.parametrize(
    "change",
    [{"X_udot": 30.0}, {"x_g": 0.5}, {"Y_v": 0.1}, {"N_r": 0.1}, {"X_u": 0.1}, {"m": -1.0}],
)
def test_an_impossible_vessel_is_refused(change):
    with pytest.raises(ValidationError):
        Vessel(**NONLINEAR.model_dump() | change)
