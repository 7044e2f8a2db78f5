"""The paper's presets, run as a user runs them, against what docs/model.md says of them."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from podusv_cli.components.actuators.pod import Pods
from podusv_cli.components.vessels.plant import yaw_moment
from podusv_cli.core.kernel import bundle
from podusv_cli.scenario.load import load
from podusv_cli.scenario.model import Scenario
from podusv_cli.storage.run_folder import open_run
from podusv_cli.workflows import run as running

CONFIGS = Path(__file__).parents[2] / "configs"
PRESETS = ("printed", "printed_from_zero", "figures", "corrected")


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    root = tmp_path_factory.mktemp("runs")
    request = {name: running.Request(out=root / name, figures=False) for name in PRESETS}
    return {name: running.run(CONFIGS / f"mu_2017/{name}.yaml", request[name]) for name in PRESETS}


def test_figures_recovers_the_papers_peaks(runs):
    metrics = runs["figures"].metrics
    assert 300 <= metrics["peak_tau_u"] <= 320
    assert 1050 <= metrics["peak_tau_r"] <= 1100
    assert 0.5 <= metrics["z_e_steady"] <= 0.6


def test_the_offset_of_figures_is_the_filters(runs):
    """A gain B/(A + |alpha|) below 1 leaves k_ze z_e undelivered."""
    log = open_run(runs["figures"].folder).recording
    steady = log["time"] >= 248
    alpha, beta = log["alpha_u"][steady], log["beta_u"][steady]
    assert np.mean(beta) == pytest.approx(np.mean(5.0 * alpha / (5.0 + alpha)), rel=1e-3)
    assert np.mean(alpha - beta) == pytest.approx(
        0.1 * runs["figures"].metrics["z_e_steady"], rel=0.05
    )


def test_corrected_holds_its_standoff_within_its_limits(runs):
    log = open_run(runs["corrected"].folder).recording
    assert np.abs(log["tau_u"]).max() <= 8.0
    assert np.abs(log["tau_r"]).max() <= 2.5
    assert np.abs(log["z_e"][log["time"] >= 248] - 0.5).max() < 0.05


def test_printed_orbits_and_never_tracks(runs):
    log = open_run(runs["printed"].folder).recording
    z_e = log["z_e"][log["time"] >= 155]
    assert runs["printed"].status == "finished"
    assert 1.3 < z_e.min() < z_e.max() < 2.7
    bearing = np.unwrap(log["psi_d"][log["time"] >= 155])
    assert abs(bearing[-1] - bearing[0]) > 2 * np.pi


def test_printed_from_zero_diverges_at_once_and_is_kept(runs):
    done = runs["printed_from_zero"]
    assert done.status == "diverged"
    assert done.message.startswith("diverged at t = 0.08 s: ")
    log = open_run(done.folder).recording
    assert len(log["time"]) == 8
    assert all(np.isfinite(log[name]).all() for name in ("x", "u", "tau_u_cmd", "W_hat_u"))


def test_the_printed_bound_does_not_recover_the_peaks(tmp_path):
    adaptive = ("controller.B_u=adaptive", "controller.B_r=adaptive", "simulation.duration=1")
    request = running.Request(adaptive, tmp_path / "run", figures=False)
    assert running.run(CONFIGS / "mu_2017/figures.yaml", request).status == "diverged"


def test_a_run_folder_has_what_is_promised(runs):
    folder = runs["corrected"].folder
    promised = {
        "scenario.yaml",
        "resolved.yaml",
        "log.h5",
        "metrics.json",
        "metrics.csv",
        "provenance.json",
        "manifest.json",
    }
    assert promised <= {path.name for path in folder.iterdir()}
    assert (folder / "scenario.yaml").read_text() == (
        CONFIGS / "mu_2017/corrected.yaml"
    ).read_text()
    metrics = json.loads((folder / "metrics.json").read_text())
    assert metrics["status"] == "finished"
    assert metrics["metrics"]["iae"] == runs["corrected"].metrics["iae"]


@pytest.mark.parametrize("name", ["corrected", "printed_from_zero"])
def test_the_table_of_metrics_has_every_digit(runs, name):
    lines = (runs[name].folder / "metrics.csv").read_text().splitlines()
    told = {metric: float(number) for metric, number, _ in (line.split(",") for line in lines[1:])}
    assert told == pytest.approx(runs[name].metrics, rel=0, abs=0, nan_ok=True)


def test_a_vessel_of_ones_own_settles_where_its_thrust_is_its_drag(tmp_path):
    request = running.Request(out=tmp_path / "own", figures=False)
    done = running.run(CONFIGS / "own_vessel.yaml", request)
    run = open_run(done.folder)
    assert 'preset: ""' in run.resolved_yaml
    assert run.recording["u"][-1] == pytest.approx(0.8, rel=1e-3)
    assert run.recording["tau_u"][-1] == pytest.approx(20.0 * 0.8 + 15.0 * 0.8**2, rel=1e-2)
    assert run.recording["z_e"][-1] == pytest.approx(0.5, abs=0.01)


# --- presets that follow from a published program, derived again from what that program is given

POD_VESSELS = Path(__file__).parents[2] / "configs/pod/vessels"
GRAVITY, WATER = 9.81, 1025.0


def scenario_of(name: str) -> Scenario:
    return load(POD_VESSELS / f"{name}.yaml").scenario


def pods_of(name: str) -> Pods:
    actuator = scenario_of(name).actuator
    assert isinstance(actuator, Pods)
    return actuator


def fitted_drag():
    """Y_vv, Y_rv, N_vr, N_rr by least squares of MSS's cross-flow drag: 21 strips of L/20.

    Draught from 55 kg on two pontoons of 0.25 m with a block coefficient of 0.4; the coefficient
    between two points of Hoerner's curve over beam / (2 draught).
    """
    pontoon = 0.25
    draught = 55.0 / WATER / (2 * 0.4 * pontoon * 2.0)
    C_d = np.interp(pontoon / (2 * draught), [0.833589, 0.988002], [0.87959, 0.828415])
    strips, width = np.linspace(-1.0, 1.0, 21), 2.0 / 20
    v, r = (a.ravel() for a in np.meshgrid(np.linspace(-0.5, 0.5, 41), np.linspace(-0.6, 0.6, 41)))
    across = v[:, None] + r[:, None] * strips
    force = -0.5 * WATER * draught * C_d * np.abs(across) * across * width
    sway = np.linalg.lstsq(np.column_stack([abs(v) * v, abs(r) * v]), force.sum(1), rcond=None)
    yaw = np.linalg.lstsq(np.column_stack([abs(v) * r, abs(r) * r]), force @ strips, rcond=None)
    return *sway[0], *yaw[0]


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
    }
    drag = dict(zip(("Y_vv", "Y_rv", "N_vr", "N_rr"), fitted_drag(), strict=True))
    drag["N_rr"] -= 10 * yaw_inertia / 1.0
    derived |= drag
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
