"""What a release consists of, an sdist and the wheel that is built from it, used elsewhere."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import tarfile
from email import message_from_bytes
from pathlib import Path
from zipfile import ZipFile

import numpy
import pytest
from command_samples import ROOT
from installed_sample import LAB

from podusv_cli import __version__
from podusv_cli.cli import FIRST_STEPS
from podusv_cli.scenario import shipped
from podusv_cli.workflows.examples import examples, texts

pytestmark = pytest.mark.slow  # builds packages, and an environment compiles anew
PACKAGES = ("podusv", "podusv_cli")
ROOMS = ("configs", "docs", "results", "examples")
NEEDED = ("pyproject.toml", "setup.py", "README.md", "LICENSE", *PACKAGES, *ROOMS)
BUILD = "import sys; from setuptools import build_meta; build_meta.build_{}(sys.argv[1])"


def said(*words: object, cwd: Path, **more: str) -> str:
    """What a process prints, which has to end well."""
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    done = subprocess.run(
        [str(word) for word in words],
        cwd=cwd,
        env=environment | more,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def build(what: str, source: Path, into: Path) -> Path:
    """The sdist or wheel of a copy of some source, so that the source stays as it is."""
    copy, before = into / f"{what} of {source.name}", set(into.iterdir())
    shutil.copytree(source, copy, symlinks=True, ignore=unneeded)
    said(sys.executable, "-c", BUILD.format(what), into, cwd=copy)
    (made,) = (path for path in set(into.iterdir()) - before if path.is_file())
    return made


def unneeded(folder: str, names: list[str]) -> set[str]:
    """Compiled code; at the top of the checkout, all that no package is made of."""
    return {*names} - {*NEEDED} if Path(folder) == ROOT else {*names} & {"__pycache__"}


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, Path]:
    """The sdist of podusv, the wheel that is made of it, and the wheel of my_lab's sdist."""
    pytest.importorskip("setuptools", "77", "building a wheel needs setuptools 77 or newer")
    folder = tmp_path_factory.mktemp("packages")
    sdist = build("sdist", ROOT, folder)
    made = [build("wheel", unpacked(one), folder) for one in (sdist, build("sdist", LAB, folder))]
    return sdist, *made


def unpacked(sdist: Path) -> Path:
    """The folder in an sdist."""
    folder = sdist.with_suffix(".unpacked")
    with tarfile.open(sdist) as archive:
        archive.extractall(folder, filter="data")
    (inside,) = folder.iterdir()
    return inside


@pytest.fixture(scope="module")
def python(packages: tuple[Path, Path, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment with nothing but the two wheels, and what they need as it is here."""
    folder = tmp_path_factory.mktemp("environment")
    said(sys.executable, "-m", "venv", "--without-pip", folder, cwd=folder)
    pip = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet")
    python = folder / "bin/python"
    said(*pip, "--python", python, "install", "--no-deps", "--no-index", *packages[1:], cwd=folder)
    (site,) = folder.glob("lib/python*/site-packages")
    (site / "needed.pth").write_text(f"{Path(numpy.__file__).parents[1]}\n")
    return python


@pytest.fixture
def empty(tmp_path: Path):
    """An empty folder."""
    folder = tmp_path / "empty"
    folder.mkdir()
    return folder


def test_the_wheel_has_metadata_types_licence_and_scenarios(
    packages: tuple[Path, Path, Path],
) -> None:
    wheel = ZipFile(packages[1])
    info = f"podusv-{__version__}.dist-info"
    about = message_from_bytes(wheel.read(f"{info}/METADATA"))
    assert (about["Name"], about["Version"]) == ("podusv", __version__)
    assert (about["Requires-Python"], about["License-Expression"]) == (">=3.11", "MIT")
    assert about["Description-Content-Type"] == "text/markdown"
    assert about["Author"] == "podusv contributors"
    assert about.get_payload() == (ROOT / "podusv/README.md").read_text()
    names = {*wheel.namelist()}
    typed = {f"{name}/py.typed" for name in PACKAGES}
    assert {*typed, "podusv/__init__.pyi", f"{info}/licenses/LICENSE"} <= names
    assert {name.split("/")[0] for name in names} == {*PACKAGES, info}
    configs = {path.relative_to(ROOT).as_posix() for path in (ROOT / "configs").rglob("*.yaml")}
    assert {f"podusv_cli/{name}" for name in configs} <= names
    pages = {
        f"{room}/{path.name}"
        for room in ("docs", "docs/laws", "results")
        for path in (ROOT / room).glob("*.md")
    }
    assert {f"podusv_cli/{name}" for name in (*pages, "docs/index.rst")} <= names
    shown = {f"podusv_cli/examples/{place}" for name in examples() for place in texts(name)}
    assert {name for name in names if name.startswith("podusv_cli/examples/")} == shown
    assert not {
        name for name in names if name.startswith("podusv_cli/docs/") and name.endswith(".py")
    }


def test_the_wheel_alone_starts_from_an_empty_folder(python: Path, empty: Path) -> None:
    def podusv(words: str) -> str:
        return said(python.with_name("podusv"), *shlex.split(words), cwd=empty)

    where = said(python, "-c", "import podusv; print(podusv.__file__)", cwd=empty)
    assert Path(where).is_relative_to(python.parents[1])
    names = "from podusv_cli.scenario import shipped; print(*shipped.names())"
    assert said(python, "-c", names, cwd=empty).split() == list(shipped.names())
    assert podusv("") == f"{FIRST_STEPS}\n"
    assert "\nmu_2017/corrected\n" in podusv("init")
    assert said(python, "-m", "podusv", "--version", cwd=empty) == f"podusv {__version__}\n"
    assert "open this page in a browser: " in podusv("demo --no-browser --out demo")
    assert podusv("docs resume").startswith("podusv docs studies  Resume a study")
    assert podusv("docs results/README").startswith("# What was found\n")
    assert podusv("init mu_2017/corrected").endswith("next: podusv run corrected.yaml\n")
    assert podusv("init example/first_run").endswith("next: jupyter notebook first_run.ipynb\n")
    short = "--set simulation.duration=2"
    assert "adaptive_neural finished: " in podusv(f"run corrected.yaml {short}")
    assert "report: " in podusv(f"compare podusv:theory/sign.yaml {short}")
    assert len(list(empty.glob("results/*/*/report.html"))) == 1


def test_my_lab_is_a_package_of_its_own(python: Path, empty: Path) -> None:
    shutil.copy(LAB / "scenario.yaml", empty)
    assert "\n  los" in said(python.with_name("podusv"), "list", cwd=empty)
    words = ("compare", "scenario.yaml", "--set", "simulation.duration=2", "--out", "c")
    assert "report: c/report.html" in said(python.with_name("podusv"), *words, cwd=empty)
    shutil.copytree(LAB / "tests", empty / "tests")
    asked = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "tests")
    assert "14 passed" in said(python, *asked, cwd=empty, PYTHONSAFEPATH="1")
