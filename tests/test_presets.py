"""The paper's presets, run as a user runs them, against what docs/model.md says of them."""

import json
from pathlib import Path

import numpy as np
import pytest

from podusv_cli.storage.run_folder import open_run
from podusv_cli.workflows import run as running

CONFIGS = Path(__file__).parent.parent / "configs"
PRESETS = ("printed", "printed_from_zero", "figures", "corrected")


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    root = tmp_path_factory.mktemp("runs")
    request = {name: running.Request(out=root / name, figures=False) for name in PRESETS}
    return {name: running.run(CONFIGS / f"paper/{name}.yaml", request[name]) for name in PRESETS}


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
    assert running.run(CONFIGS / "paper/figures.yaml", request).status == "diverged"


def test_a_run_folder_has_what_is_promised(runs):
    folder = runs["corrected"].folder
    promised = {
        "scenario.yaml", "resolved.yaml", "log.h5", "metrics.json", "metrics.csv",
        "provenance.json", "manifest.json",
    }  # fmt: skip
    assert promised <= {path.name for path in folder.iterdir()}
    assert (folder / "scenario.yaml").read_text() == (CONFIGS / "paper/corrected.yaml").read_text()
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
