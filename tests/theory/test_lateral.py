"""How sway answers yaw: the lateral loops of theory/lateral.py, and of the real closed loop."""

import runpy

import numpy as np
import pytest
import sympy as sp
from conftest import NONLINEAR, PACKAGE, VESSELS
from findings_samples import codes, finding, late
from hypothesis import given
from hypothesis import strategies as st
from line_loops import furthest, line_eigenvalues

from podusv_cli.components.controllers.momentum_schedule import SwayResponse, schedule
from podusv_cli.components.controllers.momentum_vector import MomentumVector
from podusv_cli.components.controllers.velocity_vector import VelocityVector
from podusv_cli.core.kernel import bundle
from podusv_cli.theory.lateral import (
    MomentumGains,
    SwayAnswer,
    growth,
    momentum_vector_gains,
    momentum_vector_polynomial,
    sway_answer,
    velocity_vector_loop,
    velocity_vector_polynomial,
)

LAW, CYBERSHIP = VelocityVector(), VESSELS["cybership2"]
SLIDES = NONLINEAR.model_copy(update={"Y_r": -6.0})  # sway answers yaw 1.6 times at 0.2 m/s
# Laws count on all Coriolis terms, so their loops are those of hulls that have them.
HULLS = [*(hull for hull in VESSELS.values() if hull.coriolis == 1.0), SLIDES]
each_hull = pytest.mark.parametrize("hull", HULLS, ids=lambda hull: f"{hull.preset} {hull.Y_r}")
s, p, d, V = sp.symbols("s p d V", positive=True)
y, psi, v, r = sp.symbols("y psi v r")


def polynomial(alpha: sp.Expr) -> list[sp.Expr]:
    """Of y' = V psi + v, psi' = r, v' = -p V r - d v, r' = alpha."""
    rates = sp.Matrix([V * psi + v, r, -p * V * r - d * v, alpha])
    loop = rates.jacobian([y, psi, v, r])
    return sp.Poly((s * sp.eye(4) - loop).det(), s).all_coeffs()


def test_the_way_from_yaw_to_the_path_has_a_zero_that_goes_right_for_p_above_1():
    through = (V + sp.simplify(-p * V * s / (s + d))) / s / s / s  # r' to y, over psi = r'/s^2
    assert sp.simplify(through - V * ((1 - p) * s + d) / (s**3 * (s + d))) == 0


def test_no_moment_moves_the_flat_output():
    """Z = y + (p - 1) V/d (psi + v/(p V)): the moment's r and its rate fall out of Z' and Z''."""
    v_rate = -p * V * r - d * v
    Z_rate = V * psi + v + (p - 1) * V / d * (r + v_rate / (p * V))
    assert sp.simplify(Z_rate - V * (psi + v / (p * V))) == 0
    Z_rate_rate = V * (r + v_rate / (p * V))
    assert sp.simplify(Z_rate_rate + d / p * v) == 0


def test_velocity_vector_s_polynomial_is_that_of_its_equations():
    k_p, a, b, T = sp.symbols("k_p k_psi k_r T_v")
    turn = -k_p * (V * psi + v) / V
    v_s = v + T * (-p * V * turn - d * v)
    chi_e = (-k_p * y - V * psi - v_s) / V
    derived = polynomial(a * (turn - r) + b * (a * chi_e + turn - r))
    law = VelocityVector(k_p=0.4, k_psi=1.1, k_r=1.7, T_v=3.0)
    numbers = {k_p: 0.4, a: 1.1, b: 1.7, T: 3.0, p: 1.2, d: 0.3, V: 0.6}
    known = velocity_vector_polynomial(law, SwayAnswer(1.2, 0.3))
    assert [float(term.subs(numbers)) for term in derived] == pytest.approx(list(known), rel=1e-12)


def test_at_the_defaults_it_bears_p_eff_of_0_989_at_cybership_s_damping():
    damping = sway_answer(CYBERSHIP, 0.5).d
    at = [growth(velocity_vector_polynomial(LAW, SwayAnswer(p, damping))) for p in (0.988, 0.989)]
    assert at[0] < 0.0 < at[1]


def test_without_m23_its_loop_has_this_polynomial():
    for hull in (NONLINEAR, SLIDES, VESSELS["wamv"]):
        known = velocity_vector_polynomial(LAW, sway_answer(hull, 0.4, 0.1))
        found = np.poly(velocity_vector_loop(LAW, hull, 0.4, 0.1))
        np.testing.assert_allclose(found, known, rtol=1e-10)


@each_hull
def test_its_loop_is_a_part_of_the_real_one(hull):
    """All of its roots, with m23 and Y_r, below V_m and behind pods, are eigenvalues there."""
    for speed, share, lever in ((0.05, 0.0, None), (0.4, 0.0, None), (0.6, -1.5, 2.0)):
        law = VelocityVector(thrust_lever=lever)
        roots = np.linalg.eigvals(velocity_vector_loop(law, hull, speed, share=share))
        assert furthest(roots, line_eigenvalues(law, hull, speed, share)) < 1e-4


def test_momentum_vector_s_polynomial_is_that_of_its_equations():
    """In the neutral point's y and sway, so that the origin is at y - x_n psi."""
    k_b, eta, Q, S, x_n = sp.symbols("k_b eta Q S x_n")
    chi_e = (-k_b * (y - x_n * psi) - V * psi - eta * v) / V
    h = k_b * x_n / V
    known = [
        1,
        S + d,
        Q * (1 - h - eta * p) + S * d,
        Q * (d * (1 - h) + k_b * (1 - p)),
        Q * k_b * d,
    ]
    derived = polynomial(Q * chi_e - S * r)
    assert all(sp.expand(a - b) == 0 for a, b in zip(derived, known, strict=True))


@each_hull
def test_momentum_vector_s_polynomial_is_a_part_of_the_real_loop_and_stable(hull):
    law = MomentumVector(N_m=0.9 * hull.m33)
    for speed in (0.1, 0.2, 0.5, 1.0):
        known = momentum_vector_polynomial(*momentum_vector_gains(law, hull, speed))
        found = line_eigenvalues(law, hull, speed)
        assert furthest(np.roots(known), found) < 1e-4
        assert found.real.max() < 0.0


@given(
    told=st.floats(-0.5, 8.0),
    damping=st.floats(1e-3, 10.0),
    more=st.floats(0.0, 1.0),
    trust=st.floats(1.0, 3.0),
)
def test_its_gains_bear_every_p_up_to_trust_times_the_told_one(told, damping, more, trust):
    law = MomentumVector(trust=trust)
    k = bundle(law.constants_with(NONLINEAR))
    eta, k_b = schedule(SwayResponse(told, damping), k)
    true = SwayAnswer(told * (1.0 + more * (trust - 1.0)), damping)
    grown = growth(momentum_vector_polynomial(true, MomentumGains(eta, k_b, k.Q, k.S, 0.0)))
    assert grown < 0.0


def test_its_gain_leaves_routh_s_third_condition_a_margin_where_it_binds():
    """(a_3 a_2 - a_1) a_1 > a_3^2 a_0; without its bound it fails here, and the path grows."""
    for trust in (1.0, 1.25):
        k = bundle(MomentumVector(trust=trust).constants_with(NONLINEAR))
        eta, k_b = schedule(SwayResponse(1.064 / trust, 0.065), k)
        for gain, stable in ((k_b, True), (0.3 * 0.065 / 0.064, False)):
            at = SwayAnswer(1.064, 0.065), MomentumGains(eta, gain, k.Q, k.S, 0.0)
            _, a_3, a_2, a_1, a_0 = found = momentum_vector_polynomial(*at)
            ratio = (a_3 * a_2 - a_1) * a_1 / (a_3 * a_3 * a_0)
            assert (ratio > 1.05, growth(found) < 0.0) == (stable, stable)


def test_behind_pods_told_their_lever_it_is_as_stable():
    for hull in (NONLINEAR, CYBERSHIP):
        law = MomentumVector(thrust_lever=0.5, omega_v=6.0)  # its poles away from the polynomial's
        known = momentum_vector_polynomial(*momentum_vector_gains(law, hull, 0.5))
        found = line_eigenvalues(law, hull, 0.5, -1.0 / 0.5)
        assert furthest(np.roots(known), found) < 1e-4
        assert found.real.max() < 0.0


@pytest.mark.slow
def test_the_map_of_eigenvalues_is_drawn(tmp_path):
    script = runpy.run_path(str(PACKAGE.parent / "examples/eigenvalue_map.py"))
    script["draw"](tmp_path / "map.png")
    assert (tmp_path / "map.png").stat().st_size > 20_000
    assert script["momentum_growth"](1.5, 0.3) < 0.0 < script["vector_growth"](1.5, 0.3)


# --- the finding

HULL = ("vessel={preset: cybership2}", "disturbance={kind: none}", "simulation.duration=240")
OFF = ("start={x: -1.0, y: 0.5, u: 0.5}", "path={kind: line, speed: 0.5}")


def test_a_hull_whose_sway_answers_yaw_too_much_is_told_and_swings():
    told = (*HULL, *OFF, "controller={kind: velocity_vector}")
    text = finding("sway-answers-yaw", *told).text
    assert "p_eff = (m11 V - Y_r)/(m22 V) = 1.19 at V = 0.5 m/s" in text
    assert "grows at 0.45 1/s" in text
    assert late("z_e", *told).max() > 0.05
    for other in (
        (*told[:-1], "controller={kind: momentum_vector}"),
        (*told, "vessel={preset: paper_nonlinear}"),
    ):
        assert "sway-answers-yaw" not in codes(*other)
        assert late("z_e", *other).max() < 0.01


def test_sway_that_the_loads_cause_brings_damping_and_silence():
    sea = [
        f"b_{axis}: {{mean: {mean}, sin: 0, cos: 0}}"
        for axis, mean in zip("uvr", (0, 0.5, 0), strict=True)
    ]
    loads = "disturbance={kind: harmonic, " + ", ".join(sea) + "}"
    case = (*HULL, *OFF, "controller={kind: velocity_vector}", loads)
    assert "sway-answers-yaw" not in codes(*case)
    assert late("z_e", *case).max() < 1e-3
