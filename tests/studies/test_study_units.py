"""The files of a study's units: read whole or told, and removed only where a table has them."""

import errno

import numpy as np
import pytest
from small_study import made
from test_study_store import finishing

from podusv_cli.core.errors import StorageError
from podusv_cli.studies.counting.runs import Unit, UnitResult
from podusv_cli.studies.making import runs_writer
from podusv_cli.studies.making import store as stores
from podusv_cli.studies.making.store import UNITS, decode_unit, encode_unit, read


@pytest.mark.long
def test_a_whole_study_removes_only_units_that_it_read(tmp_path, monkeypatch):
    made(tmp_path / "study", part=(1, 2), draws=8)
    store = made(tmp_path / "study", part=(2, 2), draws=8)
    finishing(monkeypatch, lambda: (store.folder / UNITS / "late.unit").write_bytes(b"late"))
    store.write_runs()
    assert [path.name for path in (store.folder / UNITS).iterdir()] == ["late.unit"]


def test_a_table_to_which_nothing_is_added_is_not_written_again(tmp_path, monkeypatch):
    store = made(tmp_path / "study", draws=8)
    monkeypatch.setattr(runs_writer, "write", None)
    assert all(store.write_runs().tried(law).all() for law in store.about.laws)


def test_a_unit_that_cannot_be_read_is_an_error_and_not_missing(tmp_path, monkeypatch):
    store = made(tmp_path / "study", part=(1, 5))
    there = sorted((store.folder / UNITS).iterdir())

    def fail(path):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(stores.Path, "read_bytes", fail)
    for act in (store.covered_draws, store.write_runs, lambda: list(store.results())):
        with pytest.raises(StorageError, match=r"cannot read .*units/.*: Input/output error"):
            act()
    assert sorted((store.folder / UNITS).iterdir()) == there


def test_a_unit_with_any_other_byte_is_damaged(tmp_path):
    store = made(tmp_path / "study", part=(1, 5))
    path = next((store.folder / UNITS).glob("pid-*"))
    sound = path.read_bytes()
    there = store.covered_draws()["pid", 0].sum()
    head = sound.index(b"\n") + 9
    places = [*range(0, head, 7), *np.linspace(head, len(sound) - 1, 40).astype(int)]
    spoilt = [sound[:at] + bytes([sound[at] ^ 1]) + sound[at + 1 :] for at in places]
    for content in (b"", sound[:-9], sound[:300], sound + b"0", *spoilt):
        path.write_bytes(content)
        assert read(path, store.seal) is None
        assert store.covered_draws()["pid", 0].sum() == 0 < there
    path.write_bytes(sound)
    assert store.covered_draws()["pid", 0].sum() == there


@pytest.mark.parametrize("law", ["pid", "ä" * 400])
def test_a_unit_of_any_name_is_read_as_it_was(law):
    numbers = np.array([1.5, np.nan])
    unit = Unit(law, 3, 70, 2)
    result = UnitResult(unit, {"iae": numbers}, np.array([0, 1], np.uint8), numbers, ("", "ü"))
    content = encode_unit(result, "seal")
    again = decode_unit(content, "seal")
    assert (again.unit, again.causes) == (unit, result.causes)
    assert np.array_equal(again.metrics["iae"], numbers, equal_nan=True)
    assert np.array_equal(again.until, numbers, equal_nan=True)
    assert again.status.tolist() == [0, 1]
    assert decode_unit(content, "other") is None
