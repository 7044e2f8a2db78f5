"""Where a result comes from."""

import os
import subprocess
import sys
from datetime import UTC, datetime, timedelta, timezone
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import h5py
import numba
import numpy as np
import pydantic
import pytest
import scipy

import podusv_cli
from podusv_cli.storage import json_files, provenance

STARTED = datetime(2026, 3, 1, 12, 0, 0, 250_000, tzinfo=timezone(timedelta(hours=2)))
FINISHED = datetime(2026, 3, 1, 10, 0, 3, tzinfo=UTC)


def test_versions_platform_command_and_times():
    found = provenance.collect(["podusv", "run", "a.yaml"], STARTED, FINISHED)
    assert found["podusv"] == podusv_cli.__version__
    assert found["python"] == ".".join(map(str, sys.version_info[:3]))
    assert found["packages"] == {
        "numpy": np.__version__, "scipy": scipy.__version__, "numba": numba.__version__,
        "h5py": h5py.__version__, "pydantic": pydantic.VERSION,
    }  # fmt: skip
    system = os.uname()
    expected = {"system": system.sysname, "release": system.release, "machine": system.machine}
    assert expected.items() <= found["platform"].items()
    assert set(found["platform"]) - set(expected) == {"processor", "libc"}
    assert found["argv"] == ["podusv", "run", "a.yaml"]
    assert found["started"] == "2026-03-01T10:00:00.250+00:00"
    assert found["finished"] == "2026-03-01T10:00:03.000+00:00"
    assert found["duration_s"] == 2.75
    assert json_files.encode(found)


def test_a_package_that_is_not_installed_has_no_version(monkeypatch):
    def version(name: str) -> str:
        raise PackageNotFoundError(name)

    monkeypatch.setattr(provenance, "version", version)
    found = provenance.collect([], STARTED, FINISHED)
    assert set(found["packages"].values()) == {None}


def git(folder: Path, *words: str) -> str:
    options = ["-c", "user.name=a", "-c", "user.email=a@example.org", "-c", "commit.gpgsign=false"]
    command = ["git", "-C", str(folder), *options, *words]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


@pytest.fixture
def package(tmp_path):
    """A package in a checkout of its own, with everything committed."""
    place = tmp_path / "checkout" / "package"
    place.mkdir(parents=True)
    (place / "__init__.py").write_text("")
    (place.parent / ".gitignore").write_text(".venv\n__pycache__\n")
    git(place.parent, "init", "--quiet")
    git(place.parent, "add", ".")
    git(place.parent, "commit", "--quiet", "--message", "first")
    return place


def test_a_checkout_is_known_by_its_commit(package):
    commit = git(package, "rev-parse", "HEAD")
    assert provenance.source_tree(package) == {"commit": commit, "dirty": False}


@pytest.mark.parametrize(
    ("changed", "dirty"),
    [
        ("__init__.py", True),
        ("new_law.py", True),  # components are found by being there
        ("__pycache__", False),
        ("../results.txt", False),
    ],
)
def test_only_what_changes_the_package_makes_it_dirty(package, changed, dirty):
    (package / changed).write_text("changed")
    found = provenance.source_tree(package)
    assert found is not None
    assert found["dirty"] is dirty


def test_a_package_installed_below_another_checkout_is_no_part_of_it(package):
    installed = package.parent / ".venv" / "package"
    installed.mkdir(parents=True)
    (installed / "__init__.py").write_text("")
    assert provenance.source_tree(installed) is None


def test_outside_of_any_checkout(tmp_path):
    (tmp_path / "__init__.py").write_text("")
    assert provenance.source_tree(tmp_path) is None


def test_without_git(package, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert provenance.source_tree(package) is None


def test_inside_a_hook_of_another_checkout(package, tmp_path, monkeypatch):
    expected = provenance.source_tree(package)
    git(tmp_path, "init", "--quiet", "other")
    monkeypatch.setenv("GIT_DIR", str(tmp_path / "other" / ".git"))
    assert expected is not None
    assert provenance.source_tree(package) == expected


@pytest.mark.skipif(sys.platform != "linux", reason="asks what the GNU C library says of itself")
def test_processor_and_c_library_are_told():
    found = provenance.collect([], STARTED, FINISHED)["platform"]
    assert found["processor"] is None or found["processor"] in Path("/proc/cpuinfo").read_text()
    assert found["libc"] == os.confstr("CS_GNU_LIBC_VERSION")
