"""The passive observer: published gain rule, positive realness, convergence, wave filter."""

from typing import Any, Literal

import numpy as np
import pytest
from conftest import PAPER, VESSELS, Constant
from estimator_samples import Steady, Taken, errors, sailed
from pydantic import ValidationError

from podusv_cli.components.estimators.passive_observer import LOAD, SEEN, SWING, PassiveObserver
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.kernel import Vector, bundle, kernel, taking

FOLLOW = ("t", "seen", "tau", "state", "k", "table", "rate")
observe = taking(PassiveObserver.follow, FOLLOW)
AFLOAT = {"controller": Constant(), "start": (0.0,) * 6}  # at rest, and left alone


def linear(observer: PassiveObserver, vessel: Vessel, u: float = 0.0) -> tuple[Vector, Vector]:
    """A and B of the observer under a continuous measurement, near a straight run at speed u."""
    k = bundle(observer.constants_with(vessel))

    def rates(change: Vector) -> Vector:
        state, rate = change.copy(), np.full(len(change), np.nan)
        state[3] += u
        observe(0.0, np.zeros(18), np.zeros(3), state, k, np.zeros(1), rate)
        return rate[:SEEN]

    small = 1e-6 * np.eye(SEEN + 3)
    slopes = np.stack([(rates(d) - rates(-d)) / 2e-6 for d in small], axis=1)
    return slopes[:, :SEEN], slopes[:, SEEN:]


def gain(observer: PassiveObserver, omega: float) -> Vector:
    """From measured x, y, psi to their slow parts, for a vessel at rest."""
    A, B = linear(observer, PAPER)
    G = np.linalg.solve(1j * omega * np.eye(SEEN) - A, B)
    return np.abs(np.diag(G[:3]))


def passive(k: Any, s: Vector) -> Vector:
    """The paper's H(s), from the rotated velocity error to the force that corrects it.

    As MSS has it in exPassiveObs.m: wave filter with position, then load with velocity.
    """
    wave = s**2 + 2 * k.lambda_w * k.omega_0 * s + k.omega_0**2
    filtered = (
        s**3
        + (k.K_12 + k.K_2 + 2 * k.lambda_w * k.omega_0) * s**2
        + (k.omega_0**2 + 2 * k.lambda_w * k.omega_0 * k.K_2 - k.K_11 * k.omega_0**2) * s
        + k.omega_0**2 * k.K_2
    )
    return wave / filtered * k.K_4 * (s + 1 / k.T_b + k.K_3 / k.K_4) / (s + 1 / k.T_b)


def worst_phase(observer: PassiveObserver) -> float:
    """The phase of H furthest below zero [deg]; above -90 it is positive real."""
    s = 1j * observer.omega_0 * np.logspace(-5, 3, 20001)
    H = passive(bundle(observer.constants_with(PAPER)), s)
    return float(np.degrees(np.angle(H)).min())


def test_the_published_gains_put_the_poles_of_the_wave_filter_where_they_are_said_to_be():
    observer = PassiveObserver(zeta_n=0.7)
    A, _ = linear(observer, PAPER)
    axis = [0, SWING, SWING + 3]  # of x: slow motion and wave model, the velocity held
    w, z = observer.omega_0, observer.zeta_n
    pair = w * complex(-z, np.sqrt(1.0 - z * z))
    expected = [-observer.omega_c, pair, pair.conjugate()]
    found = np.linalg.eigvals(A[np.ix_(axis, axis)])
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(expected), rtol=1e-6)


def test_the_default_gains_are_positive_real():
    assert -90.0 < worst_phase(PassiveObserver()) < 0.0


def test_the_order_of_the_corner_frequencies_alone_does_not_make_gains_positive_real():
    # The numbers of MSS's exPassiveObs.m, which keep 1/T_b << omega_b < omega_0 < omega_c.
    mss = PassiveObserver(omega_0=0.8976, omega_c=1.1, omega_b=0.1)
    assert worst_phase(mss) == pytest.approx(-94.8, abs=0.1)


@pytest.mark.parametrize("vessel", VESSELS.values(), ids=VESSELS)
def test_errors_die_away_on_every_vessel(vessel):
    for speed in (-0.5, 0.0, 0.5, 1.0):
        assert np.linalg.eigvals(linear(PassiveObserver(), vessel, speed)[0]).real.max() < 0.0


def test_at_speed_the_full_model_needs_faster_velocities_and_the_linear_one_does_not():
    def slowest(speed: float, **fields: Any) -> float:
        A, _ = linear(PassiveObserver(**fields), PAPER, speed)
        return float(np.linalg.eigvals(A).real.max())

    # The hull of the paper, told its Munk moment, is unstable in yaw; the linear model is not.
    assert slowest(1.0, omega_v=1.0) > 0.0 > slowest(1.0)
    assert slowest(2.0) > 0.0 > slowest(2.0, model="linear")


def test_the_linear_model_has_linear_damping_alone():
    both = {"X_uu": -3.0, "Y_vv": -4.0, "N_rr": -5.0, "Y_r": 0.4, "N_v": -0.6}
    linear_only = PAPER.model_copy(update=both)
    k = bundle(PassiveObserver(model="linear").constants_with(linear_only))
    state, rate = np.zeros(18), np.full(18, np.nan)
    state[3:6] = nu = 0.7, -0.2, 0.3
    observe(0.0, np.zeros(18), np.zeros(3), state, k, np.zeros(1), rate)
    inertia = [PAPER.m11, PAPER.m22, PAPER.m33]
    damping = [[PAPER.X_u, 0.0, 0.0], [0.0, PAPER.Y_v, 0.4], [0.0, -0.6, PAPER.N_r]]
    expected = np.array(damping) @ nu / inertia
    np.testing.assert_allclose(rate[3:6], expected, rtol=1e-12)


def test_a_constant_load_is_found_and_the_state_with_it():
    out = sailed(PassiveObserver(), Taken(every=10), 150.0, disturbance=Steady())
    kept = 1.0 - 1.0 / (1.0 + 0.25 * 1000.0)  # K_4 e carries the rest of it
    found = [out[part][-1] for part in ("b_est_x", "b_est_y", "b_est_psi")]
    np.testing.assert_allclose(found, np.array([0.6, -0.4, 0.1]) * kept, rtol=2e-3)
    assert abs(errors(out)[-1]).max() < 1e-3


def test_waves_are_kept_out_and_slow_motion_passes():
    out = sailed(PassiveObserver(), Taken(swell=0.05), 60.0, **AFLOAT)
    swing = np.ptp(np.stack([out[name][-1000:] for name in ("x_est", "y_est", "psi_est")]), axis=1)
    np.testing.assert_allclose(
        swing / (0.1 * np.array([1.0, 0.7, 0.3])), gain(PassiveObserver(), 6.0), rtol=0.03
    )
    assert gain(PassiveObserver(), 6.0).max() < 0.09
    assert gain(PassiveObserver(zeta_n=0.1), 6.0).min() > 0.9  # without the wave filter
    np.testing.assert_allclose(gain(PassiveObserver(), 0.05), 1.0, atol=2e-3)


def test_what_is_kept_out_is_logged_as_wave_motion():
    out = sailed(PassiveObserver(), Taken(swell=0.05), 60.0, **AFLOAT)
    wave = 0.05 * np.sin(6.0 * out["time"])
    assert np.sqrt(np.mean((out["w_est_x"] - wave)[-1000:] ** 2)) < 0.1 * 0.05


class Holding(PassiveObserver):
    """As the paper has it, with the value delivered last in place of the predicted one."""

    kind: Literal["holding"] = "holding"  # type: ignore[assignment]

    @staticmethod
    @kernel
    def follow(
        t: float, seen: Vector, tau: Vector, state: Vector, k: Any, table: Vector, rate: Vector
    ) -> None:
        observe(t, seen, tau, state, k, table, rate)
        for i in range(3):
            rate[SEEN + i] = 0.0


def test_the_prediction_between_deliveries_takes_away_a_lag_of_half_their_period():
    straight = {"controller": Constant(surge=1.5), "start": (0.0, 0.0, 0.0, 0.5, 0.0, 0.0)}
    predicted, held = (
        sailed(kind(), Taken(every=10), 100.0, **straight) for kind in (PassiveObserver, Holding)
    )
    lag = held["u"][-1] * 0.2 / 2.0
    assert errors(held)[-500:, 0].mean() == pytest.approx(-lag, rel=0.15)
    assert abs(errors(predicted)[:, 0]).max() < 1e-6


@pytest.mark.parametrize("period", [0.02, 0.2, 1.0])
def test_it_is_stable_at_slow_rates_of_delivery(period):
    found = PassiveObserver().start(np.zeros(6), PAPER)
    found[[0, 3, LOAD]] = 1.0, -0.2, 0.5

    class Astray(PassiveObserver):
        def start(self, x: Vector, nominal: Vessel) -> Vector:
            return found

    out = sailed(Astray(), Taken(every=round(period / 0.02)), 60.0, **AFLOAT)
    assert abs(errors(out)[-1]).max() < 1e-3


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"omega_c": 5.0}, "1/T_b < omega_b < omega_0 < omega_c"),
        ({"T_b": 2.0}, "1/T_b = 0.5, omega_b = 0.25"),
        ({"zeta_n": 0.05}, "zeta_n = 0.05 is below lambda_w = 0.1"),
    ],
)
def test_gains_against_the_published_conditions_are_refused(fields, says):
    with pytest.raises(ValidationError, match=says):
        PassiveObserver(**fields)
