"""Laws with line-of-sight guidance: their frame, what is derived, and what they promise."""

import math
from typing import Any

import numpy as np
import pytest
import sympy as sp
from conftest import NONLINEAR, ask, corrected, run, situations
from law_samples import STEADY, WRONG, rms, task
from scipy.integrate import solve_ivp

from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.components.controllers.alos import CRAB, Alos, learning
from podusv_cli.components.controllers.guidance import course_frame, line_of_sight, wanted_speed
from podusv_cli.components.controllers.los_pid import LosPid
from podusv_cli.components.controllers.velocity_loop import Axis
from podusv_cli.components.paths.circle import Circle
from podusv_cli.components.paths.line import Line
from podusv_cli.core.kernel import bundle
from podusv_cli.core.kinematics import wrap
from podusv_cli.core.recording import Recording

LEARNING = [Alos(), Alos(learns="integral")]
LAWS = [LosPid(), *LEARNING]


def steady(law: Any, path: Any, nominal: Any = NONLINEAR, duration: float = 250.0) -> Recording:
    loop = corrected(
        controller=law, actuator=Saturated(), disturbance=STEADY, path=path, nominal=nominal
    )
    return run(loop, duration)


# --- the frame


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.kind)
def test_the_frame_is_that_of_the_target_s_velocity(law):
    k = bundle(law.constants_with(NONLINEAR))
    for x, _, target in situations(law, 100):
        at = course_frame(x, target, k)
        course = np.angle(target[2] + 1j * target[3])
        gap = (target[0] - x[0] + 1j * (target[1] - x[1])) * np.exp(-1j * course)
        assert at.along == pytest.approx(gap.real, abs=1e-9)
        assert at.across == pytest.approx(-gap.imag, abs=1e-9)
        assert np.exp(1j * (x[2] - course)) == pytest.approx(at.cos_off + 1j * at.sin_off)


def test_the_rates_of_the_errors_are_their_derivatives():
    t = sp.Symbol("t")
    x, y, x_d, y_d = (sp.Function(name)(t) for name in ("x", "y", "x_d", "y_d"))
    course = sp.atan2(y_d.diff(t), x_d.diff(t))
    across = (x_d - x) * sp.sin(course) - (y_d - y) * sp.cos(course)
    along = (x_d - x) * sp.cos(course) + (y_d - y) * sp.sin(course)
    k = bundle(LosPid(chi_m=1e9).constants_with(NONLINEAR))
    ahead = sp.sqrt(k.lookahead**2 + sp.Max(along, 0) ** 2)
    sight = -sp.atan2(across + 0.1, ahead)
    names = "x0 y0 xd0 yd0 x1 y1 xd1 yd1 xd2 yd2"
    numbers = sp.symbols(names)
    places = [x, y, x_d, y_d]
    swaps = [(f.diff(t, 2), n) for f, n in zip((x_d, y_d), numbers[8:], strict=True)]
    swaps += [(f.diff(t), n) for f, n in zip(places, numbers[4:8], strict=True)]
    swaps += list(zip(places, numbers[:4], strict=True))
    rates = [expression.diff(t).subs(swaps) for expression in (along, across, sight)]
    rate = sp.lambdify(numbers, rates, ["numpy", {"Heaviside": np.heaviside}])
    for state, _, target in situations(LosPid(), 100):
        over_ground = (state[3] + 1j * state[4]) * np.exp(1j * state[2])
        velocity = (over_ground.real, over_ground.imag)
        expected = rate(*state[:2], *target[:2], *velocity, *target[2:])
        at = course_frame(state, target, k)
        sight_rate = line_of_sight(at, max(at.along, 0.0), 0.1, 0.0, k)[1]
        found = (at.along_rate, at.across_rate, sight_rate)
        assert found == pytest.approx(expected, rel=1e-9)


def test_a_target_at_rest_is_chased_along_the_line_of_sight():
    k = bundle(LosPid().constants_with(NONLINEAR))
    at = course_frame(np.zeros(6), np.array([3.0, 4.0, 0, 0, 0, 0]), k)
    assert (at.along, at.across) == pytest.approx((5.0, 0.0))


def test_far_behind_the_line_of_sight_is_that_to_the_target_and_near_it_to_the_lookahead():
    k = bundle(LosPid().constants_with(NONLINEAR))
    D = k.lookahead
    for behind, across, ahead in ((30.0, 40.0, 30.0), (0.0, 1.0, D), (-5.0, 1.0, D)):
        x, target = np.array([0, across, 0, 0, 0, 0.0]), np.array([behind, 0, 1, 0, 0, 0.0])
        at = course_frame(x, target, k)
        angle, _ = line_of_sight(at, max(at.along, 0.0), 0.0, 0.0, k)
        assert angle == pytest.approx(-np.arctan2(across, ahead), rel=5e-3)


def test_a_vessel_beside_its_target_comes_to_the_line_with_speed():
    k = bundle(LosPid().constants_with(NONLINEAR))
    target = np.array([0.0, 0, 0.5, 0, 0, 0])
    speeds = []
    for across, ahead in ((5.0, 3.0), (1.0, 3.0), (0.0, 0.0)):
        x = np.array([ahead, across, -0.5 * np.pi, 0, 0, 0]) if across > 4 else np.zeros(6)
        x[:2] = ahead, across
        speeds.append(wanted_speed(x, course_frame(x, target, k), k))
    assert speeds == pytest.approx([k.k_s * (5.0 - k.lookahead), k.U_min, 0.5])


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.kind)
def test_a_target_on_a_circle_is_reached_from_far_outside(law):
    """Steered by the target's tangent alone, a vessel as slow as this one goes off with it."""
    path = Circle(radius=20.0, speed=0.45, turn="port")
    start = (-14.4, 13.9, 1.3, 0.0, 0.0, 0.0)
    out = run(corrected(controller=law, actuator=Saturated(), path=path, start=start), 150.0)
    assert out["z_e"][out["time"] > 140].max() < 1.0


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.kind)
def test_port_and_starboard_are_alike(law):
    mirror, flip = np.array([1, -1, -1, 1, -1, -1.0]), np.array([1, -1, 1, -1, 1, -1.0])
    parts = [signal for signal, _ in law.slots()]
    own = np.array([1.0 if s.name in ("force_i", "u_hat", "b_obs_u") else -1.0 for s in parts])
    for x, memory, target in situations(law, 30):
        answer = ask(law, x, memory, target, NONLINEAR)
        other = ask(law, x * mirror, memory * own, target * flip, NONLINEAR)
        np.testing.assert_allclose(other.tau, answer.tau * [1, -1], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(other.rate, answer.rate * own, rtol=1e-9, atol=1e-9)
        assert wrap(other.signals["psi_r"] + answer.signals["psi_r"]) == pytest.approx(0, abs=1e-9)


# --- los_pid


def test_the_loops_have_all_poles_at_minus_omega():
    s, w = sp.symbols("s w", positive=True)
    speed = sp.Matrix([[-2 * w, 1], [-(w**2), 0]])
    heading = sp.Matrix([[-3 * w, -3 * w**2, 1], [1, 0, 0], [0, -(w**3), 0]])
    assert sp.expand((s * sp.eye(2) - speed).det() - (s + w) ** 2) == 0
    assert sp.expand((s * sp.eye(3) - heading).det() - (s + w) ** 3) == 0
    law = LosPid(omega_u=0.7, omega_psi=1.1)
    axes = (Axis("surge", 25.8, 25.8, 0.0), Axis("yaw", 2.76, 2.76, 0.0))
    for loop, matrix, omega in zip(
        law.velocity_loops(axes, np.zeros(3)), (speed, heading), (0.7, 1.1), strict=True
    ):
        np.testing.assert_allclose(loop.matrix, np.array(matrix.subs(w, omega), float), atol=1e-12)


def test_the_demand_is_that_of_the_loops():
    """Derivatives of demand and integrals by the velocities, and by the heading."""
    law, x, target = LosPid(), np.zeros(6), np.array([5.0, 0, 0.5, 0, 0, 0])
    target[0] = 0.0  # on the target
    x[3] = 0.5
    surge, yaw = law.velocity_loops((Axis("surge", 1, 1, 0.0),) * 2, np.zeros(3))
    inertia = np.repeat([NONLINEAR.m11, NONLINEAR.m33], 2)

    def out(at: int, d: float) -> Any:
        state = x.copy()
        state[at] += d
        found = ask(law, state, np.zeros(2), target, NONLINEAR)
        return np.transpose([found.tau, found.rate]).ravel() / inertia

    by_u, by_psi, by_r = ((out(at, 1e-6) - out(at, -1e-6)) / 2e-6 for at in (3, 2, 5))
    np.testing.assert_allclose(by_u[:2], surge.matrix[:, 0], atol=1e-6)
    np.testing.assert_allclose(by_r[2], yaw.matrix[0, 0], atol=1e-6)
    np.testing.assert_allclose(by_psi[2:], [yaw.matrix[0, 1], yaw.matrix[2, 1]], atol=1e-6)


def test_a_steady_cross_load_leaves_the_lookahead_times_the_tangent_of_the_crab_angle():
    law = LosPid()
    out = steady(law, Line(speed=0.5, course=0.3))
    end = {name: out[name][-1] for name in ("along", "across", "u", "v", "psi")}
    crab = np.arctan2(end["v"], end["u"])
    assert end["across"] == pytest.approx(law.lookahead * np.tan(crab), rel=1e-6)
    assert abs(end["across"]) > 0.2
    assert abs(end["along"]) < 1e-6


def test_without_the_loads_that_act_the_integrals_wind_up():
    class Deaf(LosPid):
        def wants_loads(self) -> bool:
            return False

    told, deaf = (
        run(corrected(controller=kind(), actuator=Saturated(surge_limit=3.0)), 60.0)
        for kind in (LosPid, Deaf)
    )
    assert abs(deaf["force_i"]).max() > 3 * 3.0
    assert deaf["z_e"].max() > told["z_e"].max()
    late = told["time"] > 40
    assert deaf["z_e"][late].mean() > told["z_e"][late].mean()


# --- alos


def test_the_adapted_angle_makes_the_lyapunov_function_fall():
    """V = D sqrt(D^2 + y^2) + U e^2/(2 gamma): V' = -U D y^2/(D^2 + y^2) for small e."""
    y, e = sp.symbols("y e", real=True)
    D, U, gamma = sp.symbols("D U gamma", positive=True)
    y_rate = U * (-y + D * e) / sp.sqrt(D**2 + y**2)  # U sin(e - atan(y/D)) to first order in e
    exact = U * sp.sin(e - sp.atan(y / D))
    assert sp.simplify(sp.diff(exact, e).subs(e, 0) - sp.diff(y_rate, e)) == 0
    e_rate = -gamma * D**2 * y / (D**2 + y**2)  # of the true less the learnt angle
    V = D * sp.sqrt(D**2 + y**2) + U * e**2 / (2 * gamma)
    fall = sp.diff(V, y) * y_rate + sp.diff(V, e) * e_rate
    assert sp.simplify(fall + U * D * y**2 / (D**2 + y**2)) == 0
    k = bundle(Alos().constants_with(NONLINEAR))
    for across in (-30.0, -0.4, 0.1, 5.0):
        known = -e_rate.subs({D: k.lookahead, y: across, gamma: k.gamma})
        assert learning(across, 0.1, 0.0, k)[0] == pytest.approx(float(known), rel=1e-12)


def test_the_integral_is_that_of_its_source():
    k = bundle(Alos(learns="integral").constants_with(NONLINEAR))
    y, shift, D = 0.7, -0.3, k.lookahead
    expected = k.sigma * D * y / ((y + shift) ** 2 + D**2)
    assert learning(y, 0.0, shift, k) == (0.0, pytest.approx(expected))


@pytest.mark.parametrize("path", [Line(speed=0.5, course=0.3), Circle(radius=16.67, speed=0.5)])
@pytest.mark.parametrize("law", LEARNING, ids=["adaptive", "integral"])
def test_constant_loads_leave_no_offset_whatever_the_law_was_told(law, path):
    for nominal in (NONLINEAR, WRONG):
        assert steady(law, path, nominal)["z_e"][-1] < 1e-5


@pytest.mark.parametrize("law", LEARNING, ids=["adaptive", "integral"])
def test_what_it_learns_does_not_wind_up_on_a_long_approach(law):
    """A start 10 m beside the line: no larger angle than the cross load needs, and a little."""
    out = task(law)
    true = np.arctan2(out["v"], out["u"])[(out["time"] > 60)]
    assert abs(out["crab"]).max() < 2 * abs(true).max()
    assert abs(out["offset"]).max() < 2 * law.lookahead


def test_the_learnt_angle_stays_within_its_limit():
    law = Alos(crab_m=0.05)
    out = steady(law, Line(speed=0.5, course=0.3), duration=100.0)
    assert abs(out["crab"]).max() < 0.05 + 1e-3
    assert abs(out["crab"]).max() > 0.049
    k = bundle(law.constants_with(NONLINEAR))
    assert learning(1.0, 0.05, 0.0, k)[0] == 0.0
    assert learning(-1.0, 0.05, 0.0, k)[0] < 0.0


def test_memory_begins_with_the_observer():
    names = [signal.name for signal, _ in Alos().slots()]
    assert names[CRAB:] == ["crab", "offset"]


# --- what they reach on the paper's task


@pytest.mark.parametrize("law", LEARNING, ids=["adaptive", "integral"])
def test_learning_the_crab_angle_is_worth_several_times_the_error_on_the_line(law):
    plain, learnt = task(LAWS[0]), task(law)
    assert rms(plain, 60, 100) > 0.3
    assert rms(learnt, 60, 100) < 0.06
    assert rms(learnt, 150) < 0.1
    assert rms(learnt, 150) < 0.6 * rms(plain, 150)


# t, beta_hat and psi_ref by MSS's ALOSpsi (commit 736a3d1, GNU Octave 7.3; D = 10 m, gamma = 0.002,
# steps of 1 ms) on a path of course atan(1/2), at y_e = 30 exp(-t/20) - 2 sin(0.1 t).
ALOS = (
    (0.0, 0.0, -0.785398163397),
    (5.0, 0.0932481991685, -0.780602897992),
    (20.0, 0.336015113389, -0.617085644118),
    (40.0, 0.558025598331, -0.602859149292),
    (60.0, 0.710534667291, -0.449320095803),
)


def test_alos_as_published_is_that_of_its_author_from_far_off_the_path():
    law, course = Alos(learns="published", lookahead=10.0, gamma=0.002), math.atan2(1.0, 2.0)
    k = bundle(law.constants_with(NONLINEAR))

    def across(t):
        return 30.0 * math.exp(-t / 20.0) - 2.0 * math.sin(0.1 * t)

    found = solve_ivp(
        lambda t, crab: [learning(across(t), crab[0], 0.0, k)[0]],
        (0.0, 60.0),
        [0.0],
        t_eval=[t for t, *_ in ALOS],
        rtol=1e-10,
        atol=1e-12,
    )
    assert found.y[0] == pytest.approx([beta for _, beta, _ in ALOS], abs=2e-5)
    for t, beta, psi in ALOS:
        memory = np.zeros(8)
        memory[CRAB] = beta
        # 12 m behind a target that goes along the path
        at = across(t) * np.array([-math.sin(course), math.cos(course)])
        x = np.concatenate([at, [0.3, 0.5, 0.0, 0.0]])
        ahead = 12.0 * np.array([math.cos(course), math.sin(course)])
        target = np.concatenate([ahead, 0.05 * ahead, np.zeros(2)])
        assert ask(law, x, memory, target, NONLINEAR).signals["psi_r"] == pytest.approx(psi)
