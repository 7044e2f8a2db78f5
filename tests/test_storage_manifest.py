"""The manifest: what "finished" means, and JSON as podusv writes it."""

import hashlib
import json
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from podusv_cli.core.errors import StorageError
from podusv_cli.storage import json_files, manifest
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
    found = manifest.check(folder)
    assert manifest.foreign(folder, found) == ["figures/mine.png", "latest", "notes.txt"]


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
    "other format": (
        lambda it: it.update(podusv_format=3),
        "format 3; this podusv reads format 2",
    ),
    "no format": (lambda it: it.pop("podusv_format"), "format None; this podusv reads"),
    "no status": (lambda it: it.pop("status"), "status: Field required"),
    "unknown status": (lambda it: it.update(status="asleep"), "status"),
    "no files": (lambda it: it.pop("files"), "files: Field required"),
    "list of files": (lambda it: it.update(files=["log.h5"]), "files"),
    "unknown key": (lambda it: it.update(author="me"), "author"),
    "short sum": (lambda it: it["files"].update(a=ENTRY | {"sha256": "0"}), r"files\.a\.sha256"),
    "size in words": (lambda it: it["files"].update(a=ENTRY | {"bytes": "1"}), r"files\.a\.bytes"),
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
        "z": 1.5, "a": math.nan, "m": [math.inf, -math.inf, (1, True)], "ψ": None,
        "numpy": {"f": np.float64(0.1), "n": np.float32("nan"), "i": np.int64(3), "v": np.ones(2)},
    }  # fmt: skip
    text = json_files.encode(content)
    assert text.decode().splitlines()[:3] == ["{", '  "z": 1.5,', '  "a": null,']
    assert text.endswith(b"}\n")
    path = tmp_path / "a.json"
    path.write_bytes(text)
    assert json_files.read(path) == {
        "z": 1.5, "a": None, "m": [None, None, [1, True]], "ψ": None,
        "numpy": {"f": 0.1, "n": None, "i": 3, "v": [1.0, 1.0]},
    }  # fmt: skip
    assert list(json_files.read(path)) == list(content)


def test_json_of_arguments_that_are_no_text(tmp_path):
    path = tmp_path / "a.json"
    path.write_bytes(json_files.encode({"argv": [os.fsdecode(b"caf\xe9.yaml")]}))
    assert os.fsencode(json_files.read(path)["argv"][0]) == b"caf\xe9.yaml"


def test_what_json_does_not_know_is_a_bug():
    with pytest.raises(TypeError):
        json_files.encode({"path": Path("a")})
