"""What podusv is published with: a description, a recipe, and a word on where it runs."""

from __future__ import annotations

import re
import shlex
import tomllib

import pytest
import yaml
from command_samples import ROOT, Command

from podusv_cli import __version__

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
DESCRIPTION = (ROOT / PROJECT["readme"]).read_text()
CONDA = {"matplotlib": "matplotlib-base"}  # names that differ


def test_the_description_has_no_link_that_only_a_checkout_has() -> None:
    assert re.findall(r"\]\((?!https?://)", DESCRIPTION) == []
    assert "Linux" in DESCRIPTION.partition("pip install")[0]


@pytest.mark.parametrize("page", [DESCRIPTION, (ROOT / "README.md").read_text()])
def test_where_podusv_runs_is_said_beside_how_to_get_it(page: str) -> None:
    before, _, after = page.partition("pip install podusv")
    assert re.search("on linux.* windows.* macos", before, re.I | re.S)
    assert "pipx run podusv" in after
    assert "uvx podusv" in after


def test_the_commands_of_the_description_exist(podusv: Command) -> None:
    shown = re.findall(r"^    podusv ([^#\n]*)", DESCRIPTION, re.M)
    assert len(shown) > 3
    for words in shown:
        assert podusv(shlex.split(words)[0], "--help").code == 0, words


def test_the_recipe_asks_for_what_the_package_needs() -> None:
    recipe = yaml.safe_load((ROOT / "recipe/recipe.yaml").read_text())
    needed = [
        re.sub(r"^[\w-]+", lambda name: CONDA.get(name[0], name[0]), one).replace(">=", " >=")
        for one in PROJECT["dependencies"]
    ]
    assert recipe["requirements"]["run"] == [f"python {PROJECT['requires-python']}", *needed]
    assert recipe["context"]["version"] == __version__
    assert recipe["about"]["summary"] == PROJECT["description"]
    (entry,) = recipe["build"]["python"]["entry_points"]
    assert entry == f"podusv = {PROJECT['scripts']['podusv']}"


@pytest.mark.parametrize("package", ["podusv", "podusv_cli"])
def test_every_file_of_a_package_is_packed(package: str) -> None:
    """Templates and presets, too; the links to rooms beside it are for tests of the wheel."""
    given = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    home = ROOT / package
    packed = {path for text in given["package-data"][package] for path in home.glob(text)}
    links = [path for path in home.iterdir() if path.is_symlink()]
    needed = {
        path
        for path in home.rglob("*")
        if path.is_file()
        and path.suffix not in {".py", ".pyc"}
        and links.count(path) == 0
        and not any(link in path.parents for link in links)
    }
    assert needed - packed <= {ROOT / PROJECT["readme"]}
