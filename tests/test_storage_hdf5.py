"""log.h5 as others see it: xarray, netCDF, h5py, an old HDF5; and the same bytes every time."""

from __future__ import annotations

import hashlib
import io
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from conftest import corrected, run
from numpy.testing import assert_array_equal
from storage_samples import ENVIRONMENT, PYTHON, TEXTS, YAML, assert_same, log, recording

from podusv_cli.storage import log_layout, log_reader, log_writer
from podusv_cli.storage.packing import LEVEL
from podusv_cli.storage.stream import Stream

DIMENSIONS = {
    "time": ("time",), "x": ("time",), "tau_u_cmd": ("time",), "z_e": ("time",),
    "W_hat_u": ("time", "node"), "rbf_center": ("node", "input"), "rbf_width": ("input",),
    "node": ("node",), "input": ("input",),
}  # fmt: skip
# Attributes that HDF5 itself keeps for dimension scales; they refer to other objects by nature.
SCALES = {"DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME"}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "log.h5"
    file.write_bytes(log())
    return file


def objects(content: bytes) -> dict[str, h5py.Group | h5py.Dataset]:
    """Everything in a log by name, the file open for as long as these live."""
    found = {"/": h5py.File(io.BytesIO(content))["/"]}
    found["/"].visititems(lambda name, thing: found.update({name: thing}))
    return found


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4", None])
def test_xarray_reads_every_signal_with_its_axes_and_units(path: Path, engine: str | None) -> None:
    recorded = recording()
    with xr.open_dataset(path, engine=engine) as found:
        assert {name: found[name].dims for name in found.variables} == DIMENSIONS
        assert dict(found.sizes) == {"time": 50, "node": 8, "input": 3}
        for name, array in {**recorded.signals, **recorded.fixed}.items():
            assert_array_equal(found[name].to_numpy(), array, err_msg=name)
            signal = recorded.about[name]
            expected = {"units": signal.unit, "long_name": signal.meaning, "symbol": signal.symbol,
                        "axes": " ".join(found[name].dims)}  # fmt: skip
            assert found[name].attrs == expected
        assert "time" in found.x.coords
        assert_array_equal(found.node, np.arange(8))


def test_every_axis_has_its_scale_by_name() -> None:
    found = objects(log())
    for name, axes in DIMENSIONS.items():
        scales = [list(axis.keys()) for axis in found[name].dims]
        assert found[name].is_scale or scales == [[axis] for axis in axes], name


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_attributes_of_the_file(path: Path, engine: str) -> None:
    with xr.open_dataset(path, engine=engine) as found:
        assert found.attrs == {
            "podusv_format": 1, "podusv_version": "1.2.3", "Conventions": "CF-1.11",
            "title": TEXTS["title"], "source": TEXTS["source"], "status": "finished",
            "controller": "pid",
        }  # fmt: skip


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_the_scenario_is_in_the_log(path: Path, engine: str) -> None:
    with xr.open_dataset(path, engine=engine, group="provenance") as found:
        text = found.resolved_yaml.item()
        assert (text.decode() if isinstance(text, bytes) else text) == YAML


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_a_run_that_logged_nothing_opens(tmp_path: Path, engine: str) -> None:
    path = tmp_path / "log.h5"
    path.write_bytes(log(recording(rows=0, status="diverged", message="diverged at t = 0 s")))
    with xr.open_dataset(path, engine=engine) as found:
        assert dict(found.sizes) == {"time": 0, "node": 8, "input": 3}
        assert found.attrs["message"] == "diverged at t = 0 s"


def test_a_message_only_where_there_is_one() -> None:
    assert "message" not in objects(log())["/"].attrs


def test_the_same_recording_gives_the_same_bytes_in_another_process() -> None:
    code = (
        "import hashlib, sys, storage_samples as s;"
        "sys.stdout.write(hashlib.sha256(s.log()).hexdigest())"
    )
    tests = str(Path(__file__).parent)
    paths = f"{ENVIRONMENT['PYTHONPATH']}:{tests}"
    environment = ENVIRONMENT | {"PYTHONPATH": paths, "PYTHONHASHSEED": "77", "TZ": "Asia/Tokyo"}
    found = subprocess.run([PYTHON, "-c", code], env=environment, capture_output=True, check=True)
    assert found.stdout.decode() == hashlib.sha256(log()).hexdigest()


def test_nothing_in_a_log_has_a_time_stamp() -> None:
    for name, thing in objects(log()).items():
        assert h5py.h5g.get_objinfo(thing.id).mtime == 0, name


def test_nothing_in_a_log_is_of_variable_length() -> None:
    for name, thing in objects(log()).items():
        kinds = {key: thing.attrs.get_id(key).dtype for key in set(thing.attrs) - SCALES}
        if isinstance(thing, h5py.Dataset):
            kinds["value"] = thing.dtype
        for key, kind in kinds.items():
            assert not kind.hasobject, (name, key)
            text = h5py.check_string_dtype(kind)
            assert text is None or (text.encoding == "utf-8" and text.length), (name, key)


def test_every_signal_is_packed_and_has_a_checksum() -> None:
    datasets = objects(log())
    for name in (*recording().signals, *recording().fixed):
        found = datasets[name]
        assert (found.compression, found.compression_opts) == ("gzip", LEVEL), name
        assert found.shuffle, name
        assert found.fletcher32, name


def test_hdf5_1_8_and_so_every_matlab_can_read_it() -> None:
    assert log()[8] == 2, "version of the superblock"


def test_chunks_stay_below_a_megabyte_and_cover_long_signals_whole() -> None:
    assert log_layout.chunk((31_000,)) == (31_000,)
    assert log_layout.chunk((31_000, 27)) == (4429, 27)  # seven, all but full
    assert log_layout.chunk((3, 1_000_000)) == (1, 1_000_000)


def test_a_signal_without_a_meaning_is_a_bug() -> None:
    signals = dict(recording().signals) | {"tau_w": np.zeros(50)}
    with pytest.raises(KeyError, match="tau_w"):
        log(recording(signals=signals))


@pytest.mark.parametrize("shape", [(49,), (50, 8), ()])
def test_a_signal_of_another_shape_is_a_bug(shape: tuple[int, ...]) -> None:
    signals = dict(recording().signals) | {"x": np.zeros(shape)}
    with pytest.raises(ValueError, match=r"x: 49 values along time, not 50|zip"):
        log(recording(signals=signals))


def test_texts_longer_than_an_attribute_of_old_files_can_be(tmp_path: Path) -> None:
    path, text = tmp_path / "log.h5", "# Schräglage ψ\n" * 20_000
    path.write_bytes(log(title=text, resolved_yaml=text))
    assert log_reader.resolved_yaml(path) == text
    with xr.open_dataset(path, engine="netcdf4") as found:
        assert found.attrs["title"] == text


def test_a_text_that_no_file_can_hold_is_spelt_out() -> None:
    title = objects(log(title="half \ud83d"))["/"].attrs["title"]
    assert title.decode() == r"half \ud83d"


def test_a_simulated_run_comes_back_as_it_was(tmp_path: Path) -> None:
    recorded, path = run(corrected(), 2.0), tmp_path / "log.h5"
    path.write_bytes(log(recorded))
    assert_same(recorded, log_reader.read_log(path))
    with xr.open_dataset(path, engine="netcdf4") as found:
        assert found.W_hat_r.dims == ("time", "node")
        assert set(found.data_vars) | {"time"} == {*recorded.signals, *recorded.fixed}


# --- written little by little


def test_arrays_may_come_little_by_little(tmp_path: Path) -> None:
    recorded, content = recording(), io.BytesIO()
    with log_writer.opened(Stream(content), recorded, **TEXTS) as file:
        file.add({name: recorded[name] for name in ("x", "time")}, recorded.about)
        file.done()
        file.add({"W_hat_u": recorded["W_hat_u"]}, {})
        rest = {name: recorded[name] for name in ("z_e", "tau_u_cmd")}
        file.add({**rest, **recorded.fixed}, {})
    path = tmp_path / "log.h5"
    path.write_bytes(content.getvalue())
    found = log_reader.read_log(path)
    assert list(found.signals) == ["time", "x", "W_hat_u", "z_e", "tau_u_cmd"]
    for name in {**recorded.signals, **recorded.fixed}:
        assert_array_equal(found[name], recorded[name], err_msg=name)


@pytest.mark.parametrize(
    ("late", "error"),
    [
        ({"u": np.zeros(49)}, "u: 49 values along time, not 50"),
        ({"W_hat_r": np.zeros((50, 7))}, "W_hat_r: 7 values along node, not 8"),
    ],
)
def test_what_does_not_fit_what_is_there_is_refused(late: dict, error: str) -> None:
    recorded = recording()
    with pytest.raises(ValueError, match=error):  # noqa: PT012, SIM117
        with log_writer.opened(Stream(io.BytesIO()), recorded, **TEXTS) as file:
            file.add(recorded.signals, recorded.about)
            file.add(late, {})
