"""Reading logs back: whole ones exactly, damaged and hostile ones with one sentence."""

import math
import os
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from storage_samples import YAML, assert_same, deadline, log, recording, rewritten

from podusv_cli.core.errors import StorageError
from podusv_cli.core.recording import Recording
from podusv_cli.storage import log_reader

WORDS = ("units", "long_name", "symbol", "axes", "wrapped")  # attributes of a variable


@pytest.fixture(autouse=True)
def never_hangs():
    with deadline():
        yield


@pytest.fixture
def path(tmp_path):
    return tmp_path / "log.h5"


def read(path: Path, content: bytes) -> Recording:
    path.write_bytes(content)
    return log_reader.read_log(path)


@pytest.mark.parametrize(
    "recorded",
    [
        recording(),
        recording(rows=1),
        recording(rows=0),
        recording(fixed={}),
        recording(rows=9000, nodes=5),  # written in three parts
        recording(status="diverged", message="diverged at t = 0.5 s: ψ is not finite"),
        recording(signals={"time": np.array([0.0, 1.0]), "x": np.array([np.nan, -np.inf])}),
        recording(signals={"time": np.array([0.0, 1.0]), "z_e": np.array([-0.0, 5e-324])}),
    ],
)
def test_what_was_written_is_read(path, recorded):
    assert_same(recorded, read(path, log(recorded)))
    assert log_reader.resolved_yaml(path) == YAML


@pytest.mark.parametrize("text", ["", "a: 1\n", "# Schräglage ψ\n" * 20_000])
def test_the_scenario_comes_back_whatever_its_length(path, text):
    path.write_bytes(log(resolved_yaml=text))
    assert log_reader.resolved_yaml(path) == text


PACKED = {"compression": "gzip", "shuffle": True, "fletcher32": True}


def replaced(name: str, **how: object) -> Callable[[h5py.File], None]:
    """A change that puts a dataset made with `how` in place of `name`."""

    return lambda file: remake(file, name, **how)


def remake(file: h5py.File, name: str, **how: object) -> None:
    """Another dataset under this name, which says of its signal what the one before did."""
    words = {key: file[name].attrs[key] for key in WORDS if key in file[name].attrs}
    del file[name]
    made = file.create_dataset(name, **how)
    for key, text in words.items():
        made.attrs.create(key, np.bytes_(text.encode() if isinstance(text, str) else text))


def linked(
    name: str, link: h5py.SoftLink | h5py.ExternalLink | np.dtype
) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        del file[name]
        file[name] = link

    return change


def described(name: str, content: object, kind: object = None) -> Callable[[h5py.File], None]:
    return lambda file: file.attrs.create(name, content, dtype=kind)


def virtual(source: str) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        del file["x"]
        virtual_layout = h5py.VirtualLayout(shape=(50,), dtype="<f8")
        virtual_layout[:] = h5py.VirtualSource(source, "x", shape=(50,))
        file.create_virtual_dataset("x", virtual_layout)

    return change


def only_time(count: int) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        for name in set(file) - {"provenance", "time"}:
            del file[name]
        remake(file, "time", shape=(count,), dtype="<f8", chunks=(4096,))

    return change


FIFTY = np.zeros(50)
WRONG = {
    "soft link": (linked("x", h5py.SoftLink("/z_e")), "link to elsewhere"),
    "soft link to nothing": (linked("x", h5py.SoftLink("/nowhere")), "link to elsewhere"),
    "too short": (replaced("x", data=FIFTY[1:], **PACKED), "49 values along time"),
    "other nodes": (replaced("rbf_width", data=FIFTY[:4], **PACKED), "4 values along input"),
    "giant in all": (only_time(2**40), "claims 8796093022208 bytes.*; read it with h5py or xarray"),
    "no time": (lambda file: file.pop("time"), "damaged"),
    "unknown signal": (lambda file: file.create_dataset("tau_w", data=FIFTY), "damaged"),
    "later format": (described("podusv_format", np.int32(3)), "format 3; this .* reads format 2$"),
    "no format": (lambda file: file.attrs.pop("podusv_format"), "damaged"),
    "no status": (lambda file: file.attrs.pop("status"), "damaged"),
    "unknown status": (described("status", np.bytes_("asleep")), "unknown status 'asleep'"),
    "no text": (described("controller", np.bytes_(b"\xff")), "utf-8"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_a_log_that_is_not_as_podusv_writes_it_is_refused(path, case):
    change, words = WRONG[case]
    with pytest.raises(StorageError, match=words) as caught:
        read(path, rewritten(change))
    assert "\n" not in str(caught.value)


@pytest.fixture
def secret(tmp_path):
    """Another log, and plain numbers, that a hostile log would like to have read."""
    other = tmp_path / "secret.h5"
    other.write_bytes(log())
    np.full(50, 7.0).tofile(tmp_path / "secret.bin")
    return other


def test_data_in_other_files_are_refused(path, secret):
    outside = [(str(secret.with_suffix(".bin")), 0, 400)]
    link = linked("x", h5py.ExternalLink(str(secret), "/x"))
    with pytest.raises(StorageError, match="link to elsewhere"):
        read(path, rewritten(link))
    with pytest.raises(StorageError, match="keeps its data in another file"):
        read(path, rewritten(replaced("x", shape=(50,), dtype="<f8", external=outside)))
    with pytest.raises(StorageError, match="keeps its data in another file"):
        read(path, rewritten(virtual(str(secret))))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (linked("provenance", h5py.SoftLink("/")), "link to elsewhere"),
        (linked("provenance/resolved_yaml", h5py.SoftLink("/x")), "link to elsewhere"),
        (replaced("provenance", data=1.0), "damaged"),
        (lambda file: file.pop("provenance"), "damaged"),
    ],
)
def test_a_scenario_that_is_not_as_podusv_writes_it_is_refused(path, change, words):
    path.write_bytes(rewritten(change))
    with pytest.raises(StorageError, match=words):
        log_reader.resolved_yaml(path)


def test_only_regular_files_are_read(tmp_path, path):
    path.write_bytes(log())
    link, pipe, empty = tmp_path / "link", tmp_path / "pipe", tmp_path / "empty"
    link.symlink_to(path)
    os.mkfifo(pipe)
    empty.touch()
    faults = {
        link: "symbolic link",
        pipe: "not a regular file",
        tmp_path: "not a regular file",
        Path("/dev/zero"): "not a regular file",
        empty: "damaged, or not a log",
        tmp_path / "nothing": "no such file",
    }
    for place, words in faults.items():
        with pytest.raises(StorageError, match=words) as caught:
            log_reader.read_log(place)
        assert str(place) in str(caught.value)


def test_a_file_beyond_all_measure_is_not_even_opened(path):
    path.touch()
    os.truncate(path, log_reader.LARGEST_FILE + 1)  # a hole: takes no room on the disk
    with pytest.raises(StorageError, match=r"at most .* read it with h5py or xarray"):
        log_reader.read_log(path)


def test_the_size_that_is_allowed_is_for_the_caller_to_say(path):
    path.write_bytes(log())
    with pytest.raises(StorageError, match="at most 1000 allowed"):
        log_reader.read_log(path, 1000)
    assert_same(recording(), log_reader.read_log(path, math.inf))
