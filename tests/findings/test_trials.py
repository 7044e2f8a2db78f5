"""Manoeuvring trials beside scipy's integration of the plant, and what they are made of."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from podusv_cli.components.vessels.plant import plant
from podusv_cli.core.kernel import bundle
from podusv_cli.findings.outcome import trial_unfinished
from podusv_cli.process.extras import Extras
from podusv_cli.scenario.case import Case
from podusv_cli.scenario.load import load_text
from podusv_cli.scenario.shipped import file_of
from podusv_cli.workflows.execute import Stopwatch, simulate_case, summary

LEVER, EXECUTE = 0.499, 20.0
OF_TRIALS = (
    "advance",
    "transfer",
    "tactical_diameter",
    "turning_diameter",
    "overshoot_1",
    "overshoot_2",
    "initial_turning",
    "track_reach",
    "head_reach",
    "stopping_time",
)
IDEAL = ["actuator={kind: ideal}", f"controller.execute={EXECUTE}", "simulation.duration=80"]
OTTER = ["vessel.preset=otter", "controller.thrust=60"]
# A hull that is unstable on a straight course, in place of the shipped trials' Otter.
MODEL = f"""vessel: {{preset: cybership2}}
start: {{u: 0.5}}
actuator: {{kind: pod, preset: cybership2_pod, neglect_sway_force: false}}
controller: {{thrust: 1.5, lever: {LEVER}, execute: 60.0}}
simulation: {{duration: 140.0}}
"""


def done(name, *sets, hull=MODEL):
    """Scenario, recording and metrics of a shipped trial."""
    text = f"extends: podusv:trials/{name}.yaml\nname: trial\n{hull}"
    scenario = load_text(text, "trial.yaml", sets).scenario.alone()
    case = Case.of(scenario)
    recording = simulate_case(case, Stopwatch())
    return scenario, recording, summary(case, recording, Extras())


def slope(scenario, angle):
    """The plant's rate under the steered thrust, at a fixed angle [rad]."""
    k, thrust = bundle(scenario.vessel.constants()), scenario.controller.thrust
    tau = np.array([thrust * math.cos(angle), 0.0, thrust * LEVER * math.sin(angle)])

    def rate(t, x):
        out = np.zeros(6)
        plant(x, tau, np.zeros(3), k, out)
        return out

    return rate


def crossing(state, change, sign=1.0):
    """An event of scipy: the heading has changed by so much."""

    def event(t, x):
        return sign * (x[2] - state[2]) - change

    event.terminal, event.direction = True, 1.0
    return event


def integrated(scenario, angle, state, event, seconds=60.0):
    numbers = solve_ivp(
        slope(scenario, angle), (0.0, seconds), state, events=event, rtol=1e-10, atol=1e-12
    )
    return numbers.y[:, -1]


def approach(scenario):
    start = np.array([0.0, 0.0, 0.0, 0.5, 0.0, 0.0])
    return integrated(scenario, 0.0, start, None, EXECUTE)


@pytest.mark.parametrize(
    ("preset", "thrust"), [("cybership2", 1.5), ("paper_nonlinear", 1.5), ("otter", 60.0)]
)
def test_a_turning_circle_is_that_of_an_independent_integration(preset, thrust):
    vessel = [f"vessel.preset={preset}", f"controller.thrust={thrust}"]
    scenario, _, numbers = done("turning_circle", *IDEAL, *vessel)
    begun, angle = approach(scenario), math.radians(35.0)
    quarter = integrated(scenario, angle, begun, crossing(begun, 0.5 * math.pi))
    half = integrated(scenario, angle, begun, crossing(begun, math.pi))
    assert numbers["advance"] == pytest.approx(quarter[0] - begun[0], abs=2e-5)
    assert numbers["transfer"] == pytest.approx(quarter[1], abs=2e-5)
    assert numbers["tactical_diameter"] == pytest.approx(half[1], abs=2e-5)


def test_the_turning_diameter_is_that_of_the_circle_at_the_end():
    _, log, numbers = done("turning_circle", *IDEAL)
    late = log["time"] > 60.0
    x, y = log["x"][late], log["y"][late]
    columns = np.column_stack([x, y, np.ones_like(x)])
    a, b, c = np.linalg.lstsq(columns, x * x + y * y, rcond=None)[0]
    diameter = 2.0 * math.sqrt(c + 0.25 * (a * a + b * b))
    assert numbers["turning_diameter"] == pytest.approx(diameter, rel=1e-3)


def test_overshoots_of_a_zigzag_are_those_of_an_independent_integration():
    degrees = math.radians(20.0)
    scenario, log, numbers = done("zigzag_20", *IDEAL, *OTTER)
    begun = approach(scenario)
    state, overshoots = begun, []
    for leg in range(3):
        side = 1.0 if leg % 2 == 0 else -1.0
        if leg:
            peak = integrated(scenario, side * degrees, state, turning(-side))
            overshoots.append(-side * (peak[2] - begun[2]) - degrees)
        state = integrated(scenario, side * degrees, state, crossing(begun, degrees, side))
    assert [numbers["overshoot_1"], numbers["overshoot_2"]] == pytest.approx(
        np.degrees(overshoots), abs=6e-5
    )
    first = solve_ivp(
        slope(scenario, degrees),
        (0.0, 60.0),
        begun,
        events=crossing(begun, degrees),
        rtol=1e-10,
        atol=1e-12,
        max_step=1e-3,
    )
    way = np.trapezoid(np.hypot(first.y[3], first.y[4]), first.t)
    off = 5e-5  # the heading bends within a step: U (r'/r) h^2 / 8
    assert numbers["initial_turning"] == pytest.approx(way, abs=off)
    sides = np.sign(log["delta_s"][log["time"] >= EXECUTE])
    assert set(sides.tolist()) == {1.0, -1.0}


def test_overshoots_do_not_depend_on_the_step_as_the_time_between_looks_would_have_it():
    """Reversed up to 0.02 s late, the second overshoot would be 0.04 deg too large."""
    strong = [*IDEAL, *OTTER, "controller.thrust=80", "controller.lever=1"]
    coarse, fine = (
        done("zigzag_20", *strong, f"simulation.step={step}")[2] for step in (0.02, 0.005)
    )
    late = done("zigzag_20", *strong, "simulation.step=0.005", "controller.check_every=0.02")[2]
    for name, off in (("overshoot_1", 1e-3), ("overshoot_2", 1e-3)):
        assert coarse[name] == pytest.approx(fine[name], abs=off)
    assert late["overshoot_2"] > fine["overshoot_2"] + 0.02


def turning(side):
    """An event of scipy: the yaw rate towards this side has come to zero."""

    def event(t, x):
        return -side * x[5]

    event.terminal, event.direction = True, 1.0
    return event


def test_a_trial_that_does_not_get_so_far_has_no_number():
    _, _, numbers = done("turning_circle", *IDEAL, "simulation.duration=21")
    assert math.isnan(numbers["advance"])
    assert math.isnan(numbers["tactical_diameter"])
    _, _, short = done("zigzag_20", *IDEAL, "simulation.duration=21")
    assert math.isnan(short["overshoot_1"])


def test_a_trial_that_does_not_lead_to_its_numbers_is_told():
    """CyberShip II turns on and on at 10 deg behind its pods; the Otter reverses."""
    scenario, log, numbers = done("zigzag_10", "simulation.duration=80")
    assert math.isnan(numbers["overshoot_1"])
    (text,) = trial_unfinished.search(scenario, log)
    assert text.startswith("the zig-zag reverses 1 times, and its second overshoot needs 3; ")
    scenario, log, numbers = done("zigzag_10", *IDEAL, *OTTER)
    assert numbers["overshoot_2"] > 0.0
    assert list(trial_unfinished.search(scenario, log)) == []
    scenario, log, _ = done("turning_circle", *IDEAL, "simulation.duration=21")
    assert "its diameter needs 180" in next(trial_unfinished.search(scenario, log))
    scenario, log, _ = done("turning_circle", *IDEAL)
    assert list(trial_unfinished.search(scenario, log)) == []


@pytest.mark.parametrize("astern", [40.0, 78.0])
def test_a_stopping_hull_with_linear_damping_goes_as_far_as_algebra_says(astern):
    """m u' = -F - d u from u_0: (m/d)(u_0 - (F/d) ln(1 + d u_0/F)) in (m/d) ln(1 + d u_0/F)."""
    sets = ["actuator={kind: ideal}", f"controller.astern={astern}", "simulation.duration=30"]
    scenario, log, numbers = done("stopping", *sets, hull="")
    mass, damping = scenario.vessel.m11, -scenario.vessel.X_u
    u_0 = scenario.controller.thrust / damping  # the approach is steady
    logarithm = math.log(1.0 + damping * u_0 / astern)
    way = mass / damping * (u_0 - astern / damping * logarithm)
    assert numbers["stopping_time"] == pytest.approx(mass / damping * logarithm, abs=2e-5)
    assert numbers["track_reach"] == pytest.approx(way, abs=1e-6)
    assert numbers["head_reach"] == pytest.approx(way, abs=1e-6)
    assert abs(log["u"][-1]) < 0.02, "no thrust once it lies still"
    assert list(trial_unfinished.search(scenario, log)) == []


@pytest.mark.parametrize("wind", ["{kind: none}", "{kind: step, b_v: 20, time: 10}"])
def test_no_track_is_shorter_than_the_way_ahead(wind):
    numbers = done("stopping", f"disturbance={wind}", hull="")[2]
    assert numbers["track_reach"] >= numbers["head_reach"] - 1e-9


def test_a_trial_s_own_numbers_come_first_and_it_has_none_of_a_target(podusv):
    said = podusv(
        "run", "podusv:trials/zigzag_10.yaml", "--no-figures", "--out", "z"
    ).out.splitlines()
    assert [line.split()[-2:] for line in said[:2]] == [
        ["deg", "overshoot_1"],
        ["deg", "overshoot_2"],
    ]
    assert not {"iae", "z_e_steady", "settling_time", "cross_track_rms"} & {
        line.split()[-1] for line in said
    }


def test_a_hull_that_still_goes_ahead_is_told():
    scenario, log, numbers = done("stopping", "simulation.duration=20.3", hull="")
    assert math.isnan(numbers["track_reach"])
    assert "the hull still goes ahead at" in next(trial_unfinished.search(scenario, log))
    scenario, log, _ = done("stopping", "simulation.duration=10", hull="")
    assert "ends before the trial begins, at 20 s" in next(trial_unfinished.search(scenario, log))
    scenario, log, _ = done("stopping", "start.u=0", "controller.execute=0", hull="")
    assert "does not go ahead when" in next(trial_unfinished.search(scenario, log))


@pytest.mark.parametrize("name", ["turning_circle", "zigzag_10", "zigzag_20", "stopping"])
def test_a_shipped_trial_leads_to_all_of_its_numbers(name):
    scenario, log, numbers = done(name, hull="")
    assert list(trial_unfinished.search(scenario, log)) == []
    assert all(math.isfinite(numbers[key]) for key in numbers if key in OF_TRIALS)


def test_only_trials_have_the_metrics_of_trials():
    _, _, turn = done("turning_circle", *IDEAL)
    _, _, zigzag = done("zigzag_20", *IDEAL)
    assert "advance" in turn
    assert "advance" not in zigzag
    assert "overshoot_1" in zigzag
    assert "overshoot_1" not in turn
    law = load_text("extends: podusv:own_vessel.yaml\nname: x\n", "x.yaml").scenario.alone()
    probe = law.probe()
    assert not {"advance", "overshoot_1"} & set(probe.summary(np.ones(probe.size)))


def test_behind_pods_the_thrust_turns_by_the_angle_and_pushes_the_stern_aside():
    _, log, _ = done("turning_circle", "simulation.duration=70")
    late = log["time"] > 65.0
    assert np.abs(log["delta"][late]) == pytest.approx(math.radians(35.0), abs=0.02)
    assert np.all(log["tau_v"][late] < 0.0)  # to port, so that the bow turns to starboard
    assert file_of("podusv:trials/turning_circle.yaml").endswith("turning_circle.yaml")
