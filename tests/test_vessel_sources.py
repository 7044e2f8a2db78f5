"""Presets that follow from a published program, derived again from what that program is given."""

import math
from pathlib import Path

import pytest

from podusv_cli.components.actuators.pod import Pods
from podusv_cli.components.vessels.plant import yaw_moment
from podusv_cli.core.kernel import bundle
from podusv_cli.scenario.load import load
from podusv_cli.scenario.model import Scenario

CONFIGS = Path(__file__).parent.parent / "configs/pod/vessels"
GRAVITY, WATER = 9.81, 1025.0


def scenario_of(name: str) -> Scenario:
    return load(CONFIGS / f"{name}.yaml").scenario


def pods_of(name: str) -> Pods:
    actuator = scenario_of(name).actuator
    assert isinstance(actuator, Pods)
    return actuator


def test_the_otters_hull_is_that_of_the_version_that_its_source_names():
    vessel = scenario_of("otter").vessel
    assert "otter.m of 2026-06-27" in vessel.source
    m, length, ahead = 55.0, 2.0, 0.2
    about_centre = m * (0.25 * length) ** 2
    yaw_inertia = about_centre + m * ahead**2 + 1.7 * about_centre
    derived = {
        "m": m,
        "x_g": ahead,
        "X_udot": -2.7 * WATER * (m / WATER) ** (5 / 3) / length**2,
        "Y_vdot": -1.5 * m,
        "I_z": about_centre + m * ahead**2,
        "N_rdot": -1.7 * about_centre,
        "m33": yaw_inertia,
        "X_u": -24.4 * GRAVITY / (6 * 0.5144),
        "Y_v": -2.5 * m / 1.0,
        "N_r": -yaw_inertia / 1.0,
        "N_rr": -10 * yaw_inertia / 1.0,
    }
    told = {name: getattr(vessel, name) for name in derived}
    assert told == pytest.approx(derived, rel=1e-5)  # the file gives five digits


def test_the_otter_keeps_the_munk_moment_as_its_source_does():
    vessel = scenario_of("otter").vessel
    surge_added = 2.7 * WATER * (55.0 / WATER) ** (5 / 3) / 2.0**2
    munk = (surge_added - 1.5 * 55.0) * 1.2 * 0.3
    assert yaw_moment(1.2, 0.3, 0.0, bundle(vessel.constants())) == pytest.approx(munk, rel=1e-5)


def test_the_otters_gains_are_those_of_its_inertia():
    scenario = scenario_of("otter")
    law, hull = scenario.controller.model_dump(), scenario.vessel
    for axis, inertia in (("u", hull.m11), ("r", hull.m33)):
        assert law[f"k_{axis}e"] == pytest.approx(inertia, rel=0.01)
        assert law[f"Gamma_{axis}"] == pytest.approx(1 / inertia, rel=0.03)
        assert law[f"sigma_{axis}"] == law[f"gamma_{axis}"] == pytest.approx(inertia / 10, rel=0.01)
        assert law[f"sigma_b{axis}"] == law[f"Gamma_{axis}"]


def test_the_otters_propellers_are_those_of_its_source_in_turns_a_second():
    for pod in pods_of("otter").pods:
        for per_radian, weight, T_nn, n_max in (
            (0.02216 / 2, 24.4 / 2, pod.T_nn, pod.n_max),
            (0.01289 / 2, 13.6 / 2, pod.T_nn_astern, pod.n_max_astern),
        ):
            assert T_nn == pytest.approx(per_radian * math.tau**2, rel=1e-5)
            fastest = math.sqrt(weight * GRAVITY / per_radian)
            assert n_max == pytest.approx(fastest / math.tau, rel=5e-4)


def test_the_wamvs_thrust_is_its_sources_in_newtons_and_goes_with_the_square_of_speed():
    speed = 7.71667
    ahead = (51.3 + 72.4 * speed) * speed / 2
    for pod in pods_of("wamv").pods:
        assert pod.T_nn * pod.n_max**2 == pytest.approx(ahead, rel=1e-4)
        assert pod.T_nn_astern == pod.T_nn
        astern = pod.T_nn_astern * pod.n_max_astern**2
        assert astern == pytest.approx(1000.0, rel=1e-3)  # Gazebo's, where no limit is set


def test_the_wamvs_file_tells_its_source_from_podusvs_assumptions():
    actuator = pods_of("wamv")
    assert "takes newtons" in " ".join(actuator.source.split())
    source, validity = actuator.source, actuator.validity.partition("podusv's assumptions:")
    assert "90 deg" not in source
    assert all(word in validity[2] for word in ("parts of full speed", "90 deg", "lags"))
