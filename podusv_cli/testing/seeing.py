"""Contract tests for measurements and estimators; `podusv_cli.testing.contract` includes them."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from podusv_cli.components.estimators.base import Estimator
from podusv_cli.components.measurements.base import FRESH, KNOWN, OWN, VALUE, Measurement
from podusv_cli.components.vessels.vessel import VESSELS, Vessel
from podusv_cli.core.kernel import Vector, bundle, call
from podusv_cli.core.signal import STATE
from podusv_cli.scenario.presets import preset_values
from podusv_cli.scenario.yaml_tree import plain

SIX = len(STATE)
BEYOND = -1.234567890123e-290  # behind every vector; nobody writes just this
MARGIN = 8  # numbers, a whole register
STEP, STEPS = 0.01, 1000
PATIENCE = 5.0  # s, in which an estimate has to come to what is measured
NEAR = 0.4  # of the way there; also rad, m/s and rad/s


@cache
def usual_vessel() -> Vessel:
    """The vessel of all contract tests."""
    node = preset_values(VESSELS, "paper_nonlinear", [])
    return Vessel(**{**(plain(node) if node else {}), "preset": "paper_nonlinear"})


def guard(numbers: Vector) -> Vector:
    """The numbers, and behind them room that must not be written."""
    return np.concatenate([numbers, np.full(MARGIN, BEYOND)])


def intact(vector: Vector) -> bool:
    """Whether what is behind the numbers is as it was."""
    return bool((vector[-MARGIN:] == BEYOND).all())


def pose_at(t: float) -> Vector:
    """State (6,) at t [s] of a vessel that moves in every quantity, each at a rate of its own."""
    rates, places = np.linspace(0.3, 0.8, SIX), np.arange(1.0, SIX + 1.0)
    return np.sin(rates * t + places) * [9.0, 9.0, 3.0, 1.0, 0.3, 0.5]


def watch_sensors(sensors: Measurement, steps: int = STEPS, table_of: int = STEPS) -> list[Vector]:
    """What is seen at each instant, `seen` (numbers,) each; nothing else may be written.

    A run of `steps` steps, with a table for `table_of` of them and no disturbance.
    """
    k = bundle(sensors.constants_with(STEP, 0))
    table = sensors.table_for(STEP, table_of)
    seen, given, before = guard(sensors.first(pose_at(0.0), STEP)), np.zeros(3), table.copy()
    rows = []
    for instant in range(steps):
        x = pose_at(instant * STEP)
        call(
            sensors.sense,
            t=instant * STEP,
            instant=float(instant),
            x=x,
            b=given,
            k=k,
            table=table,
            seen=seen,
        )
        assert intact(seen), f"at instant {instant} it writes behind `seen`"
        assert (x == pose_at(instant * STEP)).all(), "it changes the true state"
        assert not given.any(), "it changes the disturbance"
        rows.append(seen[:-MARGIN].copy())
    np.testing.assert_array_equal(table, before, "it changes its table")
    return rows


def marks_what_it_delivers(sensors: Measurement) -> None:
    """Marks are 0 or 1, a value changes only where it is marked, all that is measured comes."""
    rows, known = np.array(watch_sensors(sensors)), np.array(sensors.measured(), float)
    values, fresh = rows[:, VALUE:FRESH], rows[:, FRESH:KNOWN]
    assert np.isin(fresh, (0.0, 1.0)).all(), "a mark of delivery is neither 0 nor 1"
    assert (rows[:, KNOWN:OWN] == known).all(), "the marks of what is measured change"
    changed = np.diff(values, axis=0) != 0.0
    for i, state in enumerate(STATE):
        unmarked = np.flatnonzero(changed[:, i] & (fresh[1:, i] == 0.0))
        assert not len(unmarked), f"{state.name} changes at instant {unmarked[:1] + 1} unmarked"
        came = bool(fresh[:, i].any())
        assert came == bool(known[i]), f"{state.name}: measured {known[i]:g}, delivered {came}"


def measures_the_vessel(sensors: Measurement) -> None:
    """What is delivered follows the true state, or it measures something else."""
    rows = np.array(watch_sensors(sensors))
    true = np.array([pose_at(instant * STEP) for instant in range(STEPS)])
    for i, state in enumerate(STATE):
        came = rows[:, FRESH + i] == 1.0
        # Through two points any line goes, with a correlation of 1 or -1.
        if came.sum() > 2:
            correlation = np.corrcoef(rows[came, i], true[came, i])[0, 1]
            assert correlation > 0.5, f"{state.name}: correlation {correlation:.2g} with the truth"


def errs_alike_in_a_longer_run(sensors: Measurement) -> None:
    """Errors are functions of seed and sample, the same again and in a run of twice the length."""
    first, again, longer = (watch_sensors(sensors, STEPS, n) for n in (STEPS, STEPS, 2 * STEPS))
    np.testing.assert_array_equal(first, again, "the same run again")
    np.testing.assert_array_equal(first, longer, "a run of twice the length")


class EstimatorUnderTest:
    """An estimator's kernels with vectors of the declared sizes, from the state x."""

    def __init__(self, estimator: Estimator, x: Vector) -> None:
        """The estimator with its state and rates at the true state `x` (6,), guarded behind."""
        nominal = usual_vessel()
        self.estimator, self.table = estimator, estimator.table()
        self.k = bundle(estimator.constants_with(nominal))
        self.state = guard(estimator.start(x, nominal))
        # NaN shows a rate that `follow` leaves unwritten.
        self.rate = np.full(len(self.state), np.nan)
        self.rate[-MARGIN:] = BEYOND

    def step(self, t: float, seen: Vector, tau: Vector) -> Vector:
        """Correct, follow, and go on by a step by Euler's method; the new estimate (6,).

        `seen` as `measurements.base` lays it out, `tau` (3,) [N, N, N m] are the actuator's loads.
        """
        given = seen.copy(), tau.copy()
        call(self.estimator.correct, t=t, seen=seen, state=self.state, k=self.k, table=self.table)
        corrected = self.state.copy()
        call(
            self.estimator.follow,
            t=t,
            seen=seen,
            tau=tau,
            state=self.state,
            k=self.k,
            table=self.table,
            rate=self.rate,
        )
        for one, before, what in zip((seen, tau), given, ("seen", "tau"), strict=True):
            np.testing.assert_array_equal(one, before, f"it changes {what}")
        np.testing.assert_array_equal(self.state, corrected, "`follow` changes the state")
        assert intact(self.state), "`correct` writes behind the state"
        assert intact(self.rate), "`follow` writes behind the rate"
        written = self.rate[:-MARGIN]
        assert np.isfinite(written).all(), "a rate is left unwritten, or is no finite number"
        self.state[:-MARGIN] += STEP * written
        return self.state[:SIX]


def delivery(x: Vector, known: tuple[bool, ...], fresh: float) -> Vector:
    """What a measurement hands over (18,): values, marks of delivery, marks of what is measured.

    `fresh` is 1 where all that is `known` of x (6,) was delivered just now, else 0.
    """
    marks = np.array(known, float)
    return np.concatenate([np.where(known, x, 0.0), fresh * marks, marks])


def starts_at_the_truth(estimator: Estimator) -> None:
    """The estimate at t = 0 is the true state, and all numbers of the state are finite."""
    x = pose_at(0.0)
    state = estimator.start(x, usual_vessel())
    assert len(state) == len(estimator.states) >= SIX
    np.testing.assert_array_equal(state[:SIX], x)
    assert np.isfinite(state).all()


def waits_for_a_delivery(estimator: Estimator) -> None:
    """`correct` leaves the state where nothing was delivered."""
    tested, seen = EstimatorUnderTest(estimator, pose_at(0.0)), delivery(pose_at(9.0), ALL, 0.0)
    before = tested.state.copy()
    call(estimator.correct, t=1.0, seen=seen, state=tested.state, k=tested.k, table=tested.table)
    np.testing.assert_array_equal(tested.state, before, "nothing was delivered")


def comes_to_what_is_measured(estimator: Estimator) -> None:
    """At rest beside the place where it starts, with all measured or no more than it needs."""
    for known in (ALL, estimator.needs()):
        away = np.array([0.4, -0.3, 0.2, 0.0, 0.0, 0.0])
        estimate = settle_estimate(EstimatorUnderTest(estimator, np.zeros(SIX)), away, known)
        left = np.abs(estimate - away)
        assert (left[:3] <= NEAR * np.abs(away[:3])).all(), f"pose off by {left[:3]}"
        assert (left[3:] <= NEAR).all(), f"at rest with velocities {estimate[3:]}"


def takes_headings_by_the_nearest_turn(estimator: Estimator) -> None:
    """A measured heading that is a whole turn away is no error."""
    turned = np.array([0.0, 0.0, 2.0 * math.pi, 0.0, 0.0, 0.0])
    estimate = settle_estimate(EstimatorUnderTest(estimator, np.zeros(SIX)), turned, ALL)
    off = math.remainder(estimate[2], 2.0 * math.pi)
    assert abs(off) < NEAR, f"heading off by {off:.3g} rad"
    assert abs(estimate[5]) < NEAR, f"it yaws with {estimate[5]:.3g} rad/s"


def settle_estimate(tested: EstimatorUnderTest, place: Vector, known: tuple[bool, ...]) -> Vector:
    """The estimate (6,) after `PATIENCE` with x = `place` (6,) measured at 10 Hz, no loads acting.

    `known` says which quantities are measured.
    """
    new, old = (delivery(place, known, fresh) for fresh in (1.0, 0.0))
    tau, steps = np.zeros(3), round(PATIENCE / STEP)
    for i in range(steps):
        estimate = tested.step(i * STEP, old if i % 10 else new, tau)
    return estimate


ALL = (True,) * SIX
MEASUREMENT_CHECKS: tuple[Callable[[Any], None], ...] = (
    marks_what_it_delivers,
    measures_the_vessel,
    errs_alike_in_a_longer_run,
)
ESTIMATOR_CHECKS: tuple[Callable[[Any], None], ...] = (
    starts_at_the_truth,
    waits_for_a_delivery,
    comes_to_what_is_measured,
    takes_headings_by_the_nearest_turn,
)
