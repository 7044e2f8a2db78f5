"""A table of a study shows what is stored in its own file, and nothing of another file."""

import os
import shutil

import h5py
import numpy as np
import pytest
from small_study import TEXT, made, small

from podusv_cli.core.errors import StorageError
from podusv_cli.study.store import RUNS, SCENARIO, UNITS, encoded, read
from podusv_cli.study.unit import Unit, make

SECRET = 0.123456789
KEY = "drawn/vessel.m"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = made(tmp_path_factory.mktemp("study") / "whole", draws=4).folder
    (folder / SCENARIO).write_text(TEXT.replace("draws: 40", "draws: 4"))
    return folder


@pytest.fixture
def study(whole, tmp_path):
    return shutil.copytree(whole, tmp_path / "study")


@pytest.fixture
def secret(tmp_path):
    """A file of somebody else, as bytes and as HDF5."""
    np.full(4, SECRET).tofile(tmp_path / "secret")
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["x"] = np.full(4, SECRET)
    return tmp_path


def external(file, place):
    file.create_dataset(KEY, (4,), "<f8", external=[(str(place / "secret"), 0, 32)])


def virtual(file, place):
    layout = h5py.VirtualLayout(shape=(4,), dtype="<f8")
    layout[:] = h5py.VirtualSource(str(place / "secret.h5"), "x", shape=(4,))
    file.create_virtual_dataset(KEY, layout)


def external_link(file, place):
    file[KEY] = h5py.ExternalLink(str(place / "secret.h5"), "x")


def soft_link(file, place):
    file[KEY] = h5py.SoftLink("/until")


@pytest.mark.parametrize("put", [external, virtual, external_link, soft_link])
def test_data_in_another_file_are_refused(study, secret, podusv, put):
    with h5py.File(study / RUNS, "a") as file:
        del file[KEY], file["sha256_rest"]
        put(file, secret)
    said = podusv("sweep", "export", study)
    assert said.code == 5
    assert f"{KEY} is a link to elsewhere" in said.err or "data in another file" in said.err
    assert not (study / "runs.csv").exists()


def test_data_of_a_unit_in_another_file_are_refused(study, secret, tmp_path, monkeypatch):
    unit = make(small(draws=4), Unit("pid", 0, 0, 4))
    real = h5py.Group.create_dataset

    def elsewhere(group, name, **given):
        if name != "table":
            return real(group, name, **given)
        shape = given["data"].shape
        outside = [(str(secret / "secret"), 0, h5py.h5f.UNLIMITED)]
        return real(group, name, shape, "<f8", external=outside)

    monkeypatch.setattr(h5py.Group, "create_dataset", elsewhere)
    path = study / UNITS / "pid-0-0-4.h5"
    path.write_bytes(encoded(unit, "seal"))
    monkeypatch.undo()
    with pytest.raises(StorageError, match="table keeps its data in another file"):
        read(path, "seal")


@pytest.mark.parametrize(("name", "code"), [(RUNS, 5), (f"{UNITS}/pid-0-0-4.h5", 0)])
def test_a_pipe_in_place_of_a_file_does_not_hang(study, podusv, name, code):
    (study / name).unlink(missing_ok=True)
    os.mkfifo(study / name)
    said = podusv("sweep", "status", study)
    assert said.code == code
    assert ("not a regular file" in said.err) == (code == 5)
