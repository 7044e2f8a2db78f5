"""The law momentum_vector: its equations, what it promises, and what it reaches."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from conftest import NONLINEAR, VESSELS, ask, corrected, run, situations, target_at
from law_samples import STEADY, WRONG, rms, task
from pod_samples import pods
from test_velocity_vector import SAMPLED

from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.components.controllers import momentum_adaptation as adaptation
from podusv_cli.components.controllers.momentum_guidance import guidance, level_gain, see_target
from podusv_cli.components.controllers.momentum_vector import MomentumVector, moment_for
from podusv_cli.components.disturbances.calm import Calm
from podusv_cli.components.disturbances.current import Current
from podusv_cli.components.paths.circle import Circle
from podusv_cli.components.paths.line import Line
from podusv_cli.components.paths.waypoints import Waypoints
from podusv_cli.components.vessels.plant import plant
from podusv_cli.core.kernel import Vector, bundle
from podusv_cli.core.kinematics import wrap
from podusv_cli.core.recording import Recording
from podusv_cli.findings.finding import preflight
from podusv_cli.scenario.load import load_text

LAW, CYBERSHIP, MILLIAMPERE = MomentumVector(), VESSELS["cybership2"], VESSELS["milliampere"]
K = bundle(LAW.constants_with(NONLINEAR))


def last(out: Recording, seconds: float) -> Any:
    return out["z_e"][out["time"] >= out["time"][-1] - seconds]


# --- the equations


def wanted_velocity(x: Vector, target: Vector, k_p: float, k_b: float) -> tuple[Vector, Vector]:
    """V_c over ground of docs/laws/momentum_vector.md, and the matrix that it multiplies e with."""
    e, V_d = target[:2] - x[:2], target[2:4]
    along, across = V_d @ e / np.hypot(*e), (V_d[0] * e[1] - V_d[1] * e[0]) / np.hypot(*e)
    s_max = max(np.sqrt(max(LAW.U**2 - across**2, 0.0)) - along, 0.05)
    n = np.array([np.cos(x[2]), np.sin(x[2])])
    T = (np.outer(V_d, V_d) + LAW.V_m**2 * np.outer(n, n)) / (V_d @ V_d + LAW.V_m**2)
    kappa = [k / np.sqrt(1 + (k * np.hypot(*e) / s_max) ** 2) for k in (k_p, k_b)]
    gains = kappa[1] * np.eye(2) + (kappa[0] - kappa[1]) * T
    return V_d + gains @ e, gains


def test_the_wanted_velocity_is_that_of_the_derivation():
    for x, _, target in situations(LAW, 200):
        at = see_target(x, target, K)
        closing = at.e_a * (at.t_a - x[3]) + at.e_b * (at.t_b - x[4])
        found = guidance(x, at, level_gain(at.k_p, at, closing), 0.1, K)
        V_c, _ = wanted_velocity(x, target, at.k_p, 0.1)
        cos, sin = np.cos(x[2]), np.sin(x[2])
        known = [V_c[0] * cos + V_c[1] * sin, V_c[1] * cos - V_c[0] * sin]
        np.testing.assert_allclose([found.a, found.b], known, rtol=1e-10, atol=1e-12)


def test_near_the_target_its_surge_rate_is_the_gains_times_the_rate_of_e():
    """Where e = 0 neither the levelling nor the turn of the course or the bow counts."""
    for x, _, target in situations(LAW, 50):
        x[:2] = target[:2] - 1e-9
        cos, sin = np.cos(x[2]), np.sin(x[2])
        rate = target[2:4] - [x[3] * cos - x[4] * sin, x[3] * sin + x[4] * cos]
        at = see_target(x, target, K)
        _, gains = wanted_velocity(x, target, at.k_p, 0.1)
        found = guidance(x, at, level_gain(at.k_p, at, 0.0), 0.1, K)
        known = (target[4:6] + gains @ rate) @ [cos, sin]
        np.testing.assert_allclose(found.A_a, known, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("lever", [None, 0.8])
@pytest.mark.parametrize("hull", [CYBERSHIP, MILLIAMPERE], ids=lambda hull: hull.preset)
def test_its_moment_turns_the_hull_as_it_wants(hull, lever):
    """By the plant with its full mass matrix and the sway force of the moment."""
    k = bundle(MomentumVector(thrust_lever=lever).constants_with(hull))
    for x, memory, _ in situations(LAW, 20):
        moment, rate = moment_for(0.3, x, memory, k), np.zeros(6)
        tau = np.array([0.0, -moment / lever if lever else 0.0, moment])
        loads = memory[3:6] - [0.0, hull.m22 * memory[7] * x[5], 0.0]  # with what it has learnt
        plant(x, tau, loads, bundle(hull.constants()), rate)
        assert rate[5] == pytest.approx(0.3, rel=1e-9)


def test_port_and_starboard_are_alike():
    """Mirrored in the x axis, demands in yaw and sway change sign and nothing else does."""
    mirror = np.array([1, -1, -1, 1, -1, -1.0])
    for x, memory, target in situations(LAW, 30):
        answer = ask(LAW, x, memory, target, CYBERSHIP)
        flip, held = np.array([1, -1, 1, -1, 1, -1.0]), np.array([*[1, -1, -1] * 2, -1, 1, -1, -1])
        other = ask(LAW, x * mirror, memory * held, target * flip, CYBERSHIP)
        np.testing.assert_allclose(other.tau, answer.tau * [1, -1], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(other.rate, answer.rate * held, rtol=1e-9, atol=1e-9)
        assert wrap(other.signals["chi_e"] + answer.signals["chi_e"]) == pytest.approx(0, abs=1e-9)


# --- what is promised: no offset


@pytest.mark.parametrize("path", [Line(speed=0.5, course=0.3), Circle(radius=16.67, speed=0.5)])
@pytest.mark.parametrize(
    ("hull", "told"), [(NONLINEAR, NONLINEAR), (NONLINEAR, WRONG), (CYBERSHIP, CYBERSHIP)]
)
def test_constant_loads_leave_no_offset(path, hull, told):
    loop = corrected(
        controller=LAW,
        vessel=hull,
        nominal=told,
        actuator=Saturated(),
        disturbance=STEADY,
        path=path,
    )
    assert last(run(loop, 300.0, step=0.02), 1.0).max() < 1e-8


@pytest.mark.parametrize("path", [Line(speed=0.5), Circle(radius=16.67, speed=0.5)])
def test_told_the_lever_it_leaves_no_offset_behind_a_pod_that_turns(path):
    told, pod = MomentumVector(thrust_lever=0.499), pods({"angle_limit": 1.2})
    loop = corrected(controller=told, actuator=pod, disturbance=STEADY, path=path)
    x, y = target_at(path, 0.0)[:2].tolist()
    out = run(replace(loop, start=(x - 1.0, y, *loop.start[2:])), 200.0, step=0.02)
    assert last(out, 5.0).max() < 1e-6


# --- what it learns: by how much more sway answers yaw than told

SLIDES = NONLINEAR.model_copy(update={"Y_r": -7.0})
MORE = 7.0 / NONLINEAR.m22  # m/s


def untold(law: MomentumVector, **parts: Any) -> Recording:
    """A hull that slides, told the paper's, from beside a line in calm water."""
    loop = corrected(
        controller=law,
        vessel=SLIDES,
        nominal=NONLINEAR,
        disturbance=Calm(),
        path=Line(speed=0.5),
        start=(-1.0, 0.5, 0.0, 0.5, 0.0, 0.0),
        **parts,
    )
    return run(loop, 300.0, log_every=5)


def test_the_observer_misses_the_sway_by_what_is_not_told_times_phi():
    out = untold(MomentumVector(gamma=0.0))
    assert abs(out["phi"]).max() > 0.01
    np.testing.assert_allclose(out["v"] - out["v_hat"], -MORE * out["phi"], atol=1e-8)


def test_a_hull_that_slides_more_than_told_is_learnt_and_comes_to_the_line():
    known, learns = untold(MomentumVector(gamma=0.0)), untold(MomentumVector())
    assert abs(known["r"][known["time"] > 250]).max() > 0.1  # it swings for ever
    assert abs(learns["r"][learns["time"] > 250]).max() < 0.005
    assert 0.5 * MORE < learns["dP"][-1] < 1.1 * MORE
    assert last(learns, 50.0).max() < 0.05


@pytest.mark.parametrize("more", [0.3, -0.3])
def test_beyond_its_bound_it_learns_nothing_and_unlearns(more):
    """By the gradient of the docstring, dP_hat' = -gamma phi e_v/(phi_0^2 + phi^2)."""
    k = bundle(LAW.constants_with(NONLINEAR))
    assert abs(more) > adaptation.MOST * k.U
    memory, rate, x = np.zeros(20), np.zeros(20), np.zeros(6)
    memory[adaptation.MORE], memory[adaptation.PHI] = more, 0.05
    for x[4], stays in ((-more, True), (more, False)):  # e_v with either sign
        gradient = -k.gamma * 0.05 * x[4] / (adaptation.PHI_0**2 + 0.05**2)
        adaptation.adapt(x, memory, k, rate)
        assert rate[adaptation.MORE] == (0.0 if stays else pytest.approx(gradient, rel=1e-12))
        assert stays or gradient * more < 0.0


def test_told_exactly_it_learns_nothing_under_constant_loads():
    out = run(corrected(controller=LAW, actuator=Saturated(), disturbance=STEADY), 200.0, step=0.02)
    assert abs(out["dP"][-1]) < 0.02


# --- what it reaches


def test_it_reaches_its_goals_on_the_paper_s_task():
    out = task(LAW)
    assert np.trapezoid(out["z_e"], out["time"]) <= 217.0  # 1.05 of the optimum, 206.8
    assert rms(out, 60, 100) <= 0.015
    assert rms(out, 150) <= 0.015
    assert abs(out["tau_u_cmd"]).max() <= 25.0


@pytest.mark.parametrize(("period", "grows"), [(30, False), (40, True)])
def test_the_period_that_its_loops_carry_is_the_one_that_the_run_carries(period, grows):
    """0.3 s and 0.4 s: what `sampled-loop` tells before a run, and the run."""
    text = SAMPLED.format(period=period / 100, law=json.dumps(LAW.model_dump()))
    codes = [finding.code for finding in preflight(load_text(text, "a.yaml").scenario)]
    assert ("sampled-loop" in codes) is grows
    held = rms(task(LAW, hold_every=period), 150)
    assert (held > 0.05) is grows


@pytest.mark.parametrize("speed", [0.1, 0.3, 0.5])
def test_a_hull_whose_sway_answers_yaw_comes_to_the_line_in_calm_water(speed):
    """CyberShip II from a metre behind; velocity_vector swings by decimetres there."""
    loop = corrected(
        controller=LAW,
        vessel=CYBERSHIP,
        actuator=Saturated(),
        disturbance=Calm(),
        path=Line(speed=speed),
        start=(-1.0, 0.5, 0.0, speed, 0.0, 0.0),
    )
    out = run(loop, 900.0 if speed < 0.2 else 300.0, step=0.02, log_every=5)
    settled = out["time"] > 0.9 * out["time"][-1]
    assert out["z_e"][settled].max() < 0.01
    assert abs(out["r"][settled]).max() < 1e-3


@pytest.mark.parametrize(
    ("sea", "worst"), [(Calm(), 0.1), (Current(speed=0.1, direction=0.7), 0.01)]
)
def test_at_a_target_that_stops_it_does_not_circle(sea, worst):
    stops = Waypoints(points=((0.0, 0.0), (20.0, 0.0)), legs="straight", after="stop")
    loop = corrected(
        controller=LAW,
        actuator=Saturated(),
        disturbance=sea,
        path=stops,
        start=(-3.0, 1.0, 0.0, 0.0, 0.0, 0.0),
    )
    out = run(loop, 300.0, step=0.02, log_every=5)
    assert last(out, 50.0).max() < worst
    assert abs(out["r"][out["time"] > 250]).max() < 0.02
