"""Findings about signs and units: told where they hold, borne out by simulation."""

import math

import pytest
from conftest import VESSELS
from findings_samples import codes, finding, late, log, scene

from podusv_cli.findings.finding import Case
from podusv_cli.findings.values import damping_sign

CALM = ("disturbance={kind: none}", "simulation.duration=60")


@pytest.mark.parametrize("name", ["X_uu", "X_uuu", "Y_vv", "N_rr"])
def test_damping_that_drives_is_told_at_its_key_once(name):
    case = Case(scene(f"vessel.{name}=1.32"))
    (told,) = damping_sign.findings(case.scenario.controller, case)
    assert (told.code, told.where) == ("damping-sign", f"vessel.{name}")
    assert "-1.32?" in told.text


def test_a_hull_with_damping_of_the_wrong_sign_has_to_be_held_back():
    wrong, right = (*CALM, "vessel.X_uu=8.0"), (*CALM, "vessel.X_uu=-8.0")
    assert "damping-sign" in codes(*wrong)
    assert late("tau_u", *wrong).max() < -0.5
    assert "damping-sign" not in codes(*right)
    assert late("tau_u", *right).min() > 0.5


def test_added_mass_of_the_wrong_sign_makes_the_hull_lighter():
    """From rest, under a constant thrust: less mass, more acceleration."""
    thrust = (*CALM, "controller={kind: turning_circle}")
    wrong, right = (*thrust, "vessel.X_udot=12.0"), (*thrust, "vessel.X_udot=-12.0")
    told = finding("added-mass-sign", *wrong)
    assert told.where == "vessel.X_udot"
    assert "m11 = 11.8 kg" in told.text  # 23.8 - 12
    assert "-12?" in told.text
    assert "added-mass-sign" not in codes(*right)
    speeds = [log(*one)["u"][10] for one in (wrong, right)]
    assert speeds[0] / speeds[1] == pytest.approx(35.8 / 11.8, rel=0.01)


def test_what_the_law_is_told_is_looked_at_too():
    assert finding("damping-sign", "nominal.Y_vv=36.0").where == "nominal.Y_vv"


def test_no_vessel_that_podusv_brings_along_drives_itself():
    for name in VESSELS:
        assert not {"damping-sign", "added-mass-sign"} & codes(f"vessel={{preset: {name}}}")


@pytest.mark.parametrize("key", ["start.psi", "path.course"])
def test_degrees_are_told_and_radians_are_not(key):
    told = finding("large-angle", f"{key}=-90")
    assert told.where == key
    assert "-90 deg is -1.571" in told.text
    assert "large-angle" not in codes(f"{key}={-math.pi / 2}")
    assert "large-angle" not in codes(f"{key}={2 * math.pi}")
