"""`examples/my_lab`, installed: its law, path, vessel, metric and figure are found."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from command_samples import ROOT
from installed_sample import LAB, install


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with the package installed in `site`, and its scenario compared in `c`."""
    folder = tmp_path_factory.mktemp("lab")
    install(folder / "site")
    text = (LAB / "scenario.yaml").read_text().replace("duration: 20.0", "duration: 5.0")
    text = text.replace(", pid: {kind: pid}", "")  # not of the package
    (folder / "a.yaml").write_text(text)
    podusv(folder, "compare", "a.yaml", "--out", "c", "--figure", "track_error")
    return folder


def podusv(place: Path, *words: str, code: int = 0) -> str:
    """What a command prints where the package is installed."""
    done = subprocess.run(
        [sys.executable, "-m", "podusv_cli", *words], cwd=place, capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": f"{place / 'site'}:{ROOT}", "COLUMNS": "100"},
        timeout=300,
    )  # fmt: skip
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout + done.stderr


def test_a_comparison_has_its_law_path_vessel_metric_and_figure(place):
    rows = (place / "c/comparison.csv").read_text().splitlines()
    assert any(row.startswith("largest_east,m,") for row in rows)
    (claim,) = json.loads((place / "c/claims.json").read_text())["claims"]
    assert claim["verdict"] in ("reproduced", "not reproduced")
    assert (place / "c/figures/track_error.png").exists()
    assert "largest |y|, east or west" in (place / "c/report.html").read_text()
    (own,) = json.loads((place / "c/los/provenance.json").read_text())["plugins"]
    named = yaml.safe_load((place / "c/los/resolved.yaml").read_text())["plugins"]
    assert named == {"my-lab": {"version": "1.0", "sha256": own["sha256"]}}
    assert own["package"] == "my-lab"


@pytest.mark.slow
def test_commands_list_explain_and_draw_it(place):
    listed = podusv(place, "list")
    for name in ("los", "lawn", "skiff", "largest_east"):
        assert f"\n  {name}" in listed
    assert "a number > 0 [m], default 3.0" in podusv(place, "explain", "lookahead")
    assert "cross-track error" in podusv(place, "explain", "e_y")
    assert "identical" in podusv(place, "rerun", "c/los")


@pytest.mark.slow
def test_another_state_of_the_package_is_not_taken_for_the_one_that_was_used(place):
    law = place / "site/my_lab/los.py"
    text = law.read_text()
    law.write_text(text + "\n")
    try:
        assert "my-lab 1.0 is not the one that was used" in podusv(place, "rerun", "c/los", code=2)
        podusv(place, "plot", "c/los", "--figure", "track_error", "--out", "q")
    finally:
        law.write_text(text)


@pytest.mark.slow
def test_its_runs_are_looked_at_where_it_is_not_installed(place, podusv):
    assert podusv("plot", place / "c", "--figure", "errors", "--out", "p").code == 0
    said = podusv("compare", place / "c/los", place / "c/far", "--out", "d", "--no-figures")
    assert said.code == 0
    assert "largest_east" in said.out
    said = podusv("diff", place / "c/los", place / "c/far")
    assert "controller.lookahead 3.0 -> 8.0" in said.out
    said = podusv("rerun", place / "c/los")
    assert said.code == 2
    assert "'my-lab' is no file (these end in .py) and no installed package" in said.err


def test_a_package_that_cannot_be_imported_is_named(place):
    figure = place / "site/my_lab/los.py"
    text = figure.read_text()
    figure.write_text("import no_such_module\n")
    try:
        said = podusv(place, "validate", "a.yaml", code=2)
    finally:
        figure.write_text(text)
    assert "installed package my-lab 1.0: entry point los = my_lab.los cannot be imported" in said
    assert "bug" not in said
