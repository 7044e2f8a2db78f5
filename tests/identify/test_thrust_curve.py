"""Dead band and exponent of the propellers' thrust: looked for beside the hull, and written out."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from identify_samples import HULL, LOGS, fitted

import podusv
from benchmarks import plain_logs
from podusv_cli.components.actuators.one_pod import Pod, Rudder
from podusv_cli.components.actuators.pod import Pods
from podusv_cli.components.actuators.propeller import thrust
from podusv_cli.components.actuators.thrust_table import PwmCommand
from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import bundle
from podusv_cli.identify.answer import Identification
from podusv_cli.identify.doubts import thrust_words
from podusv_cli.identify.fit.estimate import directions
from podusv_cli.identify.fit.march import bend_speed
from podusv_cli.identify.fit.numbers import hull_numbers
from podusv_cli.identify.fit.problem import WALKS, FitProblem
from podusv_cli.identify.intake import logs_of
from podusv_cli.identify.outputs import actuator_keys
from podusv_cli.scenario.identify import Identify, LogFile
from podusv_cli.scenario.resolved import yaml_text

DEAD_BAND, EXPONENT, FACTOR = 0.12, 1.37, 0.9
PLACE = {"x": -0.5, "n_rate": 10.0, "n_lag": 0.1, "angle_limit": 0.0}
SQUARE = {"T_nn": 0.4, "T_nn_astern": 0.25, "n_max": 16.0, "n_max_astern": 13.0}
TEST = ((-1.0, -9.0), (-0.3, -2.0), (-0.1, 0.0), (0.0, 0.0), (0.2, 1.0), (0.7, 15.0), (1.0, 20.0))
TWO = tuple(replace(p, dead_band=DEAD_BAND, exponent=EXPONENT) for p in plain_logs.TWO)
SECTIONS = {
    "vessel": {"preset": "otter"},
    "path": {"kind": "line", "speed": 0.0},
    "disturbance": {"kind": "none"},
    "controller": {"kind": "pid"},
    "actuator": {"kind": "pod", "preset": "otter"},
}


def two(counts="turns", **keys):
    return Pods(counts=counts, pods=tuple(Pod(y=y, **PLACE, **keys) for y in (-0.3, 0.3)))


def thrust_of(pods, n, flow=0.0):
    """Thrust [N] of the first pod."""
    return thrust(n, flow, pods.table(), bundle(pods.constants()))


def by_definition(n, full, at_full):
    """The curve as the docs give it, by plain Python."""
    part = max(abs(n) / full - DEAD_BAND, 0.0) / (1.0 - DEAD_BAND)
    return FACTOR * math.copysign(at_full * part**EXPONENT, n)


@pytest.mark.parametrize("part", [-1.0, -0.77, -0.13, -0.05, 0.0, 0.11, 0.121, 0.5, 0.873, 1.0])
def test_a_pod_has_the_curve_of_its_definition(part):
    bent = two(**SQUARE).with_thrust(FACTOR, DEAD_BAND, EXPONENT)
    full, gain = (16.0, 0.4) if part > 0.0 else (13.0, 0.25)
    at_full = gain * full**2
    expected = by_definition(part * full, full, at_full)
    assert thrust_of(bent, part * full) == pytest.approx(expected, abs=1e-3 * at_full)
    assert bent.full_speeds[0] == pytest.approx((16.0, 13.0), rel=1e-12)


def test_a_factor_alone_changes_all_thrust_and_keeps_the_form():
    rudder = {"rudder": Rudder(lift=0.3), **PLACE, "angle_limit": 0.5}
    pod = Pod(**rudder, angle_rate=1.0, angle_lag=0.1, T_nV=0.02, **SQUARE)
    stronger = Pods(pods=(pod,)).with_thrust(1.3, 0.0, 2.0)
    (own,) = stronger.pods
    assert own.table is None
    numbers = own.T_nn, own.T_nn_astern, own.T_nV, own.rudder.lift
    assert numbers == pytest.approx((0.52, 0.325, 0.026, 0.39))
    assert Pods(pods=(pod,)).with_thrust(1.3, 0.1, 2.0) is None  # beside a rudder no curve


def test_the_table_of_a_bollard_test_and_a_dead_band_of_pulses_are_bent_likewise():
    """At n the thrust is that of the pod's own curve at N ((n/N - d)/(1 - d))^(p/2)."""
    own = two("parts", table=TEST)
    bent = own.with_thrust(1.0, DEAD_BAND, EXPONENT)
    for n in (-0.9, -0.4, 0.1, 0.3, 0.6, 0.95):
        there = math.copysign(
            (max(abs(n) - DEAD_BAND, 0.0) / (1.0 - DEAD_BAND)) ** (0.5 * EXPONENT), n
        )
        # A corner of the test lies between two of 40 rows.
        assert thrust_of(bent, n) == pytest.approx(np.interp(there, *np.transpose(TEST)), abs=0.15)
    pulses = {"pwm": PwmCommand(dead_band=(1480.0, 1540.0)), "n_max": 1.0, "n_max_astern": 1.0}
    ready = two("parts", T_nn=20.0, T_nn_astern=9.0, **pulses)
    bent = ready.with_thrust(1.0, 0.0, 1.0)
    assert bent.pods[0].pwm.dead_band is None
    assert thrust_of(bent, 0.5) == pytest.approx(thrust_of(ready, math.sqrt(0.5)), abs=0.02)


@pytest.mark.parametrize("n", [-12.9, -3.0, -0.1, 0.0, 1.9, 2.0, 7.3, 16.0, 17.1])
def test_a_bent_speed_has_the_thrust_of_the_definition(n):
    k = bundle({"dead_band": DEAD_BAND, "thrust_exponent": EXPONENT})
    full, gain = (16.0, 0.4) if n >= 0.0 else (13.0, 0.25)
    there = bend_speed(n, 16.0, 13.0, k)
    expected = by_definition(n, full, gain * full**2) / FACTOR
    assert gain * abs(there) * there == pytest.approx(expected, rel=1e-13, abs=1e-13)
    assert bend_speed(-5.0, 16.0, 0.0, k) == 0.0  # it never turns astern


@pytest.fixture(scope="module")
def otter(tmp_path_factory):
    """A minute of an Otter by plain numpy, whose thrusters have the curve; its hull is known."""
    rng = np.random.default_rng(7)
    boat, top = replace(plain_logs.OWN_BOAT, propellers=TWO), TWO[0].top
    parts = plain_logs.steps_of(rng, (-0.2, -0.2), (1.0, 1.0), 3.0)
    motion = plain_logs.sail(boat, lambda t: [top * p for p in parts(t)], 60.0, plain_logs.Sea())
    columns = plain_logs.log_columns(motion, plain_logs.Sensors(), rng)
    path = tmp_path_factory.mktemp("otter") / "otter.csv"
    pd.DataFrame(plain_logs.columns_of(columns, "shaft speeds")).to_csv(path, index=False)
    scenario = podusv.Scenario(name="otter", identify=Identify(logs=LOGS), **SECTIONS)
    numbers, hull = boat.numbers, scenario.vessel
    own = {n: number for n, number in numbers.items() if n[0] in "XYN"}
    own |= {"X_udot": hull.m - numbers["m11"], "Y_vdot": hull.m - numbers["m22"]}
    own |= {"N_rdot": hull.I_z - numbers["m33"]}
    pods = tuple(p.changed({"n_max_astern": top}) for p in scenario.actuator.pods)
    actuator = scenario.actuator.changed({"preset": "", "pods": pods})
    known = scenario.model_copy(update={"actuator": actuator, "vessel": hull.changed(own)})
    return known, logs_of(path, LogFile(file=path.name, delay=0.0), known)


@pytest.mark.slow
def test_a_log_determines_the_curve(otter):
    scenario, logs = otter
    given = FitProblem(scenario, Identify(logs=LOGS, free=("thrust_curve",)), logs)
    found = fitted(given)
    answer = Identification(given, found, directions(found.covariance, 2), (), ())
    ends = {p.name: (p.low, p.value, p.high) for p in answer.parameters[:2]}
    assert found.settled
    for name, exact in (("dead_band", DEAD_BAND), ("thrust_exponent", EXPONENT)):
        low, value, high = ends[name]
        assert low <= exact <= high
        assert value == pytest.approx(exact, rel=0.02)
    (line,) = thrust_words(answer)
    assert line.startswith(
        f"dead band of the thrust, a part of full n, is {ends['dead_band'][1]:.4g} ("
    )
    assert "exponent of the thrust over n, 2 being that of the actuator's numbers, is 1." in line
    assert "beside it take the actuator that is written with it" in line
    full = scenario.actuator.pods[0].most_n[0]
    for n in (0.3 * full, 0.8 * full):
        exact = TWO[0].thrust(n)
        assert thrust_of(answer.actuator, n) == pytest.approx(exact, rel=0.03)


def test_the_curve_that_is_true_explains_a_log_best(otter):
    """Steps of a tenth away from it, -2 log of the posterior is higher, and without it by far."""
    scenario, logs = otter
    given = FitProblem(scenario, Identify(logs=LOGS, free=("thrust_curve",)), logs)
    dead, exponent = given.hull
    calm = [-3.0 * (number.name in WALKS) for number in given.numbers]  # no load wanders
    points = np.tile(calm, (6, 1))
    for i, (d, p) in enumerate([(1, 1), (0.9, 1), (1.1, 1), (1, 0.9), (1, 1.1)]):
        points[i, :2] = d * DEAD_BAND / dead.sd, math.log(p * EXPONENT / 2.0) / exponent.sd
    true, *beside, without = given.search.values(list(points))
    assert all(true < value - 3.0 for value in beside)
    assert true < without - 100.0


def test_the_file_of_the_actuator_is_taken_by_a_scenario(tmp_path):
    bent = two(**SQUARE).with_thrust(FACTOR, DEAD_BAND, EXPONENT)
    (tmp_path / "actuator.yaml").write_text(yaml_text(actuator_keys(bent)))
    (tmp_path / "task.yaml").write_text(
        "vessel: {preset: otter}\npath: {kind: line, speed: 0.5}\ndisturbance: {kind: none}\n"
        "controller: {kind: pid}\nactuator: {kind: pod, preset: actuator.yaml}\n"
    )
    taken = podusv.load(tmp_path / "task.yaml").actuator
    assert taken.pods == bent.pods
    assert taken.source.startswith("Thrust times 0.9, dead band 0.12, exponent 1.37")


def test_a_curve_of_an_actuator_without_propellers_is_refused():
    ideal = podusv.Scenario(name="ideal", **SECTIONS | {"actuator": {"kind": "ideal"}})
    given = FitProblem(ideal, Identify(logs=LOGS, free=("thrust_curve", "X_u")), [])
    with pytest.raises(UsageError, match=r"thrust_curve is that of propellers, and ideal has none"):
        _ = given.hull


def test_its_prior_can_be_given():
    wanted = Identify(
        logs=LOGS, free=("thrust_curve", "N_r"), priors={"dead_band": 0.03, "thrust_exponent": 0.1}
    )
    dead, exponent, other = hull_numbers(HULL, wanted)
    assert (dead.prior, dead.sd, dead.ratio) == (0.0, 0.03, False)
    assert (exponent.prior, exponent.ratio) == (2.0, True)
    assert exponent.sd == pytest.approx(0.1, rel=0.01)
    assert other.name == "N_r"
