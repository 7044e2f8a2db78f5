"""Command path and failure in scenarios: what is refused, what is told, and the shipped configs."""

import json

import numpy as np
import pytest
from conftest import PACKAGE
from findings_samples import codes, finding, late, log, scene
from scipy.special import lambertw

from podusv_cli.components.controllers.base import Controller
from podusv_cli.components.controllers.momentum_vector import MomentumVector
from podusv_cli.components.controllers.sliding_mode import SlidingMode
from podusv_cli.components.controllers.velocity_loop import Loop
from podusv_cli.components.controllers.velocity_vector import VelocityVector
from podusv_cli.core.errors import PodusvError
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.simulate import simulate
from podusv_cli.findings.stability import delay_margin, delayed_growth
from podusv_cli.optimum.problem import problem
from podusv_cli.scenario.load import load
from podusv_cli.theory import monitor

SEA = PACKAGE.parent / "configs" / "sea"
TWO_PODS = PACKAGE.parent / "configs" / "pod" / "kept.yaml"
AT = "actuator.command.delay={}"
FAILS = "actuator.failure={{time: {}, effectiveness: {}}}"


def refused(*overrides: str) -> str:
    with pytest.raises(PodusvError) as caught:
        scene(*overrides)
    return str(caught.value)


@pytest.mark.parametrize(
    ("override", "told"),
    [
        (AT.format(0.205), "0.205 s is no whole number of steps of 0.01 s; try 0.2"),
        (AT.format(0.2075), "0.2075 s is no whole number of steps of 0.01 s; try 0.21"),
        (AT.format(0.001), "0.001 s is no whole number of steps of 0.01 s; try 0.01"),
        (AT.format(-0.1), "actuator.command.delay: must be a number not below 0 [s], found -0.1"),
        ("actuator.command.dead_zone_u=-1", "must be a number not below 0 [N], found -1"),
        ("actuator.command.resolution_r=-1", "must be a number not below 0 [N m], found -1"),
        (FAILS.format(1, 1.5), "must be a number not below 0 and not above 1, found 1.5"),
        (FAILS.format(1, -0.5), "must be a number not below 0 and not above 1, found -0.5"),
        (FAILS.format(-1, 0.5), "must be a number not below 0 [s], found -1"),
    ],
)
def test_values_that_do_not_fit_are_refused_in_a_sentence(override, told):
    assert told in refused(override)


def test_a_pod_that_is_not_there_cannot_fail():
    with pytest.raises(PodusvError, match=r"has no pod 2 that could fail: .* is at most 1"):
        load(TWO_PODS, ("actuator.failure={time: 1, pod: 2}",))


def test_a_failure_after_the_end_is_told_and_changes_nothing():
    after, before = FAILS.format(20, 0), FAILS.format(10, 0)
    assert "the failure at 20 s never happens" in finding("late-failure", after).text
    np.testing.assert_array_equal(log(after)["tau_u"][:-1], log()["tau_u"][:-1])
    assert "late-failure" not in codes(before)
    assert (log(before)["tau_u"][-1], log()["tau_u"][-1] != 0.0) == (0.0, True)


def test_a_delay_longer_than_the_run_is_told_and_nothing_arrives():
    assert (
        "no command reaches the actuator in the 20 s" in finding("late-command", AT.format(20)).text
    )
    np.testing.assert_array_equal(late("tau_u", AT.format(20))[:-1], 0.0)
    gentle = (AT.format(0.1), "controller.kind=velocity_vector")
    assert "late-command" not in codes(*gentle)
    assert np.abs(late("tau_u", *gentle)).max() > 0.1


CALM = ("disturbance={kind: none}", "start={x: -0.2, y: 0.1, u: 0.5}", "simulation.duration=80")
PID = ("controller.kind=pid", "simulation.step=0.001", "simulation.duration=4")


def told_gains(law: Controller) -> str:
    """The law with numbers that do not follow the delay."""
    return f"controller={json.dumps(law.model_dump())}"


@pytest.mark.parametrize(
    ("short", "long", "rest"),
    [
        (0.02, 0.03, PID),
        pytest.param(
            0.0015,
            0.003,
            ("simulation.step=0.0005", "simulation.duration=4"),
            marks=pytest.mark.long,
        ),
        pytest.param(0.12, 0.2, (told_gains(SlidingMode()),), marks=pytest.mark.long),
        (0.6, 0.9, (told_gains(VelocityVector()), *CALM)),
        (0.4, 0.7, (told_gains(MomentumVector()), "vessel.preset=cybership2", *CALM)),
    ],
)
def test_a_loop_that_is_too_fast_for_the_delay_is_told_and_oscillates(short, long, rest):
    sound, bad = (AT.format(short), *rest), (AT.format(long), *rest)
    assert "delayed-loop" not in codes(*sound)
    assert "delayed-loop" in codes(*bad)
    assert swings(*sound) < 0.05 * swings(*bad)


def swings(*overrides: str) -> float:
    """The demand's total variation over the last half of the run; infinite for a diverging run."""
    out = log(*overrides)
    if out.status != "finished":
        return np.inf
    return float(np.abs(np.diff(out["tau_u_cmd"][len(out["time"]) // 2 :])).sum())


@pytest.mark.parametrize(("gain", "delay"), [(1, 0.1), (1, 2), (10, 1), (1000, 1)])
def test_growth_and_margin_are_those_of_the_delay_equation(gain, delay):
    damping = 0.1
    loop = Loop("surge", "k", damping, np.array([-float(gain)]), np.zeros((0, 1)))
    root = -damping + lambertw(-gain * delay * np.exp(damping * delay)) / delay
    assert delayed_growth(loop, delay) == pytest.approx(root.real, rel=1e-9)
    margin = np.arccos(-damping / gain) / np.sqrt(gain**2 - damping**2)
    if delay > margin:
        assert delay_margin(loop, delay) == pytest.approx(margin, rel=1e-5)


def test_a_delayed_run_has_no_rate_of_v_and_no_bound():
    scenes = (scene("log.monitor=true", *given) for given in ((AT.format(0.1),), ()))
    told, now = (set(scene.about(scene.plan())) for scene in scenes)
    assert now - told == {"V_dot"}
    window = monitored(AT.format(0.1))
    assert window.observed is None
    assert monitored().observed is not None


def monitored(*overrides: str) -> monitor.Window:
    """The monitor's window over the whole of a short run."""
    scenario = scene("simulation.duration=2", *overrides)
    loop, grid = scenario.closed_loop(), scenario.time_grid()
    found = monitor.monitor_recording(Plan(loop, grid), simulate(loop, grid))
    assert found is not None
    assert ("V_dot" in found.recording.signals) == (not overrides)
    return found.windows["whole"]


@pytest.mark.parametrize("override", [AT.format(0.1), FAILS.format(1, 0.5)])
def test_optimum_takes_a_healthy_actuator_only(override):
    scenario = scene(override)
    with pytest.raises(PodusvError, match=r"leave actuator\.command and actuator\.failure out"):
        problem(scenario, "iae")


@pytest.mark.parametrize("path", sorted(SEA.glob("*.yaml")), ids=lambda path: path.stem)
def test_the_shipped_scenarios_load(path):
    assert load(path).scenario.singles()
