"""A current: the same motion as in calm water, seen from a raft; and its random wandering."""

import math

import numpy as np
import pytest
from conftest import NONLINEAR, POD, VESSELS, Constant, adrift, run
from scipy.stats import norm

from podusv_cli.components.actuators.pod import Pod, Pods
from podusv_cli.components.disturbances.current import Current
from podusv_cli.components.disturbances.total import Total
from podusv_cli.components.disturbances.waves import Waves
from podusv_cli.core.random_words import gauss_markov

SPEED, DIRECTION = 0.3, 0.8
WATER = SPEED * np.array([math.cos(DIRECTION), math.sin(DIRECTION)])
TURN = Constant(surge=2.0, yaw=0.3)
# Waves that no load comes of, whose signals stand before the current's.
SWELL = Waves(height=0.1, period=1.5, components=8, reflection_u=0.0, reflection_v=0.0)
HEAVY = Constant(surge=400.0, yaw=200.0)


def drifted(form, vessel, beside=(), **others):
    """Positions and headings of a turning hull in a current, and in calm water."""
    start = (0.0, 0.0, 0.4, 0.0, 0.0, 0.0)
    c, s = math.cos(start[2]), math.sin(start[2])
    with_water = (*start[:3], c * WATER[0] + s * WATER[1], c * WATER[1] - s * WATER[0], 0.0)
    sea = Total(parts=(*beside, Current(speed=SPEED, direction=DIRECTION, form=form)))
    law = HEAVY if vessel == "milliampere" or others else TURN
    parts = {"vessel": VESSELS[vessel], "controller": law} | others
    moving = run(adrift(disturbance=sea, start=with_water, **parts), 40.0)
    calm = run(adrift(start=start, **parts), 40.0)
    return tuple(np.column_stack([one[n] for n in ("x", "y", "psi")]) for one in (moving, calm))


@pytest.mark.parametrize("vessel", ["paper_nonlinear", "cybership2", "milliampere"])
def test_seen_from_the_water_a_hull_moves_as_in_calm_water(vessel):
    """Galilean invariance, which only the irrotational form has."""
    moving, calm = drifted("irrotational", vessel)
    time = 0.01 * np.arange(len(calm))
    assert np.abs(calm[-1, 2] - calm[0, 2]) > 1.0, "the hull has to turn for this to say anything"
    np.testing.assert_allclose(moving[:, :2] - np.outer(time, WATER), calm[:, :2], atol=1e-9)
    np.testing.assert_allclose(moving[:, 2], calm[:, 2], atol=1e-9)


@pytest.mark.parametrize(("form", "others"), [("physical", ()), ("printed", (SWELL,))])
def test_pods_turn_in_the_water_and_not_over_ground(form, others):
    """Propellers at full speed, whose thrust depends on the advance speed.

    Their limits make kinks within steps, where the method of integration is of first order.
    """
    twin = [{"y": -0.078, "T_nV": 0.075}, {"y": 0.078, "T_nV": 0.075}]
    drive = Pods(pods=tuple(Pod(**POD | own) for own in twin), thrust_form=form)
    moving, calm = drifted("irrotational", "cybership2", others, actuator=drive)
    time = 0.01 * np.arange(len(calm))
    assert np.hypot(*calm[-1, :2]) > 1.0
    np.testing.assert_allclose(moving[:, :2] - np.outer(time, WATER), calm[:, :2], atol=1e-6)
    np.testing.assert_allclose(moving[:, 2], calm[:, 2], atol=1e-6)


def test_without_the_acceleration_a_turning_hull_feels_the_ground():
    moving, calm = drifted("no_acceleration", "cybership2")
    time = 0.01 * np.arange(len(calm))
    apart = np.hypot(*(moving[:, :2] - np.outer(time, WATER) - calm[:, :2]).T)
    assert apart.max() > 0.1


def test_a_hull_without_thrust_ends_up_drifting_with_the_water():
    sea = Current(speed=SPEED, direction=DIRECTION)
    last = run(adrift(disturbance=sea), 800.0)
    c, s = math.cos(last["psi"][-1]), math.sin(last["psi"][-1])
    u, v = last["u"][-1], last["v"][-1]
    np.testing.assert_allclose([c * u - s * v, s * u + c * v], WATER, atol=1e-9)
    assert last["V_c"][-1] == SPEED
    assert last["beta_c"][-1] == DIRECTION


def test_a_wandering_current_has_the_moments_it_was_given():
    """Mean, standard deviation and correlation over one time constant, within five errors."""
    sea = Current(
        speed=1.0, speed_std=0.1, direction_std=0.2, time_constant=50.0, interval=1.0, seed=7
    )
    rows = sea.table_for(VESSELS["paper"], 2e5)[1:].reshape(-1, 2)
    independent = len(rows) / 100.0  # two time constants apart
    for column, mean, std in ((rows[:, 0], 1.0, 0.1), (rows[:, 1], 0.0, 0.2)):
        assert abs(column.mean() - mean) < 5.0 * std / math.sqrt(independent)
        assert abs(column.std() / std - 1.0) < 5.0 / math.sqrt(2.0 * independent)
        whitened = (column - mean) / std
        kept = float(np.mean(whitened[50:] * whitened[:-50]))
        assert abs(kept - math.exp(-1.0)) < 5.0 / math.sqrt(independent)
    assert abs(np.corrcoef(rows.T)[0, 1]) < 5.0 / math.sqrt(independent)


def test_steps_of_a_gauss_markov_process_are_exact_for_any_length():
    """Every number has variance 1, also where the interval is as long as the time constant."""
    for lag in (0.01, 1.0, 5.0):
        ends = np.array([gauss_markov((seed, "test"), 4, lag) for seed in range(3000)])
        assert np.all(np.abs(ends.std(axis=0) - 1.0) < 0.07)
        kept = np.mean(ends[:, 0] * ends[:, 1])
        assert abs(kept - math.exp(-lag)) < 5.0 / math.sqrt(3000)
        share = np.mean(ends[:, 3] < 1.0)
        assert abs(share - norm.cdf(1.0)) < 5.0 * math.sqrt(0.16 * 0.84 / 3000)


def test_a_longer_run_begins_with_the_same_current():
    sea = Current(speed_std=0.1, direction_std=0.3)
    short, long = (sea.table_for(VESSELS["paper"], duration)[1:] for duration in (20.0, 300.0))
    np.testing.assert_array_equal(long[: len(short)], short)
    other = Current(speed_std=0.1, direction_std=0.3, seed=2).table_for(VESSELS["paper"], 20.0)
    assert not np.array_equal(other[1:], short)


def test_halving_the_step_changes_the_integration_error_only():
    """Fourth order, because the process has its kinks at instants."""
    sea = Current(speed=0.3, speed_std=0.1, direction_std=0.5, time_constant=5.0, interval=0.8)
    ends = []
    for step in (0.4, 0.2, 0.1):
        one = run(adrift(disturbance=sea, controller=TURN), 24.0, step)
        ends.append(np.array([one[name][-1] for name in ("x", "y", "psi")]))
    order = math.log2(np.abs(ends[0] - ends[1]).max() / np.abs(ends[1] - ends[2]).max())
    assert 3.5 < order < 5.0


def test_the_acceleration_that_is_left_out_is_as_large_as_docs_sea_md_says():
    """As its numbers are drawn and connected, over ten hours."""
    given = {"speed": 0.06, "direction": 1.0, "speed_std": 0.02, "direction_std": 0.3}
    wanders = Current(**given, time_constant=120.0)
    speed, direction = wanders.table_for(NONLINEAR, 36_000.0)[1:].reshape(-1, 2).T
    water = np.stack([speed * np.cos(direction), speed * np.sin(direction)])
    rms = float(np.sqrt((np.diff(water) ** 2).sum(0).mean()))
    assert rms == pytest.approx(3.5e-3, rel=0.03)
    loads = NONLINEAR.m11 * rms / math.sqrt(2.0), NONLINEAR.m22 * rms / math.sqrt(2.0)
    assert loads == pytest.approx((0.065, 0.085), rel=0.03)
    for lag, told in ((4.0, 3.5e-3), (36.0, 9e-3)):
        off, left = np.zeros(2), []
        for change in np.diff(water).T:
            off = math.exp(-1.0 / lag) * off + change * lag * -math.expm1(-1.0 / lag)
            left.append(off)
        assert np.std(left) == pytest.approx(told, rel=0.06)
