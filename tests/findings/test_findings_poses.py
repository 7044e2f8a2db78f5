"""Findings about vessels that are asked for a heading and a sway force."""

import numpy as np
import pytest
from conftest import vessel
from pose_samples import BOAT, HELD, POSES, loaded_pose, marched

from podusv_cli.findings.finding import postflight, preflight
from podusv_cli.scenario.reference import reference

LIMITED = BOAT.replace("ideal_full", "saturated_full")


def found(text, *changes):
    """Sentences of the findings before a run, by code."""
    return {f.code: f.text for f in preflight(loaded_pose(text, *changes))}


def test_the_reference_is_the_demand_of_a_run_that_stays_on_the_path():
    """Backstepping asks for M nu' - f(nu) alone once its errors are 0."""
    seen = reference(loaded_pose(BOAT + POSES + HELD))
    log = marched(BOAT + POSES + HELD)
    for place, name in enumerate(("tau_u_cmd", "tau_r_cmd", "tau_v_cmd")):
        asked = np.interp(seen.time, log["time"], log[name])
        np.testing.assert_allclose(seen.demand[:, place], asked, atol=2e-3)
    for place, name in enumerate("uvr"):
        speed = np.interp(seen.time, log["time"], log[name])
        np.testing.assert_allclose(seen.nu[:, place], speed, atol=2e-4)


def test_a_steady_load_is_in_the_reference():
    seen = reference(loaded_pose(BOAT + POSES + HELD, "disturbance={kind: step, b_v: 0.4}"))
    calm = reference(loaded_pose(BOAT + POSES + HELD))
    late = seen.time > 0.0
    np.testing.assert_allclose((calm.demand - seen.demand)[late], [[0.0, 0.0, 0.4]] * late.sum())


def test_a_sway_limit_that_the_way_exceeds_is_told_and_the_run_is_late():
    short, ample = "actuator.sway_limit=0.1", "actuator.sway_limit=9.0"
    told = found(LIMITED + POSES + HELD, short, "actuator.surge_limit=9.0")["thrust-short"]
    assert "a sway force of " in told
    assert "the actuator gives 0.1 N" in told
    assert "thrust-short" not in found(LIMITED + POSES + HELD, ample, "actuator.surge_limit=9.0")
    runs = [
        marched(LIMITED + POSES + HELD, one, "actuator.surge_limit=9.0") for one in (short, ample)
    ]
    assert runs[0]["z_e"].max() > 0.1 > 1e-6 > runs[1]["z_e"].max()


def test_a_load_that_would_drift_any_other_vessel_is_no_finding():
    """The drift of a hull with two demands; one that pushes sideways holds its place."""
    hull = BOAT.replace("cybership2", "paper").replace("kind: none", "kind: step, b_v: 3.0")
    told = found(hull + POSES + HELD, "simulation.duration=30")
    assert not {"sway-drift", "thrust-short"} & set(told)
    log = marched(hull + POSES + HELD, "controller.k_i=0.05", "simulation.duration=200")
    assert log["z_e"][-1] < 1e-3


@pytest.mark.parametrize(("psi", "told"), [(0.2 + np.pi, True), (0.2, False), (3.0, False)])
def test_half_a_turn_is_that_to_the_heading_asked_for(psi, told):
    text = BOAT.replace("psi: 0.2", f"psi: {float(psi)!r}") + POSES + HELD
    sentence = found(text).get("opposite-start", "")
    assert ("opposite to the target's heading" in sentence) == told


def test_a_hull_that_moves_sideways_is_not_told_to_turn_less():
    sideways = "path={kind: poses, poses: [[0, 0, 0], [0, 8, 0]], travel: 20, dwell: 0}"
    changes = (sideways, "start.psi=0.0", "simulation.duration=20")
    single = loaded_pose(BOAT + POSES + HELD, *changes)
    told = {f.code: f.text for f in postflight(single, marched(BOAT + POSES + HELD, *changes))}
    limit = vessel("cybership2").envelope.drift
    assert f"drift angle of up to {limit:.3g} rad" in told["outside-envelope"]
    assert told["outside-envelope"].endswith("; take a vessel that was measured there")
    assert "ask for less" not in told["outside-envelope"]


def test_a_dead_zone_of_the_sway_force_is_held_against_its_limit():
    told = found(LIMITED + POSES + HELD, "actuator.command={dead_zone_v: 2.0}")["dead-zone"]
    assert told.startswith("2 N is not below the 2 N")
    assert "dead-zone" not in found(LIMITED + POSES + HELD, "actuator.command={dead_zone_v: 1.9}")
