"""Findings about the law: told where they hold, borne out by simulation."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from command_samples import Said
from conftest import PACKAGE
from continuous import continuous
from findings_samples import BARE, CONFIGS, PLAIN, codes, finding, late, log, scene, simulated

from podusv_cli.components.controllers.velocity_loop import Loop
from podusv_cli.core.finding import Finding, merge_findings
from podusv_cli.findings.finding import preflight
from podusv_cli.findings.outcome import warn_of_saturation
from podusv_cli.findings.stability import loops, rk4_growth, sampled_growth
from podusv_cli.scenario.load import load

LONG = "simulation.duration=120"
PRINTED = "controller.coupling=printed"


def test_the_printed_sign_with_low_gains_is_a_saddle_and_runs_away():
    saddle = (*BARE, LONG, PRINTED)  # k_ze k_ue = 0.4
    assert "coupling-saddle" in codes(*saddle)
    assert late("z_e", *saddle).min() > 100.0
    for sound in ((*saddle, "controller.k_ue=40"), (*BARE, LONG)):
        assert "coupling-saddle" not in codes(*sound)
        assert late("z_e", *sound).max() < 2.0


def test_the_saddle_grows_at_the_rate_that_is_told():
    out = log(*BARE, LONG, PRINTED)
    assert "grows at 0.071 1/s" in finding("coupling-saddle", *BARE, LONG, PRINTED).text
    # Drag slows it down: X_u alone makes it 0.062 1/s, the rest of the drag more so.
    early = (out["time"] > 5) & (out["time"] < 20)
    rate = np.polyfit(out["time"][early], np.log(np.abs(out["z_e"][early] - 0.5)), 1)[0]
    assert 0.0 < rate < 0.071


@pytest.mark.parametrize(
    ("law", "gain", "key"),
    [
        ("pid", "K_Pu", "K_Du"),
        ("pid", "K_Ir", "K_Dr"),
        ("pid", "K_Dr", "K_Dr"),
        ("adaptive_neural", "k_ue", "Gamma_u"),
        ("velocity_vector", "k_p", "k_u"),
        ("velocity_vector", "omega_r", "k_r"),
        ("hand_position", "k_i", "k_v"),
    ],
)
def test_the_gain_that_makes_a_loop_fast_is_named(law, gain, key):
    """It is not the one that does it with usual gains."""
    changed = (f"controller={{kind: {law}, {gain}: 1e9}}",)
    (first, *_) = (f for f in preflight(scene(*changed)) if f.code.startswith("stiff-"))
    assert first.text.endswith(f"or a smaller {gain}")
    assert gain == key or not first.text.endswith(f" {key}")


@pytest.mark.parametrize("fold", ["printed", "none"])
def test_a_start_that_faces_away_is_told_and_drives_away(fold):
    astern = (f"controller.fold={fold}", "start.psi=3.0")
    assert "start-astern" in codes(*astern)
    assert log(*astern).status == "diverged"
    for sound in (("start.psi=3.0",), (f"controller.fold={fold}", "start.psi=0.5")):
        assert "start-astern" not in codes(*sound)
        assert late("z_e", *sound).max() < 5.0


def test_a_first_difference_from_zero_is_told_and_kicks():
    difference = ("controller.rate=difference", "controller.B_r=5.0", "controller.standoff=0.5")
    zero = (*difference, "controller.first_difference=from_zero")
    assert "start-kick" in codes(*zero)
    assert "78.5 rad/s" in finding("start-kick", *zero).text
    assert "start-kick" not in codes(*difference)
    assert simulated(*zero)[1]["peak_tau_r"] > 20 * simulated(*difference)[1]["peak_tau_r"]


def test_a_network_far_from_the_speeds_needed_is_told_and_stays_silent():
    far = ("controller.network.low=[3, 2, 2]", "controller.network.high=[6, 4, 4]", LONG)
    assert "network-range" in codes(*far)
    assert np.abs(late("f_hat_u", *far)).max() < 1e-3
    assert "network-range" not in codes(LONG)
    assert np.abs(late("f_hat_u", LONG)).max() > 1e-2
    assert late("z_e", *far).max() > late("z_e", LONG).max() + 0.4


# Each is too stiff at 0.01 s and not at 0.005 s.
STIFF = {
    "stiff-adaptation": ("controller.Gamma_r=4000",),
    "stiff-start": ("controller.k_ze=0.7",),
    "stiff-derivative": ("controller={kind: pid, T_d: 0.015}",),
}


@pytest.mark.parametrize("code", STIFF)
def test_a_loop_too_fast_for_the_step_is_told_and_diverges(code):
    coarse, fine = (*STIFF[code], "simulation.step=0.01"), (*STIFF[code], "simulation.step=0.005")
    assert code in codes(*coarse)
    assert log(*coarse).status == "diverged"
    assert code not in codes(*fine)
    assert late("z_e", *fine).max() < 6.0


@pytest.mark.parametrize("Gamma", [500, 1000, 2000, 4000])
@pytest.mark.parametrize("step", [0.02, 0.01])
def test_the_step_at_which_the_adaptation_fails_is_the_one_told(Gamma, step):
    case = (f"controller.Gamma_u={Gamma}", f"simulation.step={step}")
    out, metrics = simulated(*case)
    chatters = out.status == "diverged" or metrics["tv_tau_u"] > 10.0
    assert chatters == ("stiff-adaptation" in codes(*case))


SAMPLED = {
    # the law, a period [s] that is too long, one that is not
    "sampled-adaptation": ((), 0.01, 0.002),
    "sampled-derivative": (("controller={kind: pid}",), 0.05, 0.02),
}


@pytest.mark.parametrize("code", SAMPLED)
def test_a_loop_too_fast_for_its_sampling_is_told_and_chatters(code):
    law, slow, fast = SAMPLED[code]
    held = [(*law, "simulation.step=0.001", f"control.period={t}") for t in (slow, fast)]
    assert [code in codes(*case) for case in held] == [True, False]
    chatter = [simulated(*case)[1]["tv_tau_u"] for case in held]
    assert chatter[0] > 100 * chatter[1]


@pytest.mark.parametrize(
    "law", [(), ("controller={kind: pid}",), ("controller={kind: dsc}",)], ids=["an", "pid", "dsc"]
)
def test_the_linearised_loops_are_those_of_the_whole_closed_loop(law):
    """Their eigenvalues are among the largest of the closed loop's, differentiated numerically."""
    start = "start={x: -8, y: -4, psi: 0.4, u: 0.5, v: 0.05, r: 0.02}"
    scenario = scene(*law, start, "disturbance={kind: none}")
    slope, s = continuous(scenario.closed_loop(), 1.0, compiled=False)
    columns = []
    for i in range(len(s)):
        shift = np.zeros_like(s)
        shift[i] = 1e-6
        columns.append((slope(0.0, s + shift) - slope(0.0, s - shift)) / 2e-6)
    whole = np.linalg.eigvals(np.array(columns).T)
    for loop in loops(scenario, s[3:6]):
        # A loop's fast mode: within 10 % of one of the whole system's.
        fastest = max(np.linalg.eigvals(loop.matrix), key=abs)
        assert min(abs(whole - fastest)) < 0.1 * abs(fastest), loop.axis


def bare_loop(feedback: list[float], memory: list[list[float]]) -> Loop:
    return Loop("surge", "k", 0.0, np.array(feedback), np.array(memory).reshape(-1, len(feedback)))


def test_rk4_is_stable_up_to_its_textbook_limits():
    decay, swing = bare_loop([-1.0], []), bare_loop([0.0, -1.0], [[1.0, 0.0]])
    assert rk4_growth(decay, 2.785) < 1.0 < rk4_growth(decay, 2.786)
    assert rk4_growth(swing, 2.828) < 1.0 < rk4_growth(swing, 2.829)
    assert rk4_growth(bare_loop([1.0], []), 10.0) == 1.0  # grows by itself, whatever the step


@pytest.mark.parametrize("count", [1, 4])
def test_a_held_feedback_is_an_euler_step_of_the_period(count):
    assert sampled_growth(bare_loop([-1.0], []), 1.9 / count, count) == pytest.approx(0.9)
    assert sampled_growth(bare_loop([-1.0], []), 2.1 / count, count) == pytest.approx(1.1)
    # e' = -a, a' = e, both held: one step of Euler, which spirals out by sqrt(1 + T^2).
    swing = bare_loop([0.0, -1.0], [[1.0, 0.0]])
    assert sampled_growth(swing, 0.5 / count, count) == pytest.approx(np.hypot(1.0, 0.5))


# --- findings about disturbances, sensors and the command path

SENSORS = "measurement={kind: sensors}"
FILTER = "estimator={kind: ekf}"
LATE, TOLD_LATE = (
    "measurement={kind: sensors, position: {delay: 0.1}}",
    FILTER[:-1] + ", delay_p: 0.1}",
)


def sea(*kinds):
    return f"disturbance=[{', '.join(kinds)}]"


STEP = sea("{kind: none}", "{kind: step, b_u: 2, time: %s}")
WAVES = sea("{kind: waves, height: %s, period: 0.5}")
LASTING = "simulation.duration=20000"
SWELL = "{kind: waves, height: 0.02, period: 2, seed: %d}"
WIND = sea("{kind: wind, speed: 1, gusts: %s}")
SIGMA = "estimator={kind: ekf, sigma_psi: %s}"
CASES = [  # code, its key, overrides with it, and without
    (
        "large-angle",
        "disturbance[0].direction",
        [sea("{kind: current, direction: 225}")],
        [sea("{kind: current, direction: 3.9}")],
    ),
    ("late-load", "disturbance[1].time", [STEP % 20], [STEP % 19]),
    ("load-between-steps", "disturbance[1].time", [STEP % 10.005], [STEP % 10.01]),
    ("load-between-steps", "disturbance[1].time", [STEP % 10.005], [STEP % "10.005, ramp: 1"]),
    (
        "late-outage",
        "measurement",
        ["measurement={kind: sensors, position: {outages: [[20, 30]]}}"],
        ["measurement={kind: sensors, position: {outages: [[19, 30]]}}"],
    ),
    (
        "dead-zone",
        "actuator.command.dead_zone_u",
        ["actuator={kind: saturated, surge_limit: 8, command: {dead_zone_u: 20}}"],
        ["actuator={kind: saturated, surge_limit: 8, command: {dead_zone_u: 1}}"],
    ),
    (
        "dead-zone",
        "actuator.command.dead_zone_r",
        ["actuator={kind: saturated, yaw_limit: 2, command: {dead_zone_r: 2}}"],
        ["actuator={kind: ideal, command: {dead_zone_r: 2}}"],
    ),
    ("estimator-noise", "estimator.sigma_psi", [SENSORS, SIGMA % 0.0024], [SENSORS, FILTER]),
    ("estimator-noise", "estimator.sigma_psi", [SENSORS, SIGMA % 0.011], [SENSORS, SIGMA % 0.009]),
    (
        "estimator-noise",
        "estimator.sigma_psi",
        [SENSORS, SIGMA % 0.011],
        [SENSORS, SIGMA % 0.011, sea("{kind: waves, height: 0.02, period: 2}")],
    ),
    ("estimator-delay", "estimator.delay_p", [LATE, FILTER], [LATE, TOLD_LATE]),
    (
        "estimator-delay",
        "estimator.delay_p",
        [SENSORS, TOLD_LATE],
        [LATE, "estimator={kind: low_pass}"],
    ),
    ("steep-waves", "disturbance[0].height", [WAVES % 0.5], [WAVES % 0.05]),
    (
        "few-components",
        "disturbance[0].components",
        [sea("{kind: waves, height: 5e-4, period: 0.1, components: 175}")],  # 0.9 a period: 180
        [sea("{kind: waves, height: 5e-4, period: 0.1, components: 185}")],
    ),
    (
        "few-components",
        "disturbance[0].components",
        [sea("{kind: waves, height: 1e-3, period: 0.19, components: 50}")],  # 105 periods
        [sea("{kind: waves, height: 1e-3, period: 0.21, components: 50}")],
    ),
    ("same-waves", "disturbance[1].seed", [sea(*[SWELL % 1] * 2)], [sea(SWELL % 1, SWELL % 2)]),
    (
        "few-components",
        "disturbance[0].components",
        [LASTING, sea("{kind: wind, speed: 1, gusts: norsok, components: 560}")],  # 568
        [LASTING, sea("{kind: wind, speed: 1, gusts: norsok, components: 580}")],
    ),
    ("model-gusts", "disturbance[0].gusts", [WIND % "norsok"], [WIND % "none"]),
]


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
    (text,) = warn_of_saturation.search(scene(*tight, *override).alone(), log(*tight))
    assert says in text
    assert "anti_windup" not in text
    (text,) = warn_of_saturation.search(scene(*tight).alone(), log(*tight))
    assert text.endswith("consider anti_windup: auxiliary")


# --- where warnings go, how they look there, and how they are silenced

SHORT = ("--set", "simulation.duration=1", "--set", "actuator={kind: ideal}", "--no-figures")
SWAYING = (
    "--set",
    "vessel.preset=paper",
    "--set",
    "silence=[path-bend, bound-growing, never-settles, outside-envelope]",
)


def scenario_file(name: str) -> str:
    return str(CONFIGS / name)


def test_warnings_come_on_stderr_in_json_and_in_the_run_folder(podusv):
    bad = ("run", scenario_file("corrected.yaml"), *SWAYING, *SHORT)
    said: Said = podusv(*bad, "--out", "out", "--json")
    assert said.code == 0
    lines = said.err.splitlines()
    assert {line.partition(":")[0] for line in lines} == {
        "warning[sway-drift]",
        "warning[sway-unstable]",
    }
    printed = json.loads(said.out)["warnings"]
    assert [f"warning[{w['code']}]: {w['where']}: {w['text']}" for w in printed] == lines
    assert json.loads(Path("out/metrics.json").read_text())["warnings"] == printed
    assert podusv(*bad, "--out", "quiet", "-q").err == ""


def test_what_is_silenced_is_not_shown(podusv):
    bad = (
        "--set",
        "vessel.preset=paper",
        "--set",
        "silence=[sway-drift, sway-unstable, bound-growing, never-settles, outside-envelope]",
    )
    assert podusv("run", scenario_file("corrected.yaml"), *bad, *SHORT, "--out", "o").err == ""
    said = podusv("validate", scenario_file("corrected.yaml"), *bad)
    assert "sway" not in said.out
    assert "path-bend" in said.out


def test_an_unknown_code_is_refused_with_a_suggestion(podusv):
    said = podusv("validate", "a.yaml", "--set", "silence=[path-jumps]")
    assert said.code == 2
    assert "did you mean 'path-jump'?" in said.err


def test_findings_that_not_all_runs_share_name_their_runs():
    shared, some, own = (Finding(code, "actuator", code) for code in ("a", "b", "c"))
    found = merge_findings({"x": [shared, some], "y": [some, shared, own], "z": [shared, own, own]})
    assert [str(finding) for finding in found] == [
        "warning[a]: actuator: a",
        "warning[b]: x, y: actuator: b",
        "warning[c]: y, z: actuator: c",
    ]
    assert merge_findings({"x": [shared], "there already": []})[0].runs == ("x",)
    assert merge_findings({"x": [shared]}) == [shared]


def transcripts() -> list[tuple[str, list[str]]]:
    """Every `podusv validate` of docs/findings.md, with the lines shown below it."""
    text = (PACKAGE.parent / "docs" / "findings.md").read_text()
    blocks = re.findall(r"^    \$ podusv validate (\S+)\n((?:    .*\n)+)", text, re.MULTILINE)
    return [(config, shown.replace("\n    ", "\n")[4:].splitlines()) for config, shown in blocks]


def test_docs_show_what_a_terminal_shows(podusv, monkeypatch):
    monkeypatch.setattr("podusv_cli.cli.terminal.sys.stdout.isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.chdir(PACKAGE.parent)
    assert transcripts()
    for config, shown in transcripts():
        assert podusv("validate", config).out.splitlines() == shown


def test_findings_are_wrapped_on_a_terminal_and_whole_in_a_pipe(podusv, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    monkeypatch.setenv("TERM", "dumb")  # no bar, which a slow run would have among them
    validate, run = (
        (command, scenario_file("corrected.yaml"), *SWAYING, *SHORT[:4])
        for command in ("validate", "run")
    )
    whole = podusv(*validate).out.splitlines()[2:]
    assert podusv(*run, "--no-figures", "--out", "a").err.splitlines() == whole
    assert len(whole) == 2
    for stream in ("stdout", "stderr"):
        monkeypatch.setattr(
            f"podusv_cli.cli.terminal.sys.{stream}.isatty", lambda: True, raising=False
        )
    err = podusv(*run, "--no-figures", "--out", "b").err
    out = podusv(*validate).out
    for shown in (out[out.index("warning") :].splitlines(), err.splitlines()):
        assert max(map(len, shown)) <= 60 < len(shown) * 60 / 2
        assert " ".join(line.strip() for line in shown) == " ".join(whole)


def test_silencing_is_no_difference_between_runs_and_survives_resolving(podusv):
    loud = (*PLAIN, "silence=[path-jump, saturated]")
    assert load(CONFIGS / "corrected.yaml", loud).scenario.silence == ("path-jump", "saturated")
    run = ("run", scenario_file("corrected.yaml"), *SHORT)
    podusv(*run, "--out", "a")
    podusv(*run, "--set", "silence=[saturated]", "--out", "b")
    assert load("a/resolved.yaml").scenario.silence == ()
    assert load("b/resolved.yaml").scenario.silence == ("saturated",)
    assert "silence" not in podusv("compare", "a", "b", "--no-figures", "--out", "ab").err
