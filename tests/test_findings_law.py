"""Findings about the law: told where they hold, borne out by simulation."""

import numpy as np
import pytest
from findings_samples import BARE, codes, finding, late, log, scene, simulated

from podusv_cli.components.controllers.velocity_loop import Loop
from podusv_cli.engine.running.continuous import continuous
from podusv_cli.findings.finding import preflight
from podusv_cli.findings.stability import loops, rk4_growth, sampled_growth

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
