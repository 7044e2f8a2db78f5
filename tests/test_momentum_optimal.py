"""`gains: lqr` of momentum_vector: optimal by scipy, the loop's poles, and what it reaches."""

import math
from typing import Any

import numpy as np
import pytest
import sympy as sp
from conftest import NONLINEAR, VESSELS
from findings_samples import codes, finding
from hypothesis import given
from hypothesis import strategies as st
from law_samples import rms, task
from line_loops import furthest, line_eigenvalues
from scipy.linalg import solve_continuous_are, solve_continuous_lyapunov

from podusv_cli.components.controllers.momentum_optimal import (
    SLIGHT,
    YawGains,
    optimal,
    stable_factor,
)
from podusv_cli.components.controllers.momentum_schedule import Answer, schedule
from podusv_cli.components.controllers.momentum_vector import MomentumVector
from podusv_cli.core.kernel import Vector, bundle
from podusv_cli.theory.lateral import (
    MomentumGains,
    SwayAnswer,
    growth,
    momentum_vector_gains,
    momentum_vector_polynomial,
)

LAW = MomentumVector(gains="lqr", N_m=1e3)  # with the moment for its full pace
SHARP = MomentumVector(gains="lqr", k_b0=0.75)  # docs/laws.md
CYBERSHIP = VESSELS["cybership2"]
answers = {"p": st.floats(-0.5, 8.0), "d": st.floats(2e-3, 10.0), "V": st.floats(0.1, 3.0)}


def constants(law: MomentumVector = LAW, **parts: float) -> Any:
    return bundle(law.constants_with(NONLINEAR) | parts)


def plant(p: float, d: float, V: float) -> tuple[Vector, Vector]:
    """Rates of the neutral point's (y, psi, z, r) by themselves, and by alpha."""
    own = np.array([[0, V, 1, 0], [0, 0, 0, 1], [0, 0, -d, -p * V], [0, 0, 0, 0.0]])
    return own, np.array([[0.0], [0.0], [0.0], [1.0]])


def borne(p: float) -> float:
    """What the law takes p for."""
    return math.copysign(max(abs(p), SLIGHT), p)


def weight(k: Any, V: float) -> Vector:
    return np.diag([(k.across / V) ** 2, k.q_psi, 0.0, k.q_r])


def feedback(gains: YawGains, k: Any, V: float) -> Vector:
    """K of alpha = -K (y, psi, z, r), as the law's equations have it."""
    eta, k_b, S, Q_per_S = gains
    Q = Q_per_S * S
    return np.array([Q * k_b / V, Q * (1.0 - k_b * k.x_n / V), Q * eta / V, S])


def cost(K: Vector, k: Any, at: Answer, V: float) -> float:
    """The integral of the weighted squares from a unit of each state; infinite if it grows."""
    own, push = plant(*at, V)
    loop = own - push @ K[None]
    if np.linalg.eigvals(loop).real.max() >= 0.0:
        return np.inf
    return float(np.trace(solve_continuous_lyapunov(loop.T, -weight(k, V) - np.outer(K, K))))


# --- the gains


@given(**answers, x_n=st.floats(0.0, 0.3))
def test_the_gains_are_those_of_scipy_s_riccati_equation(p, d, V, x_n):
    k = constants(x_n=x_n)
    own, push = plant(borne(p), d, V)
    known = push.T @ solve_continuous_are(own, push, weight(k, V), np.eye(1))
    found = feedback(optimal(Answer(p, d), V, k), k, V)
    np.testing.assert_allclose(found, known[0], rtol=1e-4)


@pytest.mark.parametrize(("p", "d"), [(0.763, 0.026), (1.2, 0.3), (3.0, 0.05)])
def test_any_other_gain_costs_more(p, d):
    at, V, k = Answer(p, d), 0.5, constants()
    gains = optimal(at, V, k)
    least = cost(feedback(gains, k, V), k, at, V)
    for place, one in enumerate(gains):
        for factor in (0.97, 1.03, -1.0):
            other = YawGains(*(one * factor if i == place else g for i, g in enumerate(gains)))
            assert cost(feedback(other, k, V), k, at, V) > least
    safe = schedule(at, k)
    other = YawGains(safe.eta, safe.k_b, k.S, k.Q_per_S)
    assert cost(feedback(other, k, V), k, at, V) > least


@given(d=st.floats(2e-3, 10.0), V=st.floats(0.1, 3.0))
def test_where_sway_does_not_answer_yaw_they_are_the_keys_own(d, V):
    found = optimal(Answer(0.0, d), V, constants())
    known = (LAW.k_b0, LAW.S0, LAW.Q0 / LAW.S0)
    assert (found.k_b, found.S, found.Q_per_S) == pytest.approx(known, rel=2e-3)


def test_weights_that_would_be_negative_are_zero():
    k = constants(LAW.model_copy(update={"S0": 2.0, "k_b0": 4.0}))
    assert (k.q_r, k.q_psi) == (0.0, 0.0)
    assert k.chain_S == pytest.approx(2.0 * k.across ** (1 / 3))  # Butterworth's poles
    own, push = plant(1.2, 0.3, 0.5)
    known = push.T @ solve_continuous_are(own, push, weight(k, 0.5), np.eye(1))
    np.testing.assert_allclose(feedback(optimal(Answer(1.2, 0.3), 0.5, k), k, 0.5), known[0], 1e-6)


# --- the polynomial


def test_the_equations_of_its_coefficients_are_the_factorisation():
    """D(s) D(-s) = A(s) A(-s) + sum of q n(s) n(-s), over y, psi and r; docs/theory.md."""
    s, p, d, V, y, psi, r = sp.symbols("s p d V q_y q_psi q_r")
    a, b, c, e = sp.symbols("a b c e")

    def even(one: sp.Expr) -> sp.Expr:
        return one * one.subs(s, -s)

    whole = even(s**3 * (s + d)) + y * even(V * ((1 - p) * s + d))
    whole += psi * even(s * (s + d)) + r * even(s**2 * (s + d))
    known = [  # A_3, A_2, A_1, A_0
        d**2 + r, r * d**2 + psi, psi * d**2 + y * V**2 * (1 - p) ** 2, y * V**2 * d**2,
    ]  # fmt: skip
    coefficients = sp.Poly(sp.expand(whole), s).all_coeffs()[2::2]
    signs = (-1, 1, -1, 1)
    assert [sp.expand(f - g * h) for f, g, h in zip(coefficients, known, signs, strict=True)] == [
        0
    ] * 4
    mine = sp.Poly(sp.expand(even(s**4 + a * s**3 + b * s**2 + c * s + e)), s).all_coeffs()[2::2]
    left = [a**2 - 2 * b, b**2 - 2 * a * c + 2 * e, c**2 - 2 * b * e, e**2]
    assert [sp.expand(f - g * h) for f, g, h in zip(mine, left, signs, strict=True)] == [0] * 4


@given(**answers)
def test_the_loop_has_the_designed_polynomial_and_is_stable(p, d, V):
    k = constants()
    eta, k_b, S, Q_per_S = optimal(Answer(p, d), V, k)
    p = borne(p)
    gains = MomentumGains(eta, k_b, Q_per_S * S, S, k_b * k.x_n / V)
    found = momentum_vector_polynomial(SwayAnswer(p, d), gains)
    design = [1.0, *stable_factor(d, abs(1.0 - p), k), k.across * d]
    np.testing.assert_allclose(found, design, rtol=1e-6)
    assert growth(found) < 0.0


@given(
    d=st.floats(1e-3, 10.0), off=st.floats(0.0, 9.0), Q0=st.floats(1.0, 60.0),
    S0=st.floats(1.0, 30.0), k_b0=st.floats(0.1, 3.0),
)  # fmt: skip
def test_newton_s_start_is_above_the_sum_of_the_roots_and_it_stays_there(d, off, Q0, S0, k_b0):
    """So it comes down to the largest root: the sum grows with every A_i."""
    k = constants(MomentumVector(gains="lqr", N_m=1e3, Q0=Q0, S0=S0, k_b0=k_b0))
    squares = np.roots([
        1.0, -(d * d + k.q_r), k.q_r * d * d + k.q_psi,
        -(k.q_psi * d * d + (k.across * off) ** 2), (k.across * d) ** 2,
    ])  # fmt: skip
    known = np.sqrt(squares + 0j).real.sum()
    start = k.chain_S * np.sqrt(max(off, 1.0)) + d
    found = stable_factor(d, off, k)
    assert known * (1 - 1e-6) <= found.a <= start * (1 + 1e-9)
    assert growth(np.array([1.0, *found, k.across * d])) < 0.0  # also where more steps are needed


HULLS = [hull for hull in VESSELS.values() if hull.coriolis == 1.0]  # as the law counts on


@pytest.mark.parametrize("hull", HULLS, ids=lambda hull: hull.preset)
def test_its_poles_are_those_of_the_real_loop(hull):
    """To what central differences see of the damping with abs(v), times a Q of up to 280 1/s2."""
    law = MomentumVector(gains="lqr", N_m=0.9 * hull.m33)
    for speed in (0.1, 0.2, 0.5, 1.0):
        known = momentum_vector_polynomial(*momentum_vector_gains(law, hull, speed))
        found = line_eigenvalues(law, hull, speed)
        assert furthest(np.roots(known), found) < 5e-3
        assert found.real.max() < 0.0


def test_told_the_lever_of_pods_its_poles_are_the_designed_ones_too():
    law = MomentumVector(gains="lqr", thrust_lever=0.5, omega_v=6.0)
    for hull in (NONLINEAR, CYBERSHIP):
        at, gains = momentum_vector_gains(law, hull, 0.5)
        k = bundle(law.constants_with(hull))
        design = [1.0, *stable_factor(at.d, abs(1.0 - at.p), k), k.across * at.d]
        np.testing.assert_allclose(momentum_vector_polynomial(at, gains), design, rtol=1e-6)
        found = line_eigenvalues(law, hull, 0.5, -1.0 / 0.5)
        assert furthest(np.roots(design), found) < 1e-4


# --- what it reaches, and the finding


@pytest.mark.parametrize(
    ("law", "IAE", "line", "circle"),
    [(MomentumVector(gains="lqr"), 213.4, 6.7, 17.1), (SHARP, 210.9, 8.5, 8.5)],
)
def test_on_the_paper_s_task_it_is_what_the_table_says(law, IAE, line, circle):
    """docs/laws.md, in m s and mm."""
    out = task(law)
    assert np.trapezoid(out["z_e"], out["time"]) == pytest.approx(IAE, abs=0.1)
    found = [1e3 * rms(out, 60, 100), 1e3 * rms(out, 150)]
    assert found == pytest.approx([line, circle], abs=0.1)


def test_before_a_run_it_is_told_where_the_vessel_is_another():
    hull, lqr = "vessel={preset: cybership2}", "controller={kind: momentum_vector, gains: lqr}"
    told, code = "nominal={preset: paper_nonlinear}", "optimal-elsewhere"
    path = "path={kind: line, speed: 0.5}"
    text = finding(code, hull, told, lqr, path, "disturbance={kind: none}").text
    assert "p_eff = 1.19" in text
    assert "in place of 0.763" in text
    assert "gains: schedule" in text
    assert code in codes(hull, told, lqr, "path={kind: line, speed: 0.0}")
    assert code not in codes(hull, lqr)
    drag = "nominal={preset: cybership2, X_u: -2.0}"  # no gain of the yaw part reads it
    assert code not in codes(hull, drag, lqr, path)
    assert code not in codes(hull, told, "controller={kind: momentum_vector}")
