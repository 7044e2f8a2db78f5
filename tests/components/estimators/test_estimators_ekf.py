"""The extended Kalman filter: derivatives, covariance against Riccati equations, consistency."""

from typing import Any

import numpy as np
import pytest
from conftest import NONLINEAR, VESSELS, Constant
from estimator_samples import Steady, Taken, delivered, errors, sailed
from scipy.linalg import expm, solve_discrete_are, solve_discrete_lyapunov

from podusv_cli.components.estimators.ekf import ExtendedKalmanFilter, N
from podusv_cli.components.estimators.slopes import slopes
from podusv_cli.components.vessels.plant import plant
from podusv_cli.core.kernel import Vector, bundle, call
from podusv_cli.engine.machine import compile, signatures

UPPER = np.triu_indices(N)
AFLOAT = {"controller": Constant(), "start": (0.0,) * 6}


def square(packed: Vector) -> Vector:
    """The covariance, or one for each row of the log, from the upper triangle."""
    full = np.zeros((*packed.shape[:-1], N, N))
    full[..., UPPER[0], UPPER[1]] = packed
    full[..., UPPER[1], UPPER[0]] = packed
    return full


def motion(x: Vector, load: Vector, tau: Vector, k: Any) -> Vector:
    """Rates of x under a load (north, east, about the vertical)."""
    c, s = np.cos(x[2]), np.sin(x[2])
    b = np.array([c * load[0] + s * load[1], c * load[1] - s * load[0], load[2]])
    rate = np.full(6, np.nan)
    plant(x, tau, b, k, rate)
    return rate


def derivative(x: Vector, load: Vector, k: Any) -> Vector:
    """F as the filter has it, 9 x 9."""
    c, s = np.cos(x[2]), np.sin(x[2])
    b = np.array([c * load[0] + s * load[1], c * load[1] - s * load[0], load[2]])
    f = np.full(54, np.nan)
    slopes(x, 0.0, 0.0, b, c, s, k, f)
    return np.vstack([f.reshape(6, N), np.zeros((3, N))])


def noise(k: Any) -> Vector:
    """Q."""
    return np.diag(np.square([0, 0, 0, k.q_u, k.q_v, k.q_r, k.q_b, k.q_b, k.q_b_psi]))


@pytest.mark.parametrize("vessel", VESSELS.values(), ids=VESSELS)
def test_the_derivatives_are_those_of_the_plant(vessel):
    random, k = np.random.default_rng(1), bundle(vessel.constants())
    for _ in range(5):
        at = random.normal(0.0, 0.5, N)
        tau = random.normal(size=3)
        found = [
            (motion(*np.split(at + d, [6]), tau, k) - motion(*np.split(at - d, [6]), tau, k)) / 2e-6
            for d in 1e-6 * np.eye(N)
        ]
        expected = derivative(at[:6], at[6:], k)[:6]
        np.testing.assert_allclose(expected, np.transpose(found), rtol=1e-6, atol=1e-7)


class Rest:
    """What theory says of the filter for a vessel at rest, which is linear, seen every 0.2 s."""

    def __init__(self, ekf: ExtendedKalmanFilter) -> None:
        k = bundle(ekf.constants_with(NONLINEAR))
        F = derivative(np.zeros(6), np.zeros(3), k)
        van_loan = expm(np.block([[-F, noise(k)], [np.zeros((N, N)), F.T]]) * 0.2)
        phi, H = van_loan[N:, N:].T, np.eye(3, N)
        R = np.diag(np.square([k.sigma_p, k.sigma_p, k.sigma_psi]))
        before = solve_discrete_are(phi.T, H.T, phi @ van_loan[:N, N:], R)
        gain = np.linalg.solve(H @ before @ H.T + R, H @ before).T
        self.after = before - gain @ H @ before
        # Errors where the measurements are noisy and nothing wanders.
        self.calm = solve_discrete_lyapunov((np.eye(N) - gain @ H) @ phi, gain @ R @ gain.T)


def test_the_covariance_is_that_of_the_discrete_riccati_equation():
    out = sailed(ExtendedKalmanFilter(), Taken(every=10), 60.0, **AFLOAT)
    expected = Rest(ExtendedKalmanFilter()).after
    np.testing.assert_allclose(square(out["P_est"][-1]), expected, rtol=1e-5, atol=1e-9)


def test_noise_gets_through_as_theory_says():
    noisy = Taken(every=10, sigma_p=0.02, sigma_psi=0.005)
    out = sailed(ExtendedKalmanFilter(), noisy, 800.0, **AFLOAT)
    rms = np.sqrt((errors(out)[5000::10] ** 2).mean(axis=0))
    expected = np.sqrt(np.diagonal(Rest(ExtendedKalmanFilter()).calm)[:6])
    np.testing.assert_allclose(rms, expected, rtol=0.1)
    assert (rms[:3] < 0.8 * np.array([0.02, 0.02, 0.005])).all()


class Truth:
    """A vessel whose accelerations and load wander as the filter believes, seen at 5 Hz."""

    def __init__(self, ekf: ExtendedKalmanFilter, seed: int) -> None:
        self.random, names = np.random.default_rng(seed), ekf.constants_with(NONLINEAR)
        self.k = bundle(names)
        self.p, self.table = np.array(list(names.values())), np.zeros(1)
        self.doors = {
            part: compile.entry(part, getattr(ekf, part), tuple(names))
            for part in ("correct", "follow")
        }
        at = np.array([0.0, 0.0, 3.0, 0.3, 0.0, 0.1])
        self.state, self.seen = ekf.start(at, NONLINEAR), np.concatenate([at, np.zeros(12)])
        load = self.random.normal(size=3) * [ekf.sigma_b, ekf.sigma_b, ekf.sigma_b_psi]
        self.at = np.concatenate([at, load])
        self.tau = np.array([1.5, 0.0, 0.3])

    def rate(self, state: Vector) -> Vector:
        """The filter's."""
        rate = np.empty_like(state)
        vectors = (self.seen, self.tau, state, self.p, self.table, rate)
        self.doors["follow"](0.0, *map(signatures.pointer, vectors))
        return rate

    def move(self, h: float) -> None:
        """One step of both: Euler and Maruyama for the truth, RK4 for the filter."""
        rate = np.concatenate([motion(self.at[:6], self.at[6:], self.tau, self.k), np.zeros(3)])
        wander = np.sqrt(np.diagonal(noise(self.k)) * h) * self.random.normal(size=N)
        self.at = self.at + h * rate + wander
        one = self.rate(self.state)
        two = self.rate(self.state + h / 2 * one)
        three = self.rate(self.state + h / 2 * two)
        four = self.rate(self.state + h * three)
        self.state = self.state + h / 6 * (one + 2 * two + 2 * three + four)

    def deliver(self) -> float:
        """Measure and correct; the normalised squared error of the estimate."""
        sigma = [self.k.sigma_p, self.k.sigma_p, self.k.sigma_psi]
        self.seen[:3] = self.at[:3] + self.random.normal(size=3) * sigma
        self.seen[6:9] = 1.0
        vectors = (self.seen, self.state, self.p, self.table)
        self.doors["correct"](0.0, *map(signatures.pointer, vectors))
        e = self.state[:N] - self.at
        return float(e @ np.linalg.solve(square(self.state[N:-12]), e))


def test_the_errors_are_consistent_with_the_covariance():
    # The mean of N squared normal numbers is N; over 600 deliveries whose errors are related for
    # about 2 s it is known to some 6 %.
    truth, found = Truth(ExtendedKalmanFilter(), seed=3), []
    for _ in range(600):
        for _ in range(10):
            truth.move(0.02)
        found.append(truth.deliver())
    assert np.mean(found[25:]) == pytest.approx(N, rel=0.18)
    squares, counts = truth.state[-12:-6], truth.state[-6:]
    assert counts.tolist() == [600.0] * 3 + [0.0] * 3
    np.testing.assert_allclose(squares[:3] / 600, 1.0, atol=4.0 * np.sqrt(2.0 / 600))
    assert not squares[3:].any()


def test_the_covariance_stays_symmetric_and_positive():
    sharp = ExtendedKalmanFilter(sigma_p=1e-5, sigma_psi=1e-6)
    for ekf in (ExtendedKalmanFilter(), sharp):
        gap = Taken(every=10, velocities=True, gone=10.0, back=40.0)
        P = square(sailed(ekf, gap, 60.0)["P_est"])
        scale = np.sqrt(np.diagonal(P, axis1=1, axis2=2))[1:]
        correlation = P[1:] / scale[:, :, None] / scale[:, None, :]
        assert np.linalg.eigvalsh(correlation).min() > -1e-9


def test_it_finds_a_constant_load_and_the_state_with_it():
    out = sailed(ExtendedKalmanFilter(), Taken(every=10), 60.0, disturbance=Steady())
    found = [out[part][-1] for part in ("b_est_x", "b_est_y", "b_est_psi")]
    np.testing.assert_allclose(found, [0.6, -0.4, 0.1], atol=1e-4)
    assert abs(errors(out)[-1]).max() < 1e-4


def test_without_bias_there_is_no_load_and_the_estimate_stays_off():
    blind, found = (
        sailed(ExtendedKalmanFilter(bias=on), Taken(every=10), 60.0, disturbance=Steady())
        for on in (False, True)
    )
    assert not any(blind[part].any() for part in ("b_est_x", "b_est_y", "b_est_psi"))
    assert not square(blind["P_est"])[:, 6:].any()
    assert abs(errors(blind)[-1]).max() > 100.0 * abs(errors(found)[-1]).max()


def test_velocities_are_taken_in_where_they_are_measured():
    known, blind = (
        sailed(ExtendedKalmanFilter(), Taken(every=10, velocities=has), 20.0)
        for has in (True, False)
    )
    P, wide = square(known["P_est"][-1]), square(blind["P_est"][-1])
    assert (np.diagonal(P)[3:6] < 0.5 * np.diagonal(wide)[3:6]).all()


@pytest.mark.parametrize(
    ("place", "innovation"), [*enumerate([5.0, 5.0, 5.0 - 2.0 * np.pi] + [5.0] * 3)]
)
def test_a_value_corrects_as_the_formula_says_and_nothing_new_corrects_nothing(place, innovation):
    """A heading alone is corrected by the shorter way round."""
    ekf = ExtendedKalmanFilter()
    seen, state, k = delivered(ekf, np.zeros(6), np.full(6, 5.0))
    before = np.random.default_rng(2).normal(size=(N, N))
    before = before @ before.T
    state[N:-12] = before[UPPER]
    seen[6:12] = 0.0
    unchanged = state.copy()
    call(ekf.correct, t=0.0, seen=seen, state=state, k=k, table=np.zeros(1))
    np.testing.assert_array_equal(state, unchanged)
    seen[6 + place] = 1.0
    call(ekf.correct, t=0.0, seen=seen, state=state, k=k, table=np.zeros(1))
    sigma, row = (
        [k.sigma_p, k.sigma_p, k.sigma_psi, k.sigma_u, k.sigma_v, k.sigma_r][place],
        np.eye(N)[place],
    )
    gain = before[:, place] / (before[place, place] + sigma**2)
    np.testing.assert_allclose(state[:N], innovation * gain, rtol=1e-12)
    joseph = np.eye(N) - np.outer(gain, row)
    after = joseph @ before @ joseph.T + sigma**2 * np.outer(gain, gain)
    np.testing.assert_allclose(square(state[N:-12]), after, rtol=1e-9, atol=1e-9)
    variance = before[place, place] + sigma**2
    np.testing.assert_allclose(
        state[[-12 + place, -6 + place]], [innovation**2 / variance, 1.0], rtol=1e-12
    )


def test_a_late_position_corrects_by_the_derivative_of_where_the_hull_was():
    """Against one step of the general formula, with differences of p - delay R(psi) nu."""
    random, late = np.random.default_rng(7), 0.4
    ekf = ExtendedKalmanFilter(delay_p=late)
    seen, state, k = delivered(ekf, np.zeros(6), np.zeros(6))
    x, before = random.normal(size=N), random.normal(size=(N, N))
    before = before @ before.T
    state[:N], state[N:-12] = x, before[UPPER]

    def measured(at: Vector) -> float:
        return float(at[1] - late * (np.sin(at[2]) * at[3] + np.cos(at[2]) * at[4]))

    seen[6:12] = [0, 1, 0, 0, 0, 0]
    seen[1] = 0.3
    call(ekf.correct, t=0.0, seen=seen, state=state, k=k, table=np.zeros(1))
    row = np.array([(measured(x + d) - measured(x - d)) / 2e-6 for d in 1e-6 * np.eye(N)])
    gain = before @ row / (row @ before @ row + k.sigma_p**2)
    np.testing.assert_allclose(state[:N], x + gain * (0.3 - measured(x)), rtol=1e-7)
