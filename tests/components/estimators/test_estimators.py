"""What all estimators have in common, and the low-pass filter against its theory."""

import numpy as np
import pytest
from conftest import NONLINEAR, PAPER, Constant, adrift, corrected, example, run
from estimator_samples import Steady, Taken, delivered, errors, sailed

from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.components.controllers.base import Controller
from podusv_cli.components.controllers.velocity_vector import VelocityVector
from podusv_cli.components.estimators.base import Estimator
from podusv_cli.components.estimators.ekf import ExtendedKalmanFilter
from podusv_cli.components.estimators.low_pass import LowPass
from podusv_cli.components.estimators.none import NoEstimator
from podusv_cli.components.estimators.passive_observer import PassiveObserver
from podusv_cli.components.measurements.sensors import Sensor, Sensors
from podusv_cli.core.kernel import call
from podusv_cli.core.registry import kinds
from podusv_cli.scenario.explain import signals

EVERY = list(kinds("podusv_cli.components.estimators", Estimator).values())
ESTIMATING = [kind for kind in EVERY if kind is not NoEstimator]  # the one without states
MODELS = [PassiveObserver, ExtendedKalmanFilter]  # those that know the vessel
NOISY = Taken(every=10, sigma_p=0.02, sigma_psi=0.005, sigma_nu=0.02, velocities=True)


@pytest.mark.parametrize("kind", EVERY)
def test_no_law_logs_a_name_that_an_estimator_logs(kind):
    for law in kinds("podusv_cli.components.controllers", Controller).values():
        loop = corrected(controller=example(law), measurement=Taken(), estimator=kind())
        assert {part.name for part in kind().states} <= set(loop.about())


@pytest.mark.parametrize("kind", EVERY)
def test_its_constants_hide_none_of_the_vessel_s_and_its_signals_are_explained(kind):
    own, vessel = kind().constants(), NONLINEAR.constants()
    assert not set(own) & set(vessel)
    assert kind().constants_with(NONLINEAR).items() >= {**own, **vessel}.items()
    assert set(kind().states) <= set(signals())


@pytest.mark.parametrize("kind", ESTIMATING)
def test_a_heading_measured_some_turns_away_is_the_same_heading(kind):
    # The start, 3.0 rad, is near half a turn, and the vessel turns on past it.
    velocities = any(kind().needs()[3:])
    out, other = (
        sailed(kind(), Taken(every=5, turns=turns, velocities=velocities), 30.0)
        for turns in (0.0, -1.0)
    )
    assert np.ptp(out["psi"]) > np.pi
    np.testing.assert_allclose(errors(other), errors(out), atol=1e-9)


@pytest.mark.parametrize("kind", MODELS)
def test_without_errors_and_with_the_true_vessel_the_estimate_is_the_truth(kind):
    assert abs(errors(sailed(kind(), Taken(every=10), 20.0))).max() < 1e-9


@pytest.mark.parametrize("kind", MODELS)
def test_in_an_outage_the_prediction_goes_on_under_the_load_found_so_far(kind):
    gap = Taken(every=10, gone=80.0, back=90.0)
    out = sailed(kind(), gap, 90.0, disturbance=Steady())
    assert abs(errors(out)[-1, :2]).max() < 0.05  # of several metres that it has gone
    blind = sailed(LowPass(), gap, 90.0, disturbance=Steady())
    assert abs(errors(blind)[-1, :2]).max() > 2.0
    assert abs(blind["x_est"][-1] - blind["x"][4000]) < 0.1  # where it was seen last


def test_the_low_pass_is_as_late_as_its_docstring_says():
    # A straight run at constant speed, so the lags are offsets.
    period, filtered = 0.2, LowPass(T_p=0.3, T_psi=0.2, T_nu=0.4)
    straight = {"controller": Constant(surge=1.5), "start": (0.0, 0.0, 0.5, 0.5, 0.0, 0.0)}
    out = sailed(filtered, Taken(every=10), 60.0, **straight)
    speed, late = out["u"][-1], errors(out)[-1000:].mean(axis=0)
    ahead = late[0] * np.cos(0.5) + late[1] * np.sin(0.5)
    np.testing.assert_allclose(ahead, -speed * (0.3 + period / 2), rtol=0.03)
    np.testing.assert_allclose(late[3], 0.0, atol=1e-3 * speed)


def test_the_low_pass_lets_as_much_noise_through_as_theory_says():
    # Of white samples held for P, a lag T leaves (1 - a)/(1 + a) of the variance, a = exp(-P/T).
    out = sailed(
        LowPass(T_p=0.3),
        Taken(every=10, sigma_p=0.02),
        600.0,
        controller=Constant(),
        start=(0.0,) * 6,
    )
    kept = np.exp(-0.2 / 0.3)
    found = errors(out)[500::10, :2].var() / 0.02**2
    np.testing.assert_allclose(found, (1.0 - kept) / (1.0 + kept), rtol=0.06)


def test_a_measured_velocity_comes_first():
    seen, state, k = delivered(LowPass(), np.zeros(6), np.array([0, 0, 0, 0.7, 0.0, 0.0]))
    rate = np.full(6, np.nan)
    call(LowPass.follow, seen=seen, state=state, k=k, rate=rate)
    np.testing.assert_allclose(rate[3], 0.7 / LowPass().T_nu)
    seen[15] = 0.0  # not measured, and the pose does not move
    call(LowPass.follow, seen=seen, state=state, k=k, rate=rate)
    assert rate[3] == 0.0


@pytest.mark.parametrize("kind", MODELS)
def test_an_estimate_is_late_by_the_delay_as_told(kind):
    """At 0.5 m/s and 0.1 s 50 mm; the velocity is right."""
    sensor, late = Sensor(period=0.1), Sensor(period=0.1, delay=0.1)
    seen = Sensors(position=late, heading=sensor, velocity=None, yaw_rate=sensor)
    start = (0.0, 0.0, 0.0, 0.5, 0.0, 0.0)
    law = Constant(surge=1.405)
    log = run(adrift(controller=law, measurement=seen, estimator=kind(), start=start), 40.0)
    assert log["x"][-1] - log["x_est"][-1] == pytest.approx(0.1 * log["u"][-1], rel=0.01)
    assert log["u"][-1] == pytest.approx(log["u_est"][-1], abs=1e-4)
    assert 0.1 * log["u"][-1] == pytest.approx(0.05, abs=5e-4)


def test_what_estimators_need_and_how_fast_they_are():
    assert all(kind().needs()[:3] == (True,) * 3 for kind in EVERY)
    assert [kind().needs()[3:] for kind in (LowPass, *MODELS)] == [(False,) * 3] * 3
    assert LowPass(T_p=0.3, T_psi=0.2, T_nu=0.05).shortest_lag() == 0.05
    assert PassiveObserver().shortest_lag() == 1.0 / 8.0
    assert PassiveObserver(zeta_n=2.0).shortest_lag() == 1.0 / (6.0 * (2.0 + np.sqrt(3.0)))


@pytest.mark.parametrize("kind", ESTIMATING)
def test_halving_the_step_takes_away_all_but_a_sixteenth_of_the_error(kind):
    # Smooth hulls, that is without |v|; the filter is told a wrong one, so that it has work to do.
    wrong = PAPER.model_copy(update={"Y_v": -2.0, "m": 26.0})
    ends = [
        sailed(
            kind(),
            Taken(every=every, velocities=any(kind().needs()[3:])),
            4.0,
            0.2 / every,
            vessel=PAPER,
            nominal=wrong,
            disturbance=Steady(),
        )
        for every in (5, 10, 20)
    ]
    states = dict.fromkeys(part.name for part in kind().states)
    last = [np.concatenate([np.ravel(out[name][-1]) for name in states]) for out in ends]
    coarse, fine = abs(last[1] - last[0]).max(), abs(last[2] - last[1]).max()
    assert coarse / fine > 12.0


def test_in_the_loop_a_model_helps_and_a_lag_does_harm():
    def rms(estimator: Estimator) -> float:
        loop = corrected(
            controller=VelocityVector(),
            actuator=Saturated(),
            measurement=Sensors(),
            estimator=estimator,
        )
        return float(np.sqrt((run(loop, 120.0)["z_e"][6000:] ** 2).mean()))

    assert 1.3 * rms(ExtendedKalmanFilter()) < rms(NoEstimator()) < 0.5 * rms(LowPass())
