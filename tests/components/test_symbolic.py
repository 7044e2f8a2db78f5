"""The paper's algebra, derived anew with sympy and held against the kernels.

Symbols are the paper's. Each test compares an identity with the implementation where there is one,
so that a wrong sign planted in a law, in the plant or in the shunting model fails here.
"""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from conftest import PAPER, Situation, ask, situations

from podusv_cli.components.controllers.adaptive_neural import AdaptiveNeural, shunting_rate
from podusv_cli.components.controllers.network import activation
from podusv_cli.components.controllers.polar_backstepping import B_HAT_R, B_HAT_U, WEIGHTS, lemma
from podusv_cli.components.controllers.tracking import track
from podusv_cli.components.vessels.plant import plant
from podusv_cli.core.kernel import Vector, bundle, kernel

# Errors, estimates' errors, and what is unknown.
z_e, psi_e, u_e, r_e, y_u, y_r = sp.symbols("z_e psi_e u_e r_e y_u y_r", real=True)
eps_u, eps_r, b_u, b_r = sp.symbols("epsilon_u epsilon_r b_u b_r", real=True)
b_max_u, b_max_r, bt_u, bt_r = sp.symbols("b_umax b_rmax btilde_u btilde_r", real=True)
b_0u, b_0r = sp.symbols("b_hat_u0 b_hat_r0", real=True)
alpha_u_dot, alpha_r_dot, A_u, A_r, s = sp.symbols("alpha_u_dot alpha_r_dot A_u A_r s", real=True)
# Two nodes stand for any number of them.
NODES = 2
Phi, Wt_u, Wt_r, W_u, W_r = (
    sp.Matrix(sp.symbols(f"{name}:{NODES}", real=True))
    for name in ("Phi", "Wtilde_u", "Wtilde_r", "W_u", "W_r")
)
k_ze, k_psie, k_ue, k_re, m11, m33, partial = sp.symbols(
    "k_ze k_psie k_ue k_re m11 m33 partial", positive=True
)
Gamma_u, Gamma_r, sigma_u, sigma_r, gamma_u, gamma_r, sigma_bu, sigma_br = sp.symbols(
    "Gamma_u Gamma_r sigma_u sigma_r gamma_u gamma_r sigma_bu sigma_br", positive=True
)
X_u, X_r = sp.symbols("X_u X_r", real=True)  # what drives the filter errors: (41), (45)


def phi(xi: Any) -> Any:
    """Lemma 1's function, Remark 1."""
    return xi / (4 * partial)


def error_dynamics() -> dict[Any, Any]:
    """Rates of everything in V by (12), (20)-(45), with the sign s of the coupling left open."""
    f_u_tilde, f_r_tilde = Wt_u.dot(Phi), Wt_r.dot(Phi)
    b_hat_u, b_hat_r = bt_u + b_max_u, bt_r + b_max_r
    push_u = -k_ue * u_e - m11 * f_u_tilde - b_hat_u * phi(u_e) + s * z_e * sp.cos(psi_e)
    push_r = -k_re * r_e - m33 * f_r_tilde - b_hat_r * phi(r_e) + s * psi_e
    rates = {
        z_e: -k_ze * z_e - (u_e + y_u) * sp.cos(psi_e),
        psi_e: -k_psie * psi_e - r_e - y_r,
        u_e: (push_u + m11 * eps_u + b_u) / m11,
        r_e: (push_r + m33 * eps_r + b_r) / m33,
        y_u: -A_u * y_u - X_u,
        y_r: -A_r * y_r - X_r,
        bt_u: gamma_u * (u_e * phi(u_e) - sigma_bu * (b_hat_u - b_0u)),
        bt_r: gamma_r * (r_e * phi(r_e) - sigma_br * (b_hat_r - b_0r)),
    }
    for i in range(NODES):
        rates[Wt_u[i]] = Gamma_u * (u_e * m11 * Phi[i] - sigma_u * (Wt_u[i] + W_u[i]))
        rates[Wt_r[i]] = Gamma_r * (r_e * m33 * Phi[i] - sigma_r * (Wt_r[i] + W_r[i]))
    return rates


def lyapunov() -> Any:
    """V (46)."""
    errors = z_e**2 + psi_e**2 + m11 * u_e**2 + m33 * r_e**2 + y_u**2 + y_r**2
    weights = Wt_u.dot(Wt_u) / Gamma_u + Wt_r.dot(Wt_r) / Gamma_r
    return (errors + weights + bt_u**2 / gamma_u + bt_r**2 / gamma_r) / 2


def rate_of_V() -> Any:
    return sum(sp.diff(lyapunov(), x) * rate for x, rate in error_dynamics().items())


def terms_of_rate() -> Any:
    """V' of the corrected law, term by term, as docs/theory.md has it."""
    return (
        -k_ze * z_e**2
        - k_psie * psi_e**2
        - k_ue * u_e**2
        - k_re * r_e**2
        - A_u * y_u**2
        - A_r * y_r**2
        - z_e * y_u * sp.cos(psi_e)
        - psi_e * y_r  # which the paper leaves out
        - y_u * X_u
        - y_r * X_r
        + u_e * m11 * eps_u
        + r_e * m33 * eps_r
        + u_e * b_u
        - b_max_u * u_e * phi(u_e)
        + r_e * b_r
        - b_max_r * r_e * phi(r_e)
        - sigma_u * Wt_u.dot(Wt_u + W_u)
        - sigma_r * Wt_r.dot(Wt_r + W_r)
        - sigma_bu * bt_u * (bt_u + b_max_u - b_0u)
        - sigma_br * bt_r * (bt_r + b_max_r - b_0r)
    )


def test_rate_of_V_of_the_corrected_law_is_the_sum_of_its_terms():
    assert sp.simplify(rate_of_V().subs(s, 1) - terms_of_rate()) == 0


def test_printed_signs_leave_the_cross_terms_doubled():
    left = sp.simplify(rate_of_V().subs(s, -1) - terms_of_rate())
    assert sp.simplify(left + 2 * z_e * u_e * sp.cos(psi_e) + 2 * psi_e * r_e) == 0


def test_the_proof_is_short_of_two_terms():
    # (47) is reached from V' without -z_e y_u cos psi_e - psi_e y_r; they are not negative.
    short = terms_of_rate() + z_e * y_u * sp.cos(psi_e) + psi_e * y_r
    left = rate_of_V().subs(s, 1) - short
    everything_else = {x: 0 for x in error_dynamics() if x not in (z_e, y_u)}
    at = {**everything_else, z_e: 1, y_u: -1, X_u: 0}
    assert left.subs(at) == 1


def flipped(law: AdaptiveNeural, sign: str) -> AdaptiveNeural:
    """The law with one sign planted wrong: its kernel sees the constant negated or turned."""

    @kernel
    def wrong(
        x: Vector,
        memory: Vector,
        target: Vector,
        k: Any,
        table: Vector,
        tau: Vector,
        rate: Vector,
        signals: Vector,
        work: Vector,
    ) -> None:
        turned = 1.0 - k.coupling if sign == "coupling" else -getattr(k, sign)
        k = k._replace(**{sign: turned})
        AdaptiveNeural.law(x, memory, target, k, table, tau, rate, signals, work)

    class Wrong(AdaptiveNeural):
        """A law with a fault."""

        law = staticmethod(wrong)  # type: ignore[assignment]

    return Wrong(**law.model_dump())


def rate_from_kernels(law: AdaptiveNeural, at: Situation, weights: Vector) -> dict[Any, float]:
    """Numbers for the symbols, with V' of the implementation under the key "V_dot"."""
    k, n = bundle(law.constants_with(PAPER)), law.network.count
    said, ds = ask(law, at.x, at.memory, at.target, PAPER), np.zeros(6)
    e, b = track(at.x, at.memory, at.target, k), np.array([0.4, 0.0, -0.3])
    loads = np.array([said.tau[0], 0.0, said.tau[1]])
    plant(at.x, loads, b, bundle(PAPER.constants()), ds)
    plant(at.x, 0.0 * loads, 0.0 * b, bundle(PAPER.constants()), free := np.zeros(6))
    nodes = activation(law.network, at.x[None, 3:6])[0]
    beta, beta_dot, alpha_dot = at.memory[-2:], said.rate[-2:], np.array([0.07, -0.2])
    u, r = said.signals["u_e"], said.signals["r_e"]
    z_dot = e.P - at.x[3] * e.cos_e - at.x[4] * e.sin_e
    y = beta - [e.alpha_u, e.alpha_r]
    tilde = at.memory[WEIGHTS : WEIGHTS + 2 * n].reshape(2, n) - weights
    b_tilde = at.memory[[B_HAT_U, B_HAT_R]] - [0.9, 0.7]
    V_dot = (
        e.z_e * z_dot
        + e.psi_e * (e.exact_w - at.x[5])
        + PAPER.m11 * u * (ds[3] - beta_dot[0])
        + PAPER.m33 * r * (ds[5] - beta_dot[1])
        + y @ (beta_dot - alpha_dot)
        + np.sum(tilde * said.rate[WEIGHTS : WEIGHTS + 2 * n].reshape(2, n)) / law.Gamma_u
        + b_tilde @ said.rate[[B_HAT_U, B_HAT_R]] / law.gamma_u
    )
    decay = law.A_u + np.abs([e.alpha_u, e.alpha_r])
    left = np.array([free[3], free[5]]) - weights @ nodes
    return {
        "V_dot": float(V_dot),
        "tilde": tilde,
        "weights": weights,
        z_e: e.z_e,
        psi_e: e.psi_e,
        u_e: u,
        r_e: r,
        y_u: y[0],
        y_r: y[1],
        A_u: decay[0],
        A_r: decay[1],
        X_u: alpha_dot[0],
        X_r: alpha_dot[1],
        eps_u: left[0],
        eps_r: left[1],
        b_u: b[0],
        b_r: b[2],
        b_max_u: 0.9,
        b_max_r: 0.7,
        bt_u: b_tilde[0],
        bt_r: b_tilde[1],
        b_0u: 0.0,
        b_0r: 0.0,
    }


def worst_gap(law: AdaptiveNeural, count: int = 20) -> float:
    """Largest relative gap between V' of the kernels and the lambdified sum of its terms."""
    gains = {
        g: getattr(law, str(g))
        for g in (k_ze, k_psie, k_ue, k_re, partial, sigma_u, sigma_r, sigma_bu, sigma_br)
    } | {m11: PAPER.m11, m33: PAPER.m33}
    # The two scalar products of the weights are put in as symbols: any number of nodes.
    U, R = sp.symbols("U R")
    expression = terms_of_rate().subs(dict.fromkeys((*Wt_u, *Wt_r), 0)) - sigma_u * U - sigma_r * R
    names = [
        *gains,
        z_e,
        psi_e,
        u_e,
        r_e,
        y_u,
        y_r,
        A_u,
        A_r,
        X_u,
        X_r,
        eps_u,
        eps_r,
        b_u,
        b_r,
        b_max_u,
        b_max_r,
        bt_u,
        bt_r,
        b_0u,
        b_0r,
    ]
    terms = sp.lambdify([*names, U, R], expression)
    random, worst = np.random.default_rng(3), 0.0
    for at in situations(law, count):
        weights = random.normal(0, 0.3, (2, law.network.count))
        found = gains | rate_from_kernels(law, at, weights)
        products = np.sum(found["tilde"] * (found["tilde"] + found["weights"]), axis=1)
        expected = terms(*[found[name] for name in names], *products)
        worst = max(worst, abs(found["V_dot"] - expected) / abs(expected))
    return worst


EXACT = 1e-10
LAW = AdaptiveNeural(Gamma_u=3.0, Gamma_r=3.0, gamma_u=2.0, gamma_r=2.0)


def test_the_implemented_law_has_that_rate():
    assert worst_gap(LAW) < EXACT


@pytest.mark.parametrize("sign", ["coupling", "k_ue", "k_re", "Gamma_u", "gamma_r", "sigma_bu"])
def test_a_wrong_sign_planted_in_the_law_is_seen(sign):
    assert worst_gap(flipped(LAW, sign)) > 1e5 * EXACT


m, I_z, x_g = sp.symbols("m I_z x_g", positive=True)
X_udot, Y_vdot, Y_rdot, N_vdot, N_rdot = sp.symbols("X_udot Y_vdot Y_rdot N_vdot N_rdot")
Xu, Yv, Yr, Nv, Nr = sp.symbols("X_u Y_v Y_r N_v N_r")
u, v, r, tau_u, tau_r, bu, bv, br = sp.symbols("u v r tau_u tau_r b_u b_v b_r")


def kinetics() -> Any:
    """u', v', r' from (4)-(7) with the disturbance added, everything in general position."""
    m22, m23 = m - Y_vdot, m * x_g - Y_rdot
    M = sp.Matrix([[m - X_udot, 0, 0], [0, m22, m23], [0, m * x_g - N_vdot, I_z - N_rdot]])
    a13, a23 = -m22 * v - m23 * r, (m - X_udot) * u
    C = sp.Matrix([[0, 0, a13], [0, 0, a23], [-a13, -a23, 0]])
    D = -sp.Matrix([[Xu, 0, 0], [0, Yv, Yr], [0, Nv, Nr]])
    nu = sp.Matrix([u, v, r])
    loads = sp.Matrix([tau_u + bu, bv, tau_r + br])
    return M.LUsolve(loads - C * nu - D * nu)


SIMPLIFIED = {x_g: 0, Y_rdot: 0, N_vdot: 0, Yr: 0, Nv: 0}


def model_12() -> Any:
    """The right-hand side of (12)."""
    M11, M22, M33 = m - X_udot, m - Y_vdot, I_z - N_rdot
    f_u = M22 / M11 * v * r + Xu / M11 * u
    f_v = -M11 / M22 * u * r + Yv / M22 * v
    f_r = (M11 - M22) / M33 * u * v + Nr / M33 * r
    return sp.Matrix([f_u + (tau_u + bu) / M11, f_v + bv / M22, f_r + (tau_r + br) / M33])


def test_12_follows_from_4_to_7():
    assert sp.simplify(kinetics().subs(SIMPLIFIED) - model_12()) == sp.zeros(3, 1)


def test_the_simplification_as_printed_is_not_enough():
    # It names Y_r and N_v twice and leaves Y_rdot and N_vdot, which couple sway and yaw.
    printed = {x_g: 0, Yr: 0, Nv: 0}
    left = sp.simplify(kinetics().subs(printed) - model_12())
    assert left[1] != 0
    assert left[2] != 0


def test_11_needs_the_other_sign_of_d23():
    # Row 2 of (11): d22 v - d23 r + m11 u r as printed, with d23 = -Y_r; D nu of (7) has + d23 r.
    D_nu_row = -(Yv * v + Yr * r)
    d22, d23 = -Yv, -Yr
    assert sp.expand(D_nu_row - (d22 * v + d23 * r)) == 0
    assert sp.expand(D_nu_row - (d22 * v - d23 * r)) != 0


@pytest.mark.parametrize("seed", range(5))
def test_the_plant_is_that_model(seed):
    random = np.random.default_rng(seed)
    vessel = PAPER.model_copy(
        update={"x_g": 0.05, "Y_rdot": -0.3, "N_vdot": -0.2, "Y_r": -1.1, "N_v": 0.4}
    )
    x, tau, b, ds = random.normal(size=6), random.normal(size=3), random.normal(size=3), np.zeros(6)
    tau[1] = 0.0
    plant(x, tau, b, bundle(vessel.constants()), ds)
    p = {
        name: getattr(vessel, str(name))
        for name in (m, I_z, x_g, X_udot, Y_vdot, Y_rdot, N_vdot, N_rdot, Xu, Yv, Yr, Nv, Nr)
    }
    now = dict(zip((u, v, r), x[3:], strict=True)) | {tau_u: tau[0], tau_r: tau[2]}
    expected = kinetics().subs(p | now | {bu: b[0], bv: b[1], br: b[2]})
    np.testing.assert_allclose(ds[3:], np.array(expected, dtype=float).ravel(), rtol=1e-12)


def test_lemma_1_holds_for_its_function():
    # xi phi(xi) + partial - |xi| is a square over 4 partial.
    size = sp.symbols("xi", nonnegative=True)
    left = size * phi(size) + partial - size
    assert sp.simplify(left - (size - 2 * partial) ** 2 / (4 * partial)) == 0


@pytest.mark.parametrize("p", [0.01, 0.1, 3.0])
def test_the_implemented_function_satisfies_lemma_1(p):
    k = SimpleNamespace(partial=p)
    for xi in np.linspace(-10.0 * p, 10.0 * p, 2001):
        assert abs(xi) <= xi * lemma(float(xi), k) + p * (1.0 + 1e-12)
    touching = 2.0 * p  # where the inequality is an equation: no smaller constant would do
    assert touching == pytest.approx(touching * lemma(touching, k) + p)


def test_16_becomes_17():
    V_m, E_p, E_Na, E_K, g_p, g_Na, g_K = sp.symbols("V_m E_p E_Na E_K g_p g_Na g_K")
    rate_16 = -(E_p + V_m) * g_p + (E_Na - V_m) * g_Na - (E_K + V_m) * g_K  # C_m = 1
    chi, A, B, D, S_plus, S_minus = sp.symbols("chi A B D S_plus S_minus")
    rate_17 = -A * chi + (B - chi) * S_plus - (D + chi) * S_minus
    named = {chi: E_p + V_m, A: g_p, B: E_Na + E_p, D: E_K - E_p, S_plus: g_Na, S_minus: g_K}
    assert sp.expand(rate_17.subs(named) - rate_16) == 0


def test_the_shunting_model_is_17():
    chi, A, B, a = sp.symbols("chi A B alpha", real=True)
    f, g = sp.Max(a, 0), sp.Max(-a, 0)
    rate_17 = sp.lambdify((a, chi, A, B), -A * chi + (B - chi) * f - (B + chi) * g)
    for alpha, beta, decay, bound in np.random.default_rng(1).normal(0, 2, (50, 4)):
        bound, decay = abs(bound), abs(decay)
        expected = rate_17(alpha, beta, decay, bound)
        assert shunting_rate(alpha, beta, decay, bound) == pytest.approx(expected, abs=1e-12)
        adaptive = rate_17(alpha, beta, decay, decay + abs(alpha))
        assert shunting_rate(alpha, beta, decay, math.nan) == pytest.approx(adaptive, abs=1e-12)
