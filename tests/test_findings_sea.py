"""Findings about disturbances, sensors and the command path: told where they hold, and not else."""

import math

import pytest
from findings_samples import codes, finding, log, scene

from podusv_cli.findings.outcome import saturated

SENSORS = "measurement={kind: sensors}"
FILTER = "estimator={kind: ekf}"


def sea(*kinds):
    return f"disturbance=[{', '.join(kinds)}]"


STEP = sea("{kind: none}", "{kind: step, b_u: 2, time: %s}")
WAVES = sea("{kind: waves, height: %s, period: 0.5}")
WIND = sea("{kind: wind, speed: 1, gusts: %s}")
SIGMA = "estimator={kind: ekf, sigma_psi: %s}"
CASES = [  # code, its key, overrides with it, and without
    ("large-angle", "disturbance[0].direction", [sea("{kind: current, direction: 225}")],
     [sea("{kind: current, direction: 3.9}")]),
    ("late-load", "disturbance[1].time", [STEP % 20], [STEP % 19]),
    ("load-between-steps", "disturbance[1].time", [STEP % 10.005], [STEP % 10.01]),
    ("load-between-steps", "disturbance[1].time", [STEP % 10.005],
     [STEP % "10.005, ramp: 1"]),
    ("late-outage", "measurement", ["measurement={kind: sensors, position: {outages: [[20, 30]]}}"],
     ["measurement={kind: sensors, position: {outages: [[19, 30]]}}"]),
    ("dead-zone", "actuator.command.dead_zone_u",
     ["actuator={kind: saturated, surge_limit: 8, command: {dead_zone_u: 20}}"],
     ["actuator={kind: saturated, surge_limit: 8, command: {dead_zone_u: 1}}"]),
    ("dead-zone", "actuator.command.dead_zone_r",
     ["actuator={kind: saturated, yaw_limit: 2, command: {dead_zone_r: 2}}"],
     ["actuator={kind: ideal, command: {dead_zone_r: 2}}"]),
    ("estimator-noise", "estimator.sigma_psi", [SENSORS, SIGMA % 0.0024], [SENSORS, FILTER]),
    ("estimator-noise", "estimator.sigma_psi", [SENSORS, SIGMA % 0.011], [SENSORS, SIGMA % 0.009]),
    ("estimator-noise", "estimator.sigma_psi", [SENSORS, SIGMA % 0.011],
     [SENSORS, SIGMA % 0.011, sea("{kind: waves, height: 0.02, period: 2}")]),
    ("steep-waves", "disturbance[0].height", [WAVES % 0.5], [WAVES % 0.05]),
    ("model-gusts", "disturbance[0].gusts", [WIND % "norsok"], [WIND % "none"]),
]  # fmt: skip


@pytest.mark.parametrize(("code", "key", "doubtful", "sound"), CASES)
def test_what_can_hardly_be_meant_is_told_at_its_key(code, key, doubtful, sound):
    assert finding(code, *doubtful).where == key
    assert code not in codes(*sound)


def test_a_load_after_the_run_never_acts_and_one_before_its_end_does():
    short = ("simulation.duration=2", "controller={kind: pid}")
    assert "late-load" in codes(*short, STEP % 2)
    assert not log(*short, STEP % 2)["b_u"][:-1].any()
    assert "late-load" not in codes(*short, STEP % 1)
    assert log(*short, STEP % 1)["b_u"][-2] == 2.0


def test_a_dead_zone_beyond_the_limit_takes_all_that_the_limit_allows():
    gentle = "controller={kind: pid, K_Pu: 1, K_Iu: 0, K_Du: 0}"
    limited = "actuator={kind: saturated, surge_limit: 8, command: {dead_zone_u: %s}}"
    for zone, moves in ((20, False), (0.5, True)):
        out = log(gentle, limited % zone)
        assert 1.0 < abs(out["tau_u_cmd"]).max() < 8.0
        assert out["tau_u"].any() == moves


def test_steepness_is_that_of_waves_of_the_peak_s_period():
    length = 9.81 * 0.5**2 / (2.0 * math.pi)
    for share, told in ((0.99, False), (1.01, True)):
        assert ("steep-waves" in codes(WAVES % (share * length / 7.0))) is told


@pytest.mark.parametrize(
    ("override", "says"),
    [
        (("actuator={kind: saturated, surge_limit: 2, command: {delay: 0.1}}",), "delay of 0.1 s"),
        ((SENSORS,), "sensors with noise and delay"),
        (("control.period=0.1",), "a control period of 0.1 s"),
    ],
)
def test_what_makes_the_demand_swing_is_told_in_place_of_windup(override, says):
    tight = ("actuator={kind: saturated, surge_limit: 2.0}", "simulation.duration=5")
    (text,) = saturated.search(scene(*tight, *override).alone(), log(*tight))
    assert says in text
    assert "anti_windup" not in text
    (text,) = saturated.search(scene(*tight).alone(), log(*tight))
    assert text.endswith("consider anti_windup: auxiliary")
