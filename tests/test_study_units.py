"""The files of a study's units: read whole or told, and removed only where a table has them."""

import errno
import io

import h5py
import numpy as np
import pytest
from small_study import made
from test_study_store import finishing

from podusv_cli.core.errors import StorageError
from podusv_cli.studies.study import store as stores
from podusv_cli.studies.study.store import BLOCK, RUNS, UNITS, encoded, read, undamaged
from podusv_cli.studies.study.unit import Unit, UnitResult


def test_a_whole_study_removes_only_units_that_it_read(tmp_path, monkeypatch):
    store = made(tmp_path / "study", draws=8)
    finishing(monkeypatch, lambda: (store.folder / UNITS / "late.h5").write_bytes(b"late"))
    store.write_runs()
    assert [path.name for path in (store.folder / UNITS).iterdir()] == ["late.h5"]


def test_a_unit_that_cannot_be_read_is_an_error_and_not_missing(tmp_path, monkeypatch):
    store = made(tmp_path / "study", part=(1, 5))
    there = sorted((store.folder / UNITS).iterdir())

    def fail(path):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(stores.Path, "read_bytes", fail)
    for act in (store.covered, store.write_runs, lambda: list(store.results())):
        with pytest.raises(StorageError, match=r"cannot read .*units/.*: Input/output error"):
            act()
    assert sorted((store.folder / UNITS).iterdir()) == there


def test_a_unit_with_any_other_byte_is_damaged(tmp_path):
    store = made(tmp_path / "study", part=(1, 5))
    path = next((store.folder / UNITS).glob("pid-*"))
    sound = path.read_bytes()
    there = store.covered()["pid", 0].sum()
    places = [*range(0, BLOCK, 7), *np.linspace(BLOCK, len(sound) - 1, 40).astype(int)]
    spoilt = [sound[:at] + bytes([sound[at] ^ 1]) + sound[at + 1 :] for at in places]
    for content in (b"", sound[:-9], sound[:300], sound + b"0", *spoilt):
        path.write_bytes(content)
        assert read(path, store.seal) is None
        assert store.covered()["pid", 0].sum() == 0 < there
    path.write_bytes(sound)
    assert store.covered()["pid", 0].sum() == there


def test_a_unit_is_counted_without_hdf5(tmp_path, monkeypatch):
    store = made(tmp_path / "study", part=(1, 5))
    opened = []
    monkeypatch.setattr(h5py, "File", lambda *given, **options: opened.append(given))
    assert sum(int(mask.sum()) for mask in store.covered().values()) == 16
    assert all(given[0] == store.folder / RUNS for given in opened)


@pytest.mark.parametrize("law", ["pid", "ä" * 400])
def test_a_unit_of_any_name_is_read_as_it_was(law):
    numbers = np.array([1.5, np.nan])
    unit = Unit(law, 3, 70, 2)
    result = UnitResult(unit, {"iae": numbers}, np.array([0, 1], np.uint8), numbers, ("", "ü"))
    content = encoded(result, "seal")
    assert undamaged(content, "seal") == unit
    assert undamaged(content, "other") is None
    with h5py.File(io.BytesIO(content), "r") as file:
        assert file["table"].shape == (2, 2)
