"""The laws: shunting (17), the demands and adaptation (26)-(28), (35)-(37), and every option."""

import math
from typing import Any

import numpy as np
import pytest
from conftest import NONLINEAR, Answer, Situation, ask, corrected, run, situations
from hypothesis import given
from hypothesis import strategies as st

from podusv_cli.components.controllers.adaptive_neural import AdaptiveNeural, shunting_rate
from podusv_cli.components.controllers.dsc import DynamicSurface
from podusv_cli.components.controllers.full_backstepping import (
    FullBackstepping,
    alpha_r_rate,
    alpha_u_rate,
)
from podusv_cli.components.controllers.network import activation
from podusv_cli.components.controllers.pid import Pid
from podusv_cli.components.controllers.polar_backstepping import PolarBackstepping
from podusv_cli.components.controllers.tracking import Tracking, track
from podusv_cli.core.kernel import Vector, bundle

POLAR = (AdaptiveNeural, DynamicSurface, FullBackstepping)
UNEQUAL = {
    "k_ue": 3.0,
    "k_re": 30.0,
    "Gamma_u": 90.0,
    "Gamma_r": 80.0,
    "sigma_u": 0.2,
    "sigma_r": 0.3,
    "gamma_u": 700.0,
    "gamma_r": 600.0,
    "sigma_bu": 0.02,
    "sigma_br": 0.03,
    "b_hat_u0": 0.1,
    "b_hat_r0": 0.2,
    "partial": 0.15,
}
TURNED = {"AdaptiveNeural": {"A_u": 4.0, "A_r": 6.0}, "DynamicSurface": {"T_u": 0.3, "T_r": 0.1}}
number = st.floats(-100, 100)


def changed(kind: Any) -> Any:
    """The law with a different number everywhere, so that no two can be mixed up."""
    return kind(**UNEQUAL, **TURNED.get(kind.__name__, {}))


def evaluate(law: Any, at: Situation) -> tuple[Answer, Tracking]:
    e = track(at.x, at.memory, at.target, bundle(law.constants_with(NONLINEAR)))
    return ask(law, *at, NONLINEAR), e


@given(alpha=number, A=st.floats(0.1, 20), B=st.floats(0.1, 20))
def test_a_constant_bound_is_one_and_its_gain_is_less_than_one_over_it(alpha, A, B):
    # At the bound beta is driven back whatever alpha is, so |beta| < B for good.
    assert shunting_rate(alpha, B, A, B) < 0 < shunting_rate(alpha, -B, A, B)
    settled = B / (A + abs(alpha)) * alpha
    assert abs(settled) < B
    assert shunting_rate(alpha, settled, A, B) == pytest.approx(
        0.0, abs=1e-11 * (1 + abs(alpha)) * B
    )


def test_in_a_run_a_constant_bound_holds_and_the_adaptive_one_does_not():
    tight = corrected(controller=AdaptiveNeural(B_u=0.8, filter_start="zero"))
    out = run(tight, 3.0)
    assert abs(out["beta_u"]).max() < 0.8 < abs(out["alpha_u"]).max()
    out = run(corrected(controller=AdaptiveNeural(A_u=0.8, filter_start="zero")), 3.0)
    assert abs(out["beta_u"]).max() > 0.8


def filtered(law: Any, at: Situation, e: Tracking) -> tuple[Vector, Vector]:
    """(beta, beta_dot), on both axes, of each differentiator."""
    alpha, beta = np.array([e.alpha_u, e.alpha_r]), at.memory[-2:]
    if isinstance(law, AdaptiveNeural):
        return beta, (np.array([law.A_u, law.A_r]) + abs(alpha)) * (alpha - beta)
    if isinstance(law, DynamicSurface):
        return beta, (alpha - beta) / [law.T_u, law.T_r]
    k = bundle(law.constants_with(NONLINEAR))
    surge = ask(law, *at, NONLINEAR).tau[0]
    rates = [alpha_u_rate(e, at.x, at.target, k), alpha_r_rate(e, at.x, at.target, k, surge)]
    return alpha, np.array(rates)


@pytest.mark.parametrize("kind", POLAR)
def test_demand_and_adaptation_are_26_to_28_and_35_to_37(kind):
    law, m = changed(kind), np.array([NONLINEAR.m11, NONLINEAR.m33])
    k, Gamma, sigma = np.array([[3.0, 30.0], [90.0, 80.0], [0.2, 0.3]])
    gamma, sigma_b, b_0 = np.array([[700.0, 600.0], [0.02, 0.03], [0.1, 0.2]])
    for at in situations(law, 100):
        answer, e = evaluate(law, at)
        beta, beta_dot = filtered(law, at, e)
        b_hat, W_hat = at.memory[2:4], at.memory[4:58].reshape(2, 27)
        error = at.x[[3, 5]] - beta
        Phi = activation(law.network, at.x[None, 3:])[0]
        phi = error / (4 * 0.15)
        f_hat = W_hat @ Phi
        coupling = np.array([e.z_e * math.cos(e.psi_e), e.psi_e])
        tau = -k * error - m * f_hat - b_hat * phi + m * beta_dot + coupling
        np.testing.assert_allclose(answer.tau, tau, rtol=1e-12, atol=1e-11)
        np.testing.assert_allclose(
            answer.rate[2:4], gamma * (error * phi - sigma_b * (b_hat - b_0)), rtol=1e-12
        )
        W_rate = Gamma[:, None] * (np.outer(error * m, Phi) - sigma[:, None] * W_hat)
        np.testing.assert_allclose(answer.rate[4:58], W_rate.ravel(), rtol=1e-12, atol=1e-12)
        if kind is not FullBackstepping:
            np.testing.assert_allclose(answer.rate[58:], beta_dot, rtol=1e-12)
        assert not answer.rate[:2].any()
        said = [answer.signals[name] for name in ("u_e", "r_e", "f_hat_u", "f_hat_r")]
        np.testing.assert_allclose(said, [*error, *f_hat], rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("kind", POLAR)
def test_the_sign_of_the_coupling_changes_its_own_terms_only(kind):
    printed, right = kind(coupling="printed"), kind(coupling="corrected")
    for at in situations(right, 100):
        (one, e), (other, _) = evaluate(printed, at), evaluate(right, at)
        surge = -2 * e.z_e * math.cos(e.psi_e)
        yaw = -2 * e.psi_e
        if kind is FullBackstepping:
            # The surge force asked for is part of the derivative of alpha_r.
            sine = math.sin(e.psi_e - e.half_turn)
            yaw += NONLINEAR.m33 * surge / NONLINEAR.m11 * sine / e.distance
        np.testing.assert_allclose(one.tau - other.tau, [surge, yaw], rtol=1e-9, atol=1e-10)
        np.testing.assert_array_equal(one.rate, other.rate)
        assert one.signals == other.signals


def test_pid_is_three_gains_on_the_velocity_errors():
    law = Pid(K_Pu=11.0, K_Iu=12.0, K_Du=13.0, K_Pr=21.0, K_Ir=22.0, K_Dr=23.0, T_d=0.3)
    for at in situations(law, 100):
        answer, e = evaluate(law, at)
        error = np.array([e.alpha_u - at.x[3], e.alpha_r - at.x[5]])
        integral, lag = at.memory[2:4], at.memory[4:6]
        slope = (error - lag) / 0.3
        P, I, D = np.array([[11.0, 21.0], [12.0, 22.0], [13.0, 23.0]])  # noqa: E741
        np.testing.assert_allclose(answer.tau, P * error + I * integral + D * slope, rtol=1e-12)
        np.testing.assert_array_equal(answer.rate, [0, 0, *error, *slope])
        assert (answer.signals["u_e"], answer.signals["r_e"]) == (-error[0], -error[1])


def test_pid_may_follow_the_path_s_own_speed_and_yaw_rate():
    law = Pid(reference="path", K_Pu=1.0, K_Iu=0.0, K_Du=0.0, K_Pr=1.0, K_Ir=0.0, K_Dr=0.0)
    for at in situations(law, 100):
        speed, course, turn, gain = 0.7, 0.3 + at.x[0], -0.11, 0.05  # u_d, psi_d, r_d, u_d'
        along, across = (
            np.array([np.cos(course), np.sin(course)]),
            np.array([-np.sin(course), np.cos(course)]),
        )
        target = np.concatenate(
            [at.target[:2], speed * along, gain * along + speed * turn * across]
        )
        answer, _ = evaluate(law, at._replace(target=target))
        np.testing.assert_allclose(
            answer.tau, [speed - at.x[3], turn - at.x[5]], rtol=1e-9, atol=1e-12
        )
    standing = at._replace(target=np.array([5.0, 5.0, 0, 0, 0.1, 0.1]))
    assert evaluate(law, standing)[0].tau.tolist() == [-at.x[3], -at.x[5]]


@pytest.mark.parametrize("kind", [AdaptiveNeural, DynamicSurface])
def test_the_filter_starts_at_zero_or_settled(kind):
    for at in situations(kind(), 20):
        cold = kind(filter_start="zero").start(at.x, at.target, NONLINEAR)
        warm = kind(filter_start="alpha").start(at.x, at.target, NONLINEAR)
        assert cold[-2:].tolist() == [0.0, 0.0]
        np.testing.assert_array_equal(cold[:-2], warm[:-2])
        answer, e = evaluate(kind(), at._replace(memory=warm))
        assert warm[-2:].tolist() == [e.alpha_u, e.alpha_r]
        assert answer.rate[-2:].tolist() == [0.0, 0.0]


def test_the_lag_starts_at_zero_or_at_the_error():
    for at in situations(Pid(), 20):
        cold = Pid(lag_start="zero").start(at.x, at.target, NONLINEAR)
        warm = Pid(lag_start="error").start(at.x, at.target, NONLINEAR)
        assert not cold[2:].any()
        # Without a derivative at the start, the demand is the proportional part alone.
        answer, _ = evaluate(Pid(), at._replace(memory=warm))
        expected = [-1100 * answer.signals["u_e"], -80 * answer.signals["r_e"]]
        np.testing.assert_allclose(answer.tau, expected, rtol=1e-12)


@pytest.mark.parametrize("kind", POLAR)
def test_bounds_and_weights_start_where_leakage_pulls_them(kind):
    law: PolarBackstepping = kind(b_hat_u0=0.3, b_hat_r0=0.4, network={"initial_weight": 0.05})
    at = next(situations(law, 1))
    memory = law.start(at.x, at.target, NONLINEAR)
    assert memory[2:4].tolist() == [0.3, 0.4]
    assert set(memory[4:58]) == {0.05}


@pytest.mark.parametrize("kind", [*POLAR, Pid])
def test_a_law_works_where_the_direction_is_held(kind):
    # The paper's rule for z_e = 0: psi_d keeps its value and its derivatives are zero.
    law = kind(hold_below=0.2)
    for distance in (0.0, 1e-9, 0.1):
        x, target = np.array([0, 0, 0.1, 0.3, 0.1, 0.1]), np.array([distance, 0, 0.5, 0, 0, 0])
        memory = law.start(x, target, NONLINEAR)
        tau = ask(law, x, memory, target, NONLINEAR).tau
        assert np.abs(tau).max() < 1e4


def test_while_held_the_full_law_s_derivatives_are_those_of_a_fixed_direction():
    law = FullBackstepping(hold_below=2.0, k_psie=0.7)
    x, target = np.array([0, 0, 0.1, 0.3, 0.1, 0.2]), np.array([0.9, 0.3, 0.5, 0.1, 0, 0])
    memory = law.start(x, target, NONLINEAR)
    k = bundle(law.constants_with(NONLINEAR))
    e = track(x, memory, target, k)
    # alpha_r = k_psie (psi_d - psi) with psi_d at rest.
    assert e.alpha_r == pytest.approx(0.7 * e.psi_e)
    assert alpha_r_rate(e, x, target, k, 3.0) == pytest.approx(-0.7 * x[5])
