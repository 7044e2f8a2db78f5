"""The manifest: what "finished" means, and JSON as podusv writes it."""

import hashlib
import json
import math
import os
import subprocess
import sys
from collections.abc import Callable
from datetime import UTC, datetime, timedelta, timezone
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from typing import Any

import h5py
import numba
import numpy as np
import pydantic
import pytest
import scipy

import podusv_cli
from podusv_cli.core import json_text
from podusv_cli.core.errors import StorageError
from podusv_cli.storage import json_files, manifest, provenance
from podusv_cli.storage.files import LARGEST_FILE

FILES = {"log.h5": b"numbers", "figures/path.png": b"picture", "metrics.csv": b""}


@pytest.fixture
def folder(tmp_path):
    """A finished folder."""
    place = tmp_path / "run"
    for name, content in FILES.items():
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_bytes(content)
    manifest.write(place, "diverged")
    return place


def rewrite(folder: Path, change: Callable[[dict[str, Any]], object]) -> None:
    path = folder / "manifest.json"
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))


def test_it_lists_every_file_in_order(folder):
    assert json.loads((folder / "manifest.json").read_text()) == {
        "podusv_format": 2,
        "status": "diverged",
        "files": {
            name: {"sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)}
            for name, content in sorted(FILES.items())
        },
    }
    assert list(manifest.check(folder).files) == sorted(FILES)


@pytest.mark.parametrize("name", FILES)
def test_a_missing_file_is_named(folder, name):
    (folder / name).unlink()
    with pytest.raises(StorageError, match=f"{name} is missing"):
        manifest.check(folder)


@pytest.mark.parametrize(
    ("name", "content"),
    [("log.h5", b"numberS"), ("log.h5", b"numbers "), ("log.h5", b""), ("metrics.csv", b"1")],
)
def test_an_altered_file_is_named(folder, name, content):
    (folder / name).write_bytes(content)
    with pytest.raises(StorageError, match=f"{name} was altered"):
        manifest.check(folder)


def test_a_file_that_claims_to_be_beyond_all_measure_is_not_read(folder):
    rewrite(folder, lambda content: content["files"]["log.h5"].update(bytes=LARGEST_FILE + 1))
    with pytest.raises(StorageError, match=r"log\.h5: .* at most .* read it with h5py or xarray"):
        manifest.check(folder)


def test_the_first_fault_in_order_of_names_is_told(folder):
    (folder / "metrics.csv").write_text("altered")
    (folder / "figures/path.png").unlink()
    with pytest.raises(StorageError, match=r"figures/path\.png is missing"):
        manifest.check(folder)


def test_files_of_others_are_allowed_and_told(folder):
    (folder / "notes.txt").write_text("good run")
    (folder / "figures/mine.png").touch()
    (folder / "latest").symlink_to(folder)
    contents = manifest.check(folder)
    assert manifest.foreign(folder, contents) == ["figures/mine.png", "latest", "notes.txt"]


@pytest.mark.parametrize(
    "name", ["../secret", "figures/../../secret", "", ".", "a//b", "./a", "a/", "a\0b"]
)
def test_names_that_leave_the_folder_are_refused(folder, name):
    (folder.parent / "secret").write_bytes(b"numbers")
    rewrite(folder, lambda it: it["files"].update({name: it["files"]["log.h5"]}))
    with pytest.raises(StorageError, match=r"is no file of this folder|do not show"):
        manifest.check(folder)


def test_links_are_not_followed(folder):
    secret = folder.parent / "secret"
    secret.mkdir()
    (secret / "log.h5").write_bytes(FILES["log.h5"])
    (folder / "log.h5").unlink()
    (folder / "log.h5").symlink_to(secret / "log.h5")
    with pytest.raises(StorageError, match=r"log\.h5"):
        manifest.check(folder)
    with pytest.raises(StorageError, match="symbolic link"):
        manifest.write(folder, "finished")
    (folder / "log.h5").unlink()
    (folder / "inner").symlink_to(secret)
    rewrite(folder, lambda it: it["files"].update({"inner/log.h5": it["files"].pop("log.h5")}))
    with pytest.raises(StorageError, match="leads through a link"):
        manifest.check(folder)


def test_a_folder_reached_through_a_link_is_itself(folder):
    link = folder.with_name("latest")
    link.symlink_to(folder)
    assert manifest.check(link) == manifest.check(folder)


ENTRY = {"sha256": "0" * 64, "bytes": 1}
BROKEN = {
    "other format": (lambda it: it.update(podusv_format=3), "format 3; this podusv reads format 2"),
    "no status": (lambda it: it.pop("status"), "status: Field required"),
    "list of files": (lambda it: it.update(files=["log.h5"]), "files"),
    "unknown key": (lambda it: it.update(author="me"), "author"),
    "short sum": (lambda it: it["files"].update(a=ENTRY | {"sha256": "0"}), r"files\.a\.sha256"),
    "negative size": (lambda it: it["files"].update(a=ENTRY | {"bytes": -1}), r"files\.a\.bytes"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_manifest_of_another_shape_is_refused(folder, case):
    change, words = BROKEN[case]
    rewrite(folder, change)
    with pytest.raises(StorageError, match=words) as caught:
        manifest.check(folder)
    assert str(folder / "manifest.json") in str(caught.value)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "not valid JSON"),
        (b'{"podusv_format": 1', "not valid JSON"),
        (b"[" * 100_000, "not valid JSON"),
        (b"[1, 2]", "no JSON object"),
        (b'"\xff"', "not UTF-8"),
    ],
)
def test_a_manifest_that_is_no_json_object_is_refused(folder, content, words):
    (folder / "manifest.json").write_bytes(content)
    with pytest.raises(StorageError, match=words):
        manifest.check(folder)


def test_json_keeps_the_order_and_has_null_for_what_is_no_number(tmp_path):
    content = {
        "z": 1.5,
        "a": math.nan,
        "m": [math.inf, -math.inf, (1, True)],
        "ψ": None,
        "numpy": {"f": np.float64(0.1), "n": np.float32("nan"), "i": np.int64(3), "v": np.ones(2)},
    }
    text = json_text.encode(content)
    assert text.decode().splitlines()[:3] == ["{", '  "z": 1.5,', '  "a": null,']
    assert text.endswith(b"}\n")
    path = tmp_path / "a.json"
    path.write_bytes(text)
    assert json_files.read(path) == {
        "z": 1.5,
        "a": None,
        "m": [None, None, [1, True]],
        "ψ": None,
        "numpy": {"f": 0.1, "n": None, "i": 3, "v": [1.0, 1.0]},
    }
    assert list(json_files.read(path)) == list(content)


def test_json_of_arguments_that_are_no_text(tmp_path):
    path = tmp_path / "a.json"
    path.write_bytes(json_text.encode({"argv": [os.fsdecode(b"caf\xe9.yaml")]}))
    assert os.fsencode(json_files.read(path)["argv"][0]) == b"caf\xe9.yaml"


def test_what_json_does_not_know_is_a_bug():
    with pytest.raises(TypeError):
        json_text.encode({"path": Path("a")})


# --- where a result comes from

STARTED = datetime(2026, 3, 1, 12, 0, 0, 250_000, tzinfo=timezone(timedelta(hours=2)))
FINISHED = datetime(2026, 3, 1, 10, 0, 3, tzinfo=UTC)


def test_versions_platform_command_and_times():
    origin = provenance.collect(["podusv", "run", "a.yaml"], STARTED, FINISHED)
    assert origin["podusv"] == podusv_cli.__version__
    assert origin["python"] == ".".join(map(str, sys.version_info[:3]))
    assert origin["packages"] == {
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "numba": numba.__version__,
        "h5py": h5py.__version__,
        "pydantic": pydantic.VERSION,
    }
    system = os.uname()
    expected = {"system": system.sysname, "release": system.release, "machine": system.machine}
    assert expected.items() <= origin["platform"].items()
    assert set(origin["platform"]) - set(expected) == {"processor", "libc"}
    assert origin["argv"] == ["podusv", "run", "a.yaml"]
    assert origin["started"] == "2026-03-01T10:00:00.250+00:00"
    assert origin["finished"] == "2026-03-01T10:00:03.000+00:00"
    assert origin["duration_s"] == 2.75
    assert json_text.encode(origin)


def test_a_package_that_is_not_installed_has_no_version(monkeypatch):
    def version(name: str) -> str:
        raise PackageNotFoundError(name)

    monkeypatch.setattr(provenance, "version", version)
    asked_anew = provenance.surroundings.__wrapped__  # it is kept for all results of a process
    assert set(asked_anew()["packages"].values()) == {None}


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
    tree = provenance.source_tree(package)
    assert tree is not None
    assert tree["dirty"] is dirty


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
    machine = provenance.collect([], STARTED, FINISHED)["platform"]
    assert machine["processor"] is None or machine["processor"] in Path("/proc/cpuinfo").read_text()
    assert machine["libc"] == os.confstr("CS_GNU_LIBC_VERSION")
