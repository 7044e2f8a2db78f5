"""A run step by step has the bits of a run in one go, and refuses what it cannot hold."""

import math
from typing import Any

import numpy as np
import pytest

import podusv
from podusv_cli.core.errors import ScenarioError, UsageError
from podusv_cli.interface.session import Observation, Session
from podusv_cli.workflows import rerun as repeating
from podusv_cli.workflows.request import Request

PERIOD = 0.1  # s
# A hull whose surge is m u' = tau_u - X_u u for motion straight on
SURGE: dict[str, Any] = {
    "vessel": {"preset": "paper_nonlinear", "X_uu": 0.0, "X_uuu": 0.0},
    "path": {"kind": "line"},
    "disturbance": {"kind": "none"},
    "actuator": {"kind": "ideal"},
    "controller": {"kind": "pid"},
    "simulation": {"duration": 5.0},
}
SCENARIOS = {
    "loads of time": ("podusv:mu_2017/corrected.yaml", {}),
    "sensors, filter and sea": ("podusv:sea/sensors.yaml", {}),
    "legs": ("podusv:laws/legs.yaml", {}),
    "drawn current and wind": ("podusv:sea/state_3.yaml", {}),
    "pods behind a delay": ("podusv:sea/delay.yaml", {}),
    "plain Python": ("podusv:own_vessel.yaml", {"simulation.compiled": False}),
}


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def opened(source: Any, duration: float, **changes: Any) -> Session:
    """A session of so many seconds."""
    return podusv.open_session(source, {"simulation.duration": duration, **changes}, period=PERIOD)


def steered(session: Session, count: int = 10_000) -> Observation:
    """Drawn demands until the session is over, or so many of them."""
    random, seen = np.random.default_rng(7), session.observe()
    while seen.status == "running" and count > 0:
        seen, count = session.step(random.normal(0.0, 1.0, 2)), count - 1
    return seen


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.long] * n.startswith("pods")) for n in SCENARIOS]
)
def test_a_session_has_the_bits_of_the_run_that_it_leaves(name):
    """So does one that ends early, whose run is as long as it was."""
    source, changes = SCENARIOS[name]
    duration = 0.5 if changes else 2.0
    for count, end in ((10_000, duration), (3, 3 * PERIOD)):
        session = opened(source, duration, **changes)
        seen = steered(session, count)
        assert seen.time == pytest.approx(end)
        run = session.close(f"run_{count}", figures=False)
        log = session.log
        rows = len(log["time"])
        assert rows >= len(run["time"]) - 1  # the last instant of a run that was left is not yet
        assert set(log) == set(run.recording.signals)
        for signal, stepped in log.items():
            np.testing.assert_array_equal(stepped, run.recording[signal][:rows], signal)


def test_a_vessel_under_constant_force_speeds_up_as_its_equation_says():
    session = opened(SURGE, 5.0)
    vessel = session.scenario.vessel
    mass, damping = vessel.m - vessel.X_udot, -vessel.X_u
    for k in range(1, 51):
        seen = session.step((2.0, 0.0))
        wanted = 2.0 / damping * (1.0 - math.exp(-damping / mass * PERIOD * k))
        assert seen.state[3] == pytest.approx(wanted, abs=1e-9)
    assert seen.status == "finished"


def test_an_observation_has_the_target_of_its_own_instant():
    session = opened("podusv:mu_2017/corrected.yaml", 2.0)
    path = session.scenario.path
    for _ in range(20):
        seen = session.step((1.0, 0.0))
        np.testing.assert_array_equal(seen.target, path.targets([seen.time])[0])


def test_the_run_of_a_session_repeats():
    session = opened("podusv:mu_2017/corrected.yaml", 2.0)
    steered(session)
    run = session.close("made", figures=False)
    assert run.folder
    assert repeating.rerun(run.folder, Request()).identical


@pytest.mark.parametrize("name", ["sensors, filter and sea", "pods behind a delay"])
def test_a_session_goes_back_and_on_with_the_same_bits(name):
    session = opened(SCENARIOS[name][0], 3.0)
    steered(session, 10)
    place, before = session.state(), session.observe()
    seen = steered(session)
    once = session.log
    again = session.restore(place)
    np.testing.assert_array_equal(again.state, before.state)
    assert again.status == "running"
    for _ in range(7):
        session.step((50.0, 5.0))
    session.restore(place)
    assert steered(session).time == seen.time
    for signal, values in session.log.items():
        np.testing.assert_array_equal(values, once[signal], signal)


def test_a_place_keeps_the_log_that_led_to_it():
    """Whatever was steered from an earlier place meanwhile."""
    session = opened("podusv:own_vessel.yaml", 2.0)
    session.step((1.0, 0.0))
    early = session.state()
    steered(session, 5)
    place, log = session.state(), session.log["u"]
    session.restore(early)
    for _ in range(7):
        session.step((-50.0, 0.0))
    session.restore(place)
    np.testing.assert_array_equal(session.log["u"], log)
    with pytest.raises(UsageError, match="back to a place in the same session"):
        opened("podusv:own_vessel.yaml", 2.0).restore(place)


@pytest.mark.parametrize("count", [4, 6, 7])
def test_a_place_has_the_last_row_that_was_logged(count):
    """One row in three periods, and a place within these three; an earlier place comes between."""
    session = opened("podusv:own_vessel.yaml", 2.0, **{"log.every": 30, "simulation.step": 0.01})
    begin = session.state()
    steered(session, count)
    place, log = session.state(), session.log
    session.restore(begin)
    for _ in range(count):
        session.step((-50.0, 1.0))
    session.restore(place)
    for signal, values in session.log.items():
        np.testing.assert_array_equal(values, log[signal], signal)


def test_the_run_of_a_session_is_as_long_as_the_session():
    """Where the last demand is cut short, and where no instant but the first is logged."""
    session = opened("podusv:own_vessel.yaml", 0.25)
    assert steered(session).time == 0.25
    assert session.close("cut", figures=False)["time"][-1] == 0.25
    session = opened("podusv:own_vessel.yaml", 2.0, **{"log.every": 100})
    steered(session, 3)
    assert session.close("short", figures=False)["time"].tolist() == [0.0, 0.3]


@pytest.mark.parametrize(
    "demand", [(math.nan, 0.0), (0.0, math.inf), (1.0,), (1.0, 2.0, 3.0), None, "ab", ("a", "b")]
)
def test_a_demand_that_is_not_two_finite_numbers_is_refused_and_costs_nothing(demand):
    session = opened("podusv:own_vessel.yaml", 1.0)
    seen = session.step((1.0, 0.0))
    with pytest.raises(UsageError, match=r"t = 0\.1 s: the demand is .*two finite numbers, tau_u"):
        session.step(demand)
    assert session.observe().time == seen.time
    assert session.step((1.0, 0.0)).time == pytest.approx(0.2)


def test_a_session_that_is_over_says_so():
    session = opened("podusv:own_vessel.yaml", 0.2)
    assert steered(session).status == "finished"
    with pytest.raises(UsageError, match=r"has finished at t = 0\.2 s and takes no more demands"):
        session.step((0.0, 0.0))


def test_a_session_that_diverges_keeps_what_it_has():
    session = opened("podusv:own_vessel.yaml", 60.0, **{"actuator": {"kind": "ideal"}})
    seen = session.observe()
    while seen.status == "running":
        seen = session.step((1e150, 1e150))
    assert seen.status == "diverged"
    with pytest.raises(UsageError, match="has diverged"):
        session.step((0.0, 0.0))
    run = session.close("far", figures=False)
    assert run.status == "diverged"
    assert run["time"][-1] == session.log["time"][-1]


def test_without_a_period_or_with_too_many_there_is_no_session():
    with pytest.raises(UsageError, match=r"give period=0\.1 \[s\], or the scenario a control\.per"):
        podusv.open_session("podusv:own_vessel.yaml")
    for period, says in (
        (0.0, "for how long does a demand hold"),
        (math.nan, "period is nan; give a finite time"),
        (math.inf, "period is inf; give a finite time"),
        (0.033, "no whole number of steps of 0.01 s; try 0.03"),
    ):
        with pytest.raises((UsageError, ScenarioError), match=says):
            podusv.open_session("podusv:own_vessel.yaml", period=period)
    with pytest.raises(
        UsageError, match=r"more than 15,000 demands of 0\.1 s; ask for at most 1500"
    ):
        opened("podusv:own_vessel.yaml", 2000.0)
    with pytest.raises(UsageError, match="nothing has been simulated yet"):
        opened("podusv:own_vessel.yaml", 1.0).close()


def test_a_metric_so_far_is_that_of_the_run_that_is_left_there():
    session = opened("podusv:mu_2017/corrected.yaml", 2.0)
    assert math.isnan(session.metric("iae"))  # nothing is simulated yet
    steered(session, 7)
    half = session.metric("iae")
    run = session.close("half", figures=False)
    assert half == run.metrics["iae"]
    steered(session)
    assert session.metric("iae") == session.close("whole", figures=False).metrics["iae"] > half
    assert math.isnan(session.metric("settling_time"))
    with pytest.raises(UsageError, match="session: unknown metric 'iea'"):
        session.metric("iea")
    for wrong in (None, 3, ["iae"]):
        with pytest.raises(UsageError, match="session: unknown metric"):
            session.metric(wrong)
    for wrong in (None, 0, "here"):
        with pytest.raises(UsageError, match=r"restore goes back to what state\(\) gave, found"):
            session.restore(wrong)
