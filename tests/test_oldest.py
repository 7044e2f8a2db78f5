"""The lower bounds in pyproject.toml are those that `make test-oldest` installs."""

import subprocess
import tomllib

from command_samples import ROOT


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
    assert pins.split() == [bound.replace(">=", "==") for bound in project["dependencies"]]
