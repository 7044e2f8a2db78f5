"""`make reproduce` and `make pod`: a line a step, and a checkout that stays as it was committed."""

import os
import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest
from command_samples import ROOT, TWO, Command, commanded, write
from old_results import draw_quickly

SAYS = """
claims:
  near: {says: Soft tracks worse., source: nobody, expect: soft.iae > stiff.iae}
  cheap: {says: Soft is cheap., source: nobody, expect: soft.law_ns < 1e9}
"""
FIGURES = ("trajectory", "errors", "controls")
# In place of podusv: writes what a comparison leaves, talks much, and ends as the name says.
STUB = """#!/bin/sh
echo "walls of 2.118e+93" >&2
test "$1 $3 $4 $7" = "compare --figure all --force" || exit 9
mkdir -p "$6" && echo new > "$6/comparison.csv" && echo {} > "$6/manifest.json"
case $2 in *figures*) exit 3;; esac
exit 0
"""


KEPT = ("comparison.csv", "claims.json", *(f"figures/{n}.png" for n in FIGURES))


@pytest.mark.long
def test_what_is_committed_of_a_comparison_comes_out_the_same_every_time(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    podusv: Command = commanded(monkeypatch, capsys)
    write("two.yaml", TWO + SAYS)
    draw_quickly(monkeypatch)
    for folder in ("first", "second"):
        assert podusv("compare", "two.yaml", "--figure", "all", "--out", folder).code == 0
    for name in KEPT:
        assert Path("first", name).read_bytes() == Path("second", name).read_bytes()


def test_of_a_comparison_only_what_cannot_be_derived_is_committed():
    listed = ["git", "ls-files", "results/mu_2017", "results/pod", "results/sea"]
    told = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    names = {Path(path).name for path in told.splitlines() if path.count("/") > 2}
    assert names <= set(map(os.path.basename, KEPT))


def test_git_tracks_nothing_that_it_would_not_keep():
    listed = ["git", "ls-files", "--cached", "--ignored", "--exclude-standard"]
    told = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True)
    assert told.stdout == ""


@pytest.fixture
def checkout(tmp_path):
    """A checkout with a committed result and a stub of podusv."""
    (tmp_path / "results/mu_2017/one").mkdir(parents=True)
    (tmp_path / "results/mu_2017/one/comparison.csv").write_text("old\n")
    shutil.copy(ROOT / "examples/reproduce/step.sh", tmp_path / "step.sh")
    (tmp_path / "podusv").write_text(STUB)
    (tmp_path / "podusv").chmod(0o755)
    return tmp_path


def step(checkout: Path, name: str, code: int) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["./step.sh", "compare", "mu_2017", name, str(code)],
        cwd=checkout,
        text=True,
        capture_output=True,
        env={**os.environ, "PODUSV": "./podusv"},
    )


def test_a_step_is_a_line_with_its_time_and_the_rest_is_in_a_file(checkout):
    done = step(checkout, "one", 0)
    assert (done.returncode, done.stderr) == (0, "")
    assert re.fullmatch(r"  one +\d+ s  done\n", done.stdout)
    assert "2.118e+93" in (checkout / "results/mu_2017.log").read_text()
    diverged = step(checkout, "figures", 3)
    assert re.fullmatch(r"  figures +\d+ s  done, some runs .* as expected\n", diverged.stdout)


def test_a_step_that_ends_otherwise_stops_and_shows_why(checkout):
    done = step(checkout, "figures", 0)
    assert done.returncode == 1
    assert "exit code 3 in place of 0" in done.stdout
    assert "2.118e+93" in done.stdout
    assert (checkout / "results/mu_2017/one/comparison.csv").read_text() == "old\n"


def test_a_step_replaces_committed_files_and_adds_none(checkout):
    place = checkout / "results/mu_2017/one"
    (place / "mine.txt").write_text("mine\n")
    for _ in range(2):
        assert step(checkout, "one", 0).returncode == 0
        found = {path.name: path.read_text() for path in place.iterdir()}
        assert found == {"comparison.csv": "new\n", "mine.txt": "mine\n"}


# --- the lower bounds in pyproject.toml are those that `make test-oldest` installs


def said(command: str) -> str:
    """What a shell command prints, at the top of the checkout."""
    return subprocess.run(
        command, shell=True, cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout


def test_the_oldest_set_has_every_dependency_at_its_lower_bound():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    shown = said("make --dry-run test-oldest")
    listing = shown[shown.index("sed ") : shown.index("pyproject.toml")] + "pyproject.toml"
    pins = said(listing)
    lowest = [re.sub(",.*", "", bound) for bound in project["dependencies"]]
    assert pins.split() == [bound.replace(">=", "==") for bound in lowest]
