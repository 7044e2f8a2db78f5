"""Warnings after a run, with times; underactuation."""

import math
import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from conftest import VESSELS, example, kinds
from findings_samples import CONFIGS, log, scene

from podusv_cli.components.controllers.base import Controller
from podusv_cli.core.recording import Recording
from podusv_cli.findings.finding import finding_kinds, postflight, preflight
from podusv_cli.findings.limit_cycle import limit_cycle
from podusv_cli.findings.outcome import warn_of_saturation
from podusv_cli.findings.proof import argument
from podusv_cli.scenario.load import load
from podusv_cli.scenario.model import Scenario


def told(code: str, *overrides: str) -> list[str]:
    """Texts of that code about the run of a scenario."""
    findings = postflight(scene(*overrides).alone(), log(*overrides))
    return [finding.text for finding in findings if finding.code == code]


def changed(out: Recording, **signals: Any) -> Recording:
    return replace(out, signals={**out.signals, **signals})


# --- the table


def test_findings_come_in_the_order_of_the_scenario_s_sections():
    sections = [
        list(Scenario.model_fields).index(n.about.split(".")[0]) for n in finding_kinds().values()
    ]
    assert sections == sorted(sections)
    assert {kind.when for kind in finding_kinds().values()} == {"before", "after"}


@pytest.mark.parametrize("code", finding_kinds())
def test_explain_shows_when_a_finding_comes_true_and_what_to_do(code, podusv):
    notice, out = finding_kinds()[code], " ".join(podusv("explain", code).out.split())
    assert f"condition: {notice.condition} remedy: {notice.remedy}" in out
    assert len(notice.condition) > 10
    assert len(notice.remedy) > 10


# --- each look, on a run where it is so and on one where it is not


def test_a_run_that_touches_the_singularity_is_told_with_the_time():
    touching = ("controller={kind: pid, standoff: 0.0}", "simulation.duration=60")
    (text,) = told("near-target", *touching)
    out = log(*touching)
    first = out["time"][np.argmax(out["z_e"] < 0.05 * 1.255)]
    assert f"{first:.6g} s" in text
    assert "take a standoff" in text
    assert told("near-target", "controller={kind: pid}", "simulation.duration=60") == []
    held = scene(*touching, "controller.hold_below=0.1").alone()
    assert "near-target" not in {f.code for f in postflight(held, out)}


def test_a_heading_across_the_line_of_sight_is_told_with_the_time():
    quiet = log()
    assert told("crosswise") == []
    psi_e = np.array(quiet["psi_e"])
    psi_e[700:703] = math.pi / 2 - 0.01
    across = postflight(scene(), changed(quiet, psi_e=psi_e))
    assert [f.text for f in across if f.code == "crosswise"] == [
        "|cos psi_e| falls below 0.05 from 7 s to 7.02 s; the virtual surge velocity (21) divides "
        "by it"
    ]


def test_velocities_outside_the_network_are_told_and_the_activation_is_low_there():
    far = ("controller.network.low=[3, 2, 2]", "controller.network.high=[6, 4, 4]")
    (text,) = told("off-network", *far)
    assert text.startswith("no node within 2 widths of (u, v, r) from 0 s to 20 s")
    assert told("off-network") == []


def test_listed_centres_are_looked_at_like_a_grid():
    grid = scene().controller
    listed = "[" + ", ".join(str(list(map(float, c))) for c in grid.network.center_array()) + "]"
    widths = list(map(float, grid.network.width_array()))
    same = (f"controller.network.centers={listed}", f"controller.network.widths={widths}")
    assert told("off-network", *same) == []
    shifted = listed.replace("-1.0, -1.0, -1.0", "9.0, 9.0, 9.0")
    assert told("off-network", f"controller.network.centers={shifted}", same[1]) == []


def test_a_bound_without_leakage_still_grows_at_the_end():
    wind_up = ("controller.sigma_bu=0", "actuator={kind: saturated, surge_limit: 0.5}")
    assert told("bound-growing", *wind_up)[0].startswith("b_hat_u still grows at the end")
    assert told("bound-growing", "simulation.duration=60") == []


def test_long_saturation_is_told_with_its_times():
    tight = "actuator={kind: saturated, surge_limit: 2.0}"
    (text,) = told("saturated", tight)
    limited = log(tight)["saturated"] > 0.5
    assert f"{limited.mean():.1%} of the run" in text
    assert "consider anti_windup: auxiliary" in text
    (text,) = told("saturated", tight, "controller.anti_windup=auxiliary")
    assert "its memory does not wind up" in text
    assert told("saturated", "actuator={kind: saturated, surge_limit: 1e6, yaw_limit: 1e6}") == []


def test_saturation_is_long_from_a_fiftieth_of_the_run():
    quiet = log()
    rows = len(quiet["time"])
    for limited, found in ((rows // 50, 0), (rows // 50 + 1, 1)):
        at_limit = np.where(np.arange(rows) < limited, 1.0, 0.0)
        findings = postflight(scene().alone(), changed(quiet, saturated=at_limit))
        assert [finding.code for finding in findings].count("saturated") == found


def moving(u, v, r, **water):
    """Findings about the envelope of a hull that moves like this from 2 s to 3 s of 20 s."""
    out = log()
    under_way = (out["time"] >= 2.0) & (out["time"] <= 3.0)
    signals = {name: under_way * value for name, value in {"u": u, "v": v, "r": r, **water}.items()}
    findings = postflight(scene().alone(), changed(out, psi=0.0 * out["psi"], **signals))
    return [finding.text for finding in findings if finding.code == "outside-envelope"]


@pytest.mark.parametrize(
    ("velocities", "says"),
    [
        ((1.06, 0.0, 0.0), ["a speed of up to 1.05 m/s, and this run has 1.06 m/s"]),
        ((0.9, 0.6, 0.0), ["a speed of up", "up to 0.524 rad, and this run has 0.588 rad"]),
        ((0.05, 0.05, 0.0), []),  # at rest a hull has any drift angle
        ((-0.5, 0.0, 0.0), []),
        ((-0.5, 0.4, 0.0), ["and this run has 0.675 rad"]),
        ((0.5, 0.0, -0.85), ["a yaw rate of up to 0.84 rad/s, and this run has 0.85 rad/s"]),
        ((1.0, 0.33, 0.83), ["a speed of up"]),
        ((1.0, 0.1, 0.83), []),
    ],
)
def test_motion_beyond_what_was_measured_is_told(velocities, says):
    texts = moving(*velocities)
    assert len(texts) == len(says)
    for text, part in zip(texts, says, strict=True):
        assert part in text
        assert "from 2 s to 3 s" in text


def test_the_envelope_is_that_of_motion_through_the_water():
    assert moving(1.2, 0.0, 0.0, V_c=0.2, beta_c=0.0) == []
    assert len(moving(0.9, 0.0, 0.0, V_c=0.2, beta_c=math.pi)) == 1
    (text,) = moving(0.0, 0.0, 0.0, V_c=0.3, beta_c=math.pi / 2)
    assert "a drift angle" in text


def test_a_filter_that_is_told_wrong_noise_is_told_by_its_innovations():
    seen = ("measurement={kind: sensors}", "simulation.duration=20")
    assert told("inconsistent-filter", *seen, "estimator={kind: ekf}") == []
    sharp = told("inconsistent-filter", *seen, "estimator={kind: ekf, sigma_psi: 0.001}")
    assert [text.split(" are ")[0] for text in sharp] == [
        "innovations of the heading",
        "innovations of the yaw rate",
    ]
    assert "give it a larger sigma first" in sharp[0]
    dull = "estimator={kind: ekf, sigma_p: 1, sigma_psi: 1, sigma_u: 1, sigma_v: 1, sigma_r: 1}"
    texts = told("inconsistent-filter", *seen, dull)
    assert len(texts) == 4
    assert all("it takes good measurements for noise" in text for text in texts)


@pytest.mark.parametrize(("count", "found"), [(8, 0), (9, 1)])  # chi-squared of 8: 2.9 in 1000
def test_a_filter_is_told_wrong_only_where_chance_does_not_explain_it(count, found):
    seen = ("measurement={kind: sensors}", "simulation.duration=20", "estimator={kind: ekf}")
    counts = np.outer([0.0, 1.0], [0.0, 0.0, count, 0.0, 0.0, 0.0])
    signals = {"time": np.array([18.0, 20.0]), "nis_sum": 3.2 * counts, "nis_count": counts}
    search = finding_kinds()["inconsistent-filter"].search
    assert len(list(search(scene(*seen).alone(), Recording("finished", "a", signals)))) == found


def test_a_law_without_integral_is_not_told_that_it_winds_up():
    tight = ("controller={kind: sliding_mode}", "actuator={kind: saturated, surge_limit: 2.0}")
    (text,) = told("saturated", *tight)
    assert "its memory does not wind up" in text


def test_limits_that_are_over_are_told_where_memory_winds_up_or_the_run_is_lost():
    scenario, out = scene().alone(), log()
    law = SimpleNamespace(slots=lambda: (1,), wants_loads=lambda: True)
    told_of_loads = scenario.model_copy(update={"controller": law})
    approach = out["time"] < 0.5 * out["time"][-1]
    early, late = changed(out, saturated=1.0 * approach), changed(out, saturated=1.0 * ~approach)
    assert len(list(warn_of_saturation.search(scenario, early))) == 1
    assert list(warn_of_saturation.search(told_of_loads, early)) == []
    (text,) = warn_of_saturation.search(told_of_loads, late)
    assert "100.0% of the steady window" in text
    (text,) = warn_of_saturation.search(told_of_loads, replace(early, status="diverged"))
    assert "of the run" in text


def test_what_helps_against_windup_is_what_the_law_has():
    scenario, out = scene().alone(), changed(log(), saturated=np.ones_like(log()["z_e"]))

    def advice(**own):
        quiet = {"slots": lambda: (1,), "wants_loads": lambda: False}
        law = SimpleNamespace(**quiet | own)
        (text,) = warn_of_saturation.search(scenario.model_copy(update={"controller": law}), out)
        return text

    assert "anti_windup" not in advice(against_windup=Controller.against_windup)
    assert "after_saturation" in advice(against_windup=Controller.against_windup)
    assert "no memory" in advice(slots=tuple)
    (text,) = warn_of_saturation.search(scenario, out)
    assert text.endswith("consider anti_windup: auxiliary")


def test_a_vessel_that_ends_further_away_than_it_started_is_told_with_both_distances():
    lost = ("controller={kind: pid, K_Pu: 0, K_Iu: 0, K_Du: 0}", "simulation.duration=60")
    (text,) = told("moves-away", *lost)
    out = log(*lost)
    late = out["time"] >= 48.0
    assert f"starts {out['z_e'][0]:.3g} m" in text
    assert f"is {out['z_e'][late].mean():.3g} m away" in text
    assert told("moves-away") == []
    assert told("moves-away", "controller={kind: pid}", "start={x: 0.0, y: 0.0}") == []


def test_a_vessel_that_stays_behind_is_told_with_its_error_beyond_the_standoff():
    weak = "controller={kind: pid, K_Pu: 2.0, K_Iu: 0, K_Du: 0, standoff: 0.5}"
    behind = (weak, "start={x: -10.0, y: 0.0}", "simulation.duration=100")
    (text,) = told("never-settles", *behind)
    out = log(*behind)
    error = np.mean(out["z_e"][out["time"] >= 80.0]) - 0.5
    assert f"is {error:.3g} m away from its standoff of 0.5 m" in text
    assert text.endswith("it does not come nearer; take larger gains, or add integral action")
    early = (weak.replace("2.0", "20.0"), "start={x: -30.0, y: 0.0}", "simulation.duration=20")
    assert told("never-settles", *early)[0].endswith("it still comes nearer; simulate longer")
    assert told("moves-away", *behind) == []
    assert told("never-settles", *behind, f"metrics.settling_radius={error + 0.01}") == []
    assert told("never-settles", "controller.standoff=3.0", "simulation.duration=100") == []
    assert told("never-settles", "controller={kind: turning_circle, execute: 1.0}") == []


CALM = ("vessel={preset: cybership2}", "disturbance={kind: none}", "simulation.duration=120")


def test_a_swing_that_goes_on_is_told_with_amplitude_and_period():
    swinging = (*CALM, "controller={kind: velocity_vector}", "path={kind: line, speed: 0.5}")
    (text,) = told("limit-cycle", *swinging)
    out = log(*swinging)
    y, time = (out[name][out["time"] >= 96.0] for name in ("y", "time"))
    ups = time[1:][(y[:-1] < 0.0) & (y[1:] >= 0.0)]
    amplitude, period = (float(part) for part in re.findall(r"of (\S+) (?:m|s) ", text))
    assert amplitude == pytest.approx(np.ptp(y) / 2, rel=0.03)
    assert period == pytest.approx(np.diff(ups).mean(), rel=0.02)


STILL = scene(
    *CALM[:2], "path={kind: line, speed: 0.5}", "controller={kind: velocity_vector}"
).alone()
LONG, SWAY = STILL.vessel.length, STILL.vessel.m22


def swinging(periods=4.0, size=0.02, decay=1.0, noise=0.0, load=0.0, turn=0.0):
    """Whether a run is told to swing: across a line, in hull lengths, over the steady window.

    `decay` is the amplitude at the end over that in the middle of the window, `load` the sway force
    over m22 times the acceleration, `turn` the acceleration of the target over that of the swing.
    """
    t = np.arange(0.0, 20.001, 0.01)
    rate = 2.0 * np.pi * periods / 4.0
    swing = LONG * size * np.sin(rate * t) * decay ** ((t - 18.0) / 2.0)
    pushed = turn * LONG * size * np.sin(rate * t)
    random = np.random.default_rng(1).normal(0.0, noise * LONG * size, len(t))
    zero = np.zeros_like(t)
    signals = {
        "time": t,
        "x": 0.5 * t,
        "x_d": 0.5 * t,
        "y": swing + pushed + random,
        "y_d": pushed,
        "u": zero,
        "v": np.gradient(swing, t),
        "r": zero,
        "b_u": zero,
        "b_r": zero,
        "b_v": load * SWAY * rate * rate * swing,
    }
    scenario = STILL.model_copy(
        update={"simulation": STILL.simulation.model_copy(update={"duration": 20.0})}
    )
    return bool(list(limit_cycle.search(scenario, Recording("finished", "a law", signals))))


@pytest.mark.parametrize(
    ("told", "untold"),
    [
        ({"size": 0.011}, {"size": 0.009}),
        ({"periods": 3.0}, {"periods": 2.0}),
        ({"decay": 0.97}, {"decay": 0.9}),
        ({"decay": 1.5}, {"decay": 0.5}),
        ({"noise": 0.2}, {"noise": 1.5}),
        ({"load": 0.05}, {"load": 0.2}),
        ({"turn": 0.05}, {"turn": 0.2}),
    ],
)
def test_a_swing_is_told_where_it_is_visible_pure_and_goes_on_by_itself(told, untold):
    assert swinging(**told)
    assert not swinging(**untold)


@pytest.mark.parametrize(
    "kind", ["{kind: current, speed: 0.05}", "{kind: waves, height: 0.01, period: 1.5}"]
)
def test_a_cycle_in_a_sea_is_told_as_in_calm_water(kind):
    cycling = ("controller={kind: velocity_vector}", "path={kind: line, speed: 0.5}")
    assert told("limit-cycle", CALM[0], CALM[2], f"disturbance={kind}", *cycling)


def test_a_stable_law_a_push_and_a_winding_path_are_no_cycle():
    stable = (*CALM, "controller={kind: velocity_vector}", "path={kind: line, speed: 1.1}")
    winding = (*CALM[1:], "controller={kind: velocity_vector}", "path={kind: sinusoid}")
    pushed = (
        "controller={kind: pid}",
        "simulation.duration=120",
        "disturbance={kind: harmonic, b_v: {sin: 2.0, sin_rate: 1.3, cos: 0.0}}",
    )
    out = log(*pushed)
    assert np.ptp(out["y"][out["time"] >= 96.0]) > 0.05
    assert [told("limit-cycle", *run) for run in (stable, winding, pushed)] == [[], [], []]


def test_nothing_is_told_about_a_run_without_rows():
    empty = {name: values[:0] for name, values in log().signals.items()}
    assert postflight(scene(), Recording("interrupted", "adaptive_neural", empty)) == []


# --- no false alarms


def test_the_shipped_corrected_scenario_has_only_the_findings_that_are_true_of_it():
    findings = preflight(load(CONFIGS / "corrected.yaml").scenario)
    assert [f.code for f in findings] == ["path-bend"]


def test_the_printed_scenario_is_told_why_it_cannot_track():
    texts = {f.code: f.text for f in preflight(load(CONFIGS / "printed.yaml").scenario)}
    assert set(texts) == {"path-jump", "sway-drift", "sway-unstable", "coupling-saddle"}
    assert "0.56 m/s" in texts["sway-drift"]
    assert "2.58 kg/s exceeds the sway damping 0.89 kg/s" in texts["sway-unstable"]


def test_what_laws_share_is_told_once_and_names_them():
    findings = preflight(load(CONFIGS / "figures_compare.yaml").scenario)
    assert len(findings) == len(set(findings))
    kicks = [(f.runs, f.where) for f in findings if f.code == "start-kick"]
    assert kicks == [(("adaptive_neural", "dsc"), "controller.first_difference")]


# --- underactuation

ACTUATORS = {name: example(kind) for name, kind in kinds("actuators").items()}


@pytest.mark.parametrize("actuator", ACTUATORS)
@pytest.mark.parametrize("hull", VESSELS)
def test_every_hull_is_underactuated_unless_its_actuator_takes_a_sway_force(hull, actuator):
    vessel, drive = VESSELS[hull], ACTUATORS[actuator]
    inertia = np.array(
        [[vessel.m11, 0, 0], [0, vessel.m22, vessel.m23], [0, vessel.m32, vessel.m33]]
    )
    accelerations = np.linalg.solve(inertia, drive.input_matrix())
    rank = 3 if drive.takes_sway else 2
    assert np.linalg.matrix_rank(accelerations) == drive.input_rank() == rank
    text = argument(scene().model_copy(update={"vessel": vessel, "actuator": drive}))
    assert text.startswith("fully actuated: " if drive.takes_sway else "underactuated: ")
    assert f"{actuator} on {hull} is " in text
    assert f"rank {rank} of 3" in text
    assert ("(tau_u, tau_r, tau_v)" in text) == drive.takes_sway


def test_validate_shows_the_argument(podusv):
    said = podusv("validate", "-v", str(CONFIGS / "corrected.yaml"))
    assert "[[1, 0], [0, 0], [0, 1]], rank 2 of 3; its sway row is zero (Y_p = 0)" in said.out
