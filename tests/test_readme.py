"""The README's scenarios track, ask for what the actuator has, and converge."""

from __future__ import annotations

import json
import textwrap
from pathlib import Path

import numpy as np
import pytest
from command_samples import ROOT, Command, commanded, write

from podusv_cli.storage.run_folder import open_run

MOST = 10.0  # N m; four times what the actuator of both scenarios has


def blocks() -> list[str]:
    """The indented blocks of the README that are scenarios."""
    parts = (ROOT / "README.md").read_text().split("\n\n")
    indented = (part for part in parts if part.startswith("    extends: "))
    return [textwrap.dedent(part) + "\n" for part in indented]


@pytest.fixture
def podusv(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Command:
    """The command line in a folder that has the README's two scenarios beside the configs."""
    monkeypatch.chdir(tmp_path)
    Path("configs").symlink_to(ROOT / "configs")
    for name, text in zip(("mine.yaml", "three.yaml"), blocks(), strict=True):
        write(name, text)
    return commanded(monkeypatch, capsys)


def test_the_first_scenario_follows_ahead_and_asks_for_what_there_is(podusv: Command) -> None:
    said = podusv("run", "mine.yaml", "--out", "x", "--no-figures")
    assert said.code == 0
    assert [line.split(":")[0] for line in said.err.splitlines()] == ["warning[saturated]"]
    run = open_run(Path("x"))
    late = run.recording["time"] > 90.0
    assert run.recording["u"][late].min() > 0.4
    assert np.abs(run.recording["z_e"][late] - 0.5).max() < 0.05
    assert run.metrics["peak_tau_r"] < MOST


def test_the_first_scenario_takes_what_the_readme_sets(podusv: Command) -> None:
    options = ("--set", "controller.K_Pu=60", "--set", "simulation.duration=60")
    assert podusv("run", "mine.yaml", *options, "--out", "x", "--no-figures").code == 0
    assert podusv("validate", "-v", "mine.yaml").code == 0


def test_the_first_scenarios_numbers_are_converged(podusv: Command) -> None:
    said = podusv("verify", "mine.yaml")
    assert said.code == 0
    assert "not converged" not in said.out
    assert said.out.endswith("converged within 0.01 relative\n")


def test_the_second_example_rewards_no_absurd_demand(podusv: Command) -> None:
    said = podusv("compare", "three.yaml", "--out", "x", "--no-figures", "--json")
    assert said.code == 0
    found = json.loads(said.out)
    assert max(run["metrics"]["peak_tau_r"] for run in found["runs"]) < MOST
    assert {claim["verdict"] for claim in found["claims"]} == {"reproduced"}
    assert "near-target" not in said.err


@pytest.mark.slow  # nine runs of 310 s
def test_the_second_examples_numbers_are_converged(podusv: Command) -> None:
    said = podusv("verify", "three.yaml")
    assert said.code == 0, said.out
