"""Sensors: when a sample is taken and delivered, and the errors that it has."""

import math
import re

import numpy as np
import pytest
from conftest import NONLINEAR, Constant, adrift, corrected, run

from podusv_cli.components.controllers.velocity_vector import VelocityVector
from podusv_cli.components.disturbances.current import Current
from podusv_cli.components.disturbances.harmonic import HarmonicDisturbance
from podusv_cli.components.disturbances.step import Step
from podusv_cli.components.disturbances.total import Total
from podusv_cli.components.disturbances.waves import Waves
from podusv_cli.components.estimators.ekf import ExtendedKalmanFilter
from podusv_cli.components.estimators.none import NoEstimator
from podusv_cli.components.measurements.base import FRESH, KNOWN, VALUE
from podusv_cli.components.measurements.sensors import ERRORS, HEAD, Sensor, Sensors, round_to
from podusv_cli.core.errors import LawError
from podusv_cli.core.signal import STATE
from podusv_cli.engine.running.batch import simulate_many
from podusv_cli.engine.step.grid import TimeGrid

H = 0.01
PERFECT = Sensor(period=H)
CIRCLE = {"controller": Constant(surge=2.0, yaw=0.3)}


def sensors(**chosen):
    """Sensors without errors, sampled at every instant, with some replaced."""
    names = ("position", "heading", "velocity", "yaw_rate")
    return Sensors(**dict.fromkeys(names, PERFECT) | chosen)


def test_a_perfect_sensor_gives_the_state_itself():
    log = run(adrift(measurement=sensors(), **CIRCLE), 5.0)
    for state in STATE:
        np.testing.assert_array_equal(log[f"{state.name}_m"], log[state.name])
        np.testing.assert_array_equal(log[f"{state.name}_est"], log[state.name])


def test_a_sample_is_held_and_comes_after_its_delay():
    """At instant k the value is that of the last sample taken at least the delay before."""
    slow = Sensor(period=7 * H, delay=10 * H)
    log = run(adrift(measurement=sensors(position=slow), **CIRCLE), 3.0)
    k = np.arange(len(log["x"]))
    taken = (k - 10) // 7 * 7
    expected = np.where(taken >= 0, log["x"][np.maximum(taken, 0)], log["x"][0])
    np.testing.assert_array_equal(log["x_m"], expected)
    np.testing.assert_array_equal(log["psi_m"], log["psi"])


@pytest.mark.parametrize("spreading", [0, 2])
def test_sensors_see_the_waves_motion_on_top_of_each_quantity(spreading):
    """Also where the waves are not the first disturbance of a list, and a part follows them."""
    sea = Waves(height=0.05, period=1.0, components=8, direction=0.7, spreading=spreading)
    whole = Total(parts=(HarmonicDisturbance(), Current(speed=0.1), sea, Step(b_v=0.5)))
    log = run(adrift(measurement=sensors(), disturbance=whole, **CIRCLE), 2.0)
    for state in STATE:
        moved = log[f"{state.name}_w"]
        assert np.ptp(moved) > 1e-3
        np.testing.assert_array_equal(log[f"{state.name}_m"], log[state.name] + moved)


def _errors(table, quantity, count):
    """The errors of a quantity's samples, from where the table's head says that they begin."""
    begin = int(table[HEAD * quantity + ERRORS])
    return table[begin : begin + count]


def errors_of(sensor, count=40_000):
    return sensor.errors((3, "measurement", "heading"), 1, count)[0]


def test_noise_is_white_and_as_large_as_it_was_said():
    error = errors_of(Sensor(noise=0.2))
    assert abs(error.std() / 0.2 - 1.0) < 5.0 / math.sqrt(2 * len(error))
    assert abs(error.mean()) < 5.0 * 0.2 / math.sqrt(len(error))
    assert abs(np.mean(error[1:] * error[:-1])) / 0.04 < 5.0 / math.sqrt(len(error))


def test_a_bias_wanders_with_its_time_constant():
    error = errors_of(Sensor(period=0.5, bias=0.3, bias_time=5.0), 100_000)
    independent = len(error) / 20
    assert abs(error.std() / 0.3 - 1.0) < 5.0 / math.sqrt(2 * independent)
    kept = np.mean(error[10:] * error[:-10]) / 0.09
    assert abs(kept - math.exp(-1.0)) < 5.0 / math.sqrt(independent)


def test_lost_samples_are_a_share_and_outages_are_times():
    gone = np.isnan(errors_of(Sensor(lost=0.3)))
    assert abs(gone.mean() - 0.3) < 5.0 * math.sqrt(0.21 / len(gone))
    gone = np.isnan(errors_of(Sensor(period=0.5, outages=((10.0, 12.0), (20.0, 20.4))), 100))
    assert np.flatnonzero(gone).tolist() == [20, 21, 22, 23, 24, 40]
    gone = np.isnan(errors_of(Sensor(period=0.1, outages=((0.3, 0.7),)), 20))
    assert np.flatnonzero(gone).tolist() == [3, 4, 5, 6, 7], "ends count, whatever 3 * 0.1 is"
    assert np.isnan(errors_of(Sensor(outages=((0.0, 0.0),)), 5)).tolist() == [True] + [False] * 4


def test_an_outage_leaves_the_last_value():
    blind = Sensor(period=H, outages=((1.0, 2.0),))
    log = run(adrift(measurement=sensors(position=blind), **CIRCLE), 3.0)
    assert set(log["x_m"][100:201]) == {log["x"][99]}
    np.testing.assert_array_equal(log["x_m"][201:], log["x"][201:])


@pytest.mark.parametrize(("number", "nearest"), [(0.26, 0.25), (-0.26, -0.25), (0.12, 0.0)])
def test_a_resolution_rounds_to_multiples(number, nearest):
    assert round_to(number, 0.25) == nearest
    assert round_to(number, 0.0) == number


def test_errors_do_not_depend_on_the_other_sensors_or_on_the_length_of_the_run():
    one, other = (
        sensors(heading=Sensor(period=2 * H, noise=0.1), **more)
        for more in ({}, {"position": Sensor(period=H, noise=1.0), "velocity": None})
    )
    logs = [run(adrift(measurement=one, **CIRCLE), time) for time in (1.0, 2.0)]
    np.testing.assert_array_equal(logs[1]["psi_m"][:101], logs[0]["psi_m"])
    found = run(adrift(measurement=one), 1.0)["psi_m"]
    heading = [_errors(each.table_for(H, 100), 2, 51) for each in (one, other)]
    np.testing.assert_array_equal(*heading)
    assert heading[0].std() > 0.05
    assert not np.allclose(_errors(other.table_for(H, 100), 0, 51), 10.0 * heading[1])
    assert len(found) == 101


def test_the_axes_of_one_sensor_have_errors_of_their_own():
    x, y = Sensor(noise=1.0).errors((1, "a"), 2, 1000)
    assert abs(np.corrcoef(x, y)[0, 1]) < 5.0 / math.sqrt(1000)


def test_machine_code_computes_what_plain_python_does():
    noisy = Sensor(period=3 * H, delay=4 * H, noise=0.01, bias=0.01, resolution=1e-3, lost=0.2)
    loop = corrected(measurement=sensors(position=noisy, heading=noisy))
    fast, slow = (run(loop, 0.6, compiled=compiled) for compiled in (True, False))
    for state in STATE:
        for name in (state.name, f"{state.name}_m", f"{state.name}_est"):
            np.testing.assert_array_equal(fast[name], slow[name])


def test_what_is_not_measured_is_not_logged():
    log = run(adrift(measurement=sensors(yaw_rate=None), estimator=ExtendedKalmanFilter()), 0.1)
    assert "r_m" not in log.signals
    assert "psi_m" in log.signals


def test_the_law_acts_on_the_measurement_and_the_metrics_on_the_truth():
    """A law at rest on its target, told a heading that is wrong, steers away from it."""
    wrong = Sensor(period=H, bias=0.5, bias_time=1e6)
    true, seen = (
        run(corrected(measurement=sensors(**fields)), 20.0) for fields in ({}, {"heading": wrong})
    )
    assert np.abs(true["psi"] - seen["psi"]).max() > 0.1
    np.testing.assert_allclose(seen["psi_est"], seen["psi_m"], atol=0)


def test_sensors_and_sampled_control_work_together():
    slow = Sensor(period=5 * H)
    log = run(corrected(measurement=sensors(position=slow)), 1.0, hold_every=10)
    assert set(np.flatnonzero(np.diff(log["tau_u_cmd"])) % 10) == {9}


class Forgetful(Sensors):
    """Sensors for a test that declare no signals."""

    @property
    def signals(self):
        """None, although all is measured."""
        return ()


class Short(NoEstimator):
    """An estimator for a test that starts with too little."""

    def start(self, x, nominal):
        """One number less."""
        return x[:5]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"measurement": Forgetful()}, "declares 0 signals, and measures 6"),
        ({"measurement": Sensors(), "estimator": Short()}, "starts with 5 numbers and declares 6"),
    ],
)
def test_what_would_write_beyond_its_vectors_is_refused(wrong, said):
    with pytest.raises(LawError, match=said):
        run(adrift(**wrong), 0.1)
    done = simulate_many([adrift(**wrong)], TimeGrid(H, 10))
    assert list(done.status) == ["invalid"]
    assert said in done.cause[0]


ODD = Sensor(period=0.015)
SWELL = Waves(height=0.1, period=0.05)
MISFITS = (
    ({"measurement": sensors(position=ODD)}, "measurement.position.period: 0.015 s is no whole"),
    ({"disturbance": SWELL}, "disturbance.highest: waves up to"),
    ({"disturbance": Total(parts=(Current(), SWELL))}, "disturbance.parts[1].highest: waves up to"),
    (
        {"measurement": sensors(yaw_rate=None), "estimator": NoEstimator()},
        "estimator: needs r measured",
    ),
)


@pytest.mark.parametrize(("wrong", "said"), MISFITS)
def test_a_loop_that_is_put_together_is_checked_like_a_scenario(wrong, said):
    with pytest.raises(LawError, match=re.escape(said)):
        run(adrift(**wrong), 0.1)
    done = simulate_many([adrift(**wrong)], TimeGrid(H, 10))
    assert list(done.status) == ["invalid"]
    assert said in done.cause[0]


def test_a_part_of_a_sum_keeps_its_choices_apart_from_those_of_others():
    total = Total(parts=(Current(), HarmonicDisturbance()))
    assert "part0_form" in total.choices() & set(total.constants_with(NONLINEAR))
    assert "form" not in total.choices()


def test_times_that_do_not_fit_the_step_are_told():
    odd = sensors(position=Sensor(period=0.015), heading=Sensor(delay=0.004))
    told = dict(odd.conflicts(H))
    assert set(told) == {"position.period", "heading.delay"}
    assert "try 0.01" in told["position.period"]
    late = dict(Sensors(heading=Sensor(period=0.1, delay=2.0**31)).conflicts(H))
    assert "at most 1,000,000 can wait" in late["heading.delay"]
    backwards = Sensors(heading=Sensor(outages=((3.0, 2.0),)))
    assert "found [3, 2]" in dict(backwards.conflicts(H))["heading.outages[0]"]


def test_a_loop_rides_through_an_outage_and_lost_samples():
    """With every third position lost and none for 4 s the law goes on by the filter's prediction.

    Where the estimate holds the last position the law takes the vessel for standing.
    """
    gone = Sensor(period=0.1, noise=0.01, lost=0.3, outages=((70.0, 74.0),))
    away = {}
    for estimator in (ExtendedKalmanFilter(sigma_p=0.01), NoEstimator()):
        loop = corrected(
            controller=VelocityVector(), measurement=sensors(position=gone), estimator=estimator
        )
        log = run(loop, 80.0)
        fresh = np.flatnonzero(np.diff(log["x_m"])) + 1
        assert not np.any((fresh >= 7000) & (fresh <= 7400))
        taken = np.count_nonzero(fresh < 7000)
        assert abs(taken / 700 - 0.7) < 5.0 * math.sqrt(0.21 / 700)
        away[estimator.kind] = log["z_e"][6000:].max()
    assert 4.0 * away["ekf"] < 0.8 < away["none"]


def test_the_layout_of_what_is_seen():
    first = sensors(velocity=None).first(np.arange(6.0), H)
    np.testing.assert_array_equal(first[VALUE : VALUE + 6], np.arange(6.0))
    np.testing.assert_array_equal(first[FRESH : FRESH + 6], 0.0)
    np.testing.assert_array_equal(first[KNOWN : KNOWN + 6], [1, 1, 1, 0, 0, 1])
