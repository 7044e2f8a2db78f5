"""The law velocity_vector: its guidance against sympy, what it promises, and what it reaches."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from conftest import NONLINEAR, SMOOTH_START, ask, corrected, run, situations, target_at
from hypothesis import given
from hypothesis import strategies as st
from law_samples import STEADY, WRONG, rms, task
from pod_samples import pods

from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.components.controllers.velocity_steering import Aim, Wanted, surge_demand
from podusv_cli.components.controllers.velocity_vector import VelocityVector, guidance
from podusv_cli.components.disturbances.calm import Calm
from podusv_cli.components.paths.circle import Circle
from podusv_cli.components.paths.line import Line
from podusv_cli.components.paths.line_circle import LineCircle
from podusv_cli.components.vessels.plant import sway_force
from podusv_cli.core.kernel import bundle
from podusv_cli.core.kinematics import wrap
from podusv_cli.core.recording import Recording
from podusv_cli.findings.finding import preflight
from podusv_cli.scenario.load import load, load_text

LAW = VelocityVector()
ROOT = Path(__file__).parents[3]
SAMPLED = """
extends: podusv:mu_2017/base.yaml
vessel: {{preset: paper_nonlinear}}
path: {{reading: velocity}}
actuator: {{kind: saturated}}
controllers: {{mine: {law}}}
control: {{period: {period}}}
"""
K = bundle(LAW.constants_with(NONLINEAR))


def within(out: Recording, start: float, end: float = np.inf) -> Any:
    return out["z_e"][(out["time"] >= start) & (out["time"] < end)]


# --- guidance


@cache
def reference() -> Any:
    """V_c and A of docs/laws/velocity_vector.md, A by differentiation of V_c with s_max held."""
    t, k_p, s_max = sp.symbols("t k_p s_max")
    at = [sp.Function(name)(t) for name in ("x", "y", "x_d", "y_d")]
    e = sp.Matrix([at[2] - at[0], at[3] - at[1]])
    kappa = k_p / sp.sqrt(1 + (k_p / s_max) ** 2 * e.dot(e))
    wanted = sp.Matrix(at[2:]).diff(t) + kappa * e
    both = [*wanted, *wanted.diff(t)]
    numbers = sp.symbols("x y x_d y_d dx dy dx_d dy_d ddx_d ddy_d")
    swaps = list(zip([state.diff(t, 2) for state in at[2:]], numbers[8:], strict=True))
    swaps += list(zip([state.diff(t) for state in at], numbers[4:8], strict=True))
    swaps += list(zip(at, numbers[:4], strict=True))
    return sp.lambdify((*numbers, k_p, s_max), [expression.subs(swaps) for expression in both])


def test_the_wanted_velocity_and_its_rate_are_those_of_the_derivation():
    for x, _, target in situations(LAW, 200):
        cos, sin = np.cos(x[2]), np.sin(x[2])
        to_body = np.array([[cos, sin], [-sin, cos]])
        rate = to_body.T @ x[3:5]
        e = target[:2] - x[:2]
        along = target[2:4] @ e / np.hypot(*e)
        across = (target[2] * e[1] - target[3] * e[0]) / np.hypot(*e)
        s_max = max(np.sqrt(max(LAW.U**2 - across**2, 0.0)) - along, 0.05)
        V_A = reference()(*x[:2], *target[:2], *rate, *target[2:], LAW.k_p, s_max)
        V, A = np.reshape(V_A, (2, 2))
        turn = (V[0] * A[1] - V[1] * A[0]) / max(V @ V, LAW.V_m**2)
        wanted = guidance(x, target, K)
        np.testing.assert_allclose([wanted.a, wanted.b], to_body @ V, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(wanted.A_a, (to_body @ A)[0], rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(wanted.turn, np.clip(turn, -0.3, 0.3), rtol=1e-9, atol=1e-11)


@given(
    distance=st.floats(0, 1e4),
    bearing=st.floats(-4, 4),
    speed=st.floats(0, 1.1),
    course=st.floats(-4, 4),
)
def test_no_speed_above_U_is_wanted_of_a_slower_target(distance, bearing, speed, course):
    target = np.array(
        [
            distance * np.cos(bearing),
            distance * np.sin(bearing),
            speed * np.cos(course),
            speed * np.sin(course),
            0.0,
            0.0,
        ]
    )
    wanted = guidance(np.zeros(6), target, K)
    assert np.hypot(wanted.a, wanted.b) <= LAW.U * (1 + 1e-12)


def test_the_yaw_rate_s_rate_is_the_derivative_of_the_limited_angle():
    chi, k_psi, r_m = sp.symbols("chi k_psi r_m", positive=True)
    sigma = 1 / sp.sqrt(1 + (k_psi * chi / r_m) ** 2)
    assert sp.simplify(sp.diff(chi * sigma, chi) - sigma**3) == 0
    assert sp.limit(k_psi * chi * sigma, chi, sp.oo) == r_m


@pytest.mark.parametrize(("tau_r", "part"), [(2.0 * LAW.N_m, 0.5), (0.5 * LAW.N_m, 1.0)])
def test_surge_is_wanted_as_far_as_the_bow_points_there_and_N_m_turns_it(tau_r, part):
    """A bow 60 degrees beside a wanted velocity of 0.8 m/s: half of 0.4 m/s, and half of that."""
    bow, tau = Aim(side=1.0, speed=0.8, chi_e=np.pi / 3), np.array([0.0, -tau_r])
    wanted = Wanted(a=0.4, b=np.sqrt(0.48), A_a=0.0, turn=0.0, backward=False)
    u_d = surge_demand(np.zeros(6), np.zeros(6), wanted, bow, K, tau)
    assert u_d == pytest.approx(0.4 * 0.5 * part, rel=1e-12)
    assert tau == pytest.approx([NONLINEAR.m11 * LAW.k_u * u_d, -tau_r], rel=1e-12)


# --- what is promised: no offset, whatever the law was told


@pytest.mark.parametrize("path", [Line(speed=0.5, course=0.3), Circle(radius=16.67, speed=0.5)])
def test_constant_loads_leave_no_offset(path):
    for nominal in (NONLINEAR, WRONG):
        out = run(
            corrected(
                controller=LAW, actuator=Saturated(), disturbance=STEADY, path=path, nominal=nominal
            ),
            200.0,
        )
        assert within(out, 199.0).max() < 1e-9


def test_behind_pods_it_stays_off_by_what_their_sway_force_makes_of_the_prediction():
    """The observer leaves that force out, so Y + b_v = -tau_v, v_s = v - T_v tau_v/m22."""
    two = load(ROOT / "configs/pod/kept.yaml").scenario.actuator
    out = run(
        corrected(controller=LAW, actuator=two, disturbance=STEADY, path=Line()), 200.0, step=0.02
    )
    assert within(out, 190).min() == pytest.approx(0.028, abs=5e-4)
    assert within(out, 190).max() == pytest.approx(0.028, abs=5e-4)
    last = {name: float(out[name][-1]) for name in ("u", "v", "r", "b_obs_v", "v_s", "tau_v")}
    assert abs(last["tau_v"]) > 0.05
    force = sway_force(last["u"], last["v"], last["r"], K) + last["b_obs_v"]
    assert force == pytest.approx(-last["tau_v"], rel=1e-6)
    predicted = last["v"] - LAW.T_v * last["tau_v"] / NONLINEAR.m22
    assert last["v_s"] == pytest.approx(predicted, abs=2e-3)


def test_what_the_lever_adds_is_the_force_that_no_moment_of_a_pod_changes():
    """With tau_v = -tau_r/a the point m33/(a m22) ahead moves across as if there were no moment."""
    a, m22, m33, Y, f_r, b_v, b_r, tau_r = sp.symbols("a m22 m33 Y f_r b_v b_r tau_r")
    v_rate, r_rate = (Y + b_v - tau_r / a) / m22, (f_r + b_r + tau_r) / m33
    force = Y + b_v + (f_r + b_r) / a
    assert sp.simplify(m22 * (v_rate + m33 / (a * m22) * r_rate) - force) == 0


@pytest.mark.parametrize("path", [Line(speed=0.5), Circle(radius=16.67, speed=0.5)])
def test_told_the_lever_it_leaves_no_offset_behind_a_pod_that_turns(path):
    told, pod = VelocityVector(thrust_lever=0.499), pods({"angle_limit": 1.2})
    loop = corrected(controller=told, actuator=pod, disturbance=STEADY, path=path)
    x, y = target_at(path, 0.0)[:2].tolist()
    out = run(replace(loop, start=(x - 1.0, y, *loop.start[2:])), 200.0, step=0.02)
    assert within(out, 195).max() < 1e-6


def test_at_rest_on_the_target_it_wants_what_the_observed_loads_take():
    """Sway in balance with the load and e = 0: the demand is what holds that velocity."""
    load = np.array([0.5, 0.5, 0.5])
    d, d_v = -NONLINEAR.Y_v, -NONLINEAR.Y_vv
    v = (np.sqrt(d * d + 4 * d_v * 0.5) - d) / (2 * d_v)
    u = np.sqrt(0.25 - v * v)
    psi = -np.arctan2(v, u)
    x = np.array([3.0, 1.0, psi, u, v, 0.0])
    assert abs(sway_force(u, v, 0.0, K) + 0.5) < 1e-12
    target = np.array([3.0, 1.0, 0.5, 0.0, 0.0, 0.0])
    answer = ask(LAW, x, np.array([u, v, 0.0, *load]), target, NONLINEAR)
    assert answer.signals["chi_e"] == pytest.approx(0.0, abs=1e-12)
    assert answer.signals["u_d"] == pytest.approx(u, rel=1e-12)
    assert answer.rate == pytest.approx(np.zeros(6), abs=1e-12)


# --- what it reaches on the paper's task


def test_it_reaches_its_goals_on_the_paper_s_task():
    out = task(LAW)
    assert np.trapezoid(out["z_e"], out["time"]) <= 217.0  # 1.05 of the optimum, 206.8
    assert rms(out, 60, 100) <= 0.015
    assert rms(out, 150) <= 0.015
    assert within(out, 60).max() <= 0.025
    assert within(out, 29).max() <= 0.2
    assert abs(out["tau_u_cmd"]).max() <= 25.0


def test_a_measurement_held_for_a_tenth_of_a_second_changes_less_than_a_millimetre():
    held, free = task(LAW, hold_every=10), task(LAW)
    for start, end in ((60, 100), (150, np.inf)):
        assert abs(rms(held, start, end) - rms(free, start, end)) < 1e-3
    assert abs(within(held, 60).max() - within(free, 60).max()) < 1e-3


def test_in_calm_water_it_is_within_a_millimetre_but_where_the_target_jerks():
    out = run(corrected(controller=LAW, actuator=Saturated(), disturbance=Calm()), 310.0)
    assert within(out, 60, 100).max() < 1e-3
    assert within(out, 120).max() < 1e-3
    assert within(out, 100, 120).max() > 5e-3  # the circle's acceleration begins at once


def test_it_follows_wherever_the_paper_s_law_stays_behind_at_its_standoff():
    out = run(corrected(controller=LAW, start=SMOOTH_START, path=Line()), 100.0)
    assert within(out, 60).max() < 0.025


def test_port_and_starboard_are_alike():
    """Mirrored in the x axis, demands in yaw change sign and nothing else does."""
    mirror = np.array([1, -1, -1, 1, -1, -1.0])
    for x, memory, target in situations(LAW, 30):
        answer = ask(LAW, x, memory, target, NONLINEAR)
        flip = np.array([1, -1, 1, -1, 1, -1.0])
        other = ask(LAW, x * mirror, memory * np.array([1, -1, -1] * 2), target * flip, NONLINEAR)
        np.testing.assert_allclose(other.tau, answer.tau * [1, -1], rtol=1e-9, atol=1e-9)
        assert wrap(other.signals["chi_e"] + answer.signals["chi_e"]) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(("ahead", "heading"), [(15.0, 0.0), (10.0, -0.7)])
def test_ahead_of_the_target_it_backs_up_instead_of_turning_twice(ahead, heading):
    turned, backed = (
        run(
            corrected(
                controller=VelocityVector(astern=choice),
                actuator=Saturated(),
                start=(ahead, -1.0, heading, 0.0, 0.0, 0.0),
            ),
            60.0,
        )
        for choice in ("never", "shorter")
    )
    assert abs(turned["psi"]).max() > np.pi / 2 > abs(backed["psi"]).max()
    assert backed["u"].min() < -0.3
    iae = [np.trapezoid(out["z_e"], out["time"]) for out in (turned, backed)]
    assert iae[1] < 0.95 * iae[0]


def test_with_its_bow_against_the_target_s_course_it_turns_at_once():
    start = (15.0, 0.0, 2.5, 0.0, 0.0, 0.0)
    turned, backed = (
        run(corrected(controller=VelocityVector(astern=choice), start=start), 20.0)
        for choice in ("never", "shorter")
    )
    np.testing.assert_array_equal(turned["x"], backed["x"])


def test_the_settled_error_is_within_the_bound_of_the_cascade():
    """e' = -kappa e + d with d = V_c - p', so |e| <= sup |d|/kappa once the start is forgotten."""
    out, state = task(LAW), ("x", "y", "psi", "u", "v", "r")
    late = np.flatnonzero(out["time"] > 150)[::10]
    path, largest = LineCircle(), 0.0
    for i in late:
        x = np.array([out[name][i] for name in state])
        wanted = guidance(x, target_at(path, out["time"][i]), K)
        largest = max(largest, float(np.hypot(wanted.a - x[3], wanted.b - x[4])))
    bound = largest / (0.99 * LAW.k_p)  # kappa is k_p but for 1 % within 0.1 m
    assert 0.1 * bound < within(out, 150).max() <= bound


@pytest.mark.parametrize(("period", "grows"), [(50, False), (80, True)])
def test_the_period_that_its_loops_carry_is_the_one_that_the_run_carries(period, grows):
    """0.5 s and 0.8 s: what `sampled-loop` tells before a run, and the run."""
    scenario = load_text(
        SAMPLED.format(period=period / 100, law=json.dumps(LAW.model_dump())), "a.yaml"
    ).scenario
    codes = [finding.code for finding in preflight(scenario)]
    assert ("sampled-loop" in codes) is grows
    worst = float(within(task(LAW, hold_every=period), 150).max())
    assert (worst > 0.2) is grows
