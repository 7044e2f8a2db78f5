"""log.h5 as others see it: xarray, netCDF, h5py, an old HDF5; and the same bytes every time."""

import io

import h5py
import numpy as np
import pytest
import xarray as xr
from conftest import corrected, run
from numpy.testing import assert_array_equal
from storage_samples import TEXTS, YAML, assert_same, log, recording

from podusv_cli.core.signal import Signal
from podusv_cli.storage import log_reader
from podusv_cli.storage.log import LogLayout

DIMENSIONS = {
    "time": ("time",), "x": ("time",), "tau_u_cmd": ("time",), "z_e": ("time",),
    "W_hat_u": ("time", "node"), "rbf_center": ("node", "input"), "rbf_width": ("input",),
    "node": ("node",), "input": ("input",),
}  # fmt: skip
# Attributes that HDF5 itself keeps for dimension scales; they refer to other objects by nature.
SCALES = {"DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME"}


@pytest.fixture
def path(tmp_path):
    file = tmp_path / "log.h5"
    file.write_bytes(log())
    return file


def objects(content: bytes) -> dict[str, h5py.Group | h5py.Dataset]:
    """Everything in a log by name, the file open for as long as these live."""
    found = {"/": h5py.File(io.BytesIO(content))["/"]}
    found["/"].visititems(lambda name, thing: found.update({name: thing}))
    return found


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4", None])
def test_xarray_reads_every_signal_with_its_axes_and_units(path, engine):
    recorded = recording()
    with xr.open_dataset(path, engine=engine) as found:
        assert {name: found[name].dims for name in found.variables} == DIMENSIONS
        assert dict(found.sizes) == {"time": 50, "node": 8, "input": 3}
        for name, array in {**recorded.signals, **recorded.fixed}.items():
            assert_array_equal(found[name].to_numpy(), array, err_msg=name)
            signal = recorded.about[name]
            assert found[name].attrs == {
                "units": signal.unit, "long_name": signal.meaning, "symbol": signal.symbol,
                "axes": " ".join(DIMENSIONS[name]),
            }  # fmt: skip
        assert "time" in found.x.coords
        assert_array_equal(found.node, np.arange(8))


def test_every_axis_has_its_scale_by_name():
    found = objects(log())
    for name, axes in DIMENSIONS.items():
        scales = [list(axis.keys()) for axis in found[name].dims]
        assert found[name].is_scale or scales == [[axis] for axis in axes], name


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_attributes_of_the_file(path, engine):
    with xr.open_dataset(path, engine=engine) as found:
        assert found.attrs == {
            "podusv_format": 2, "podusv_version": "1.2.3", "Conventions": "CF-1.11",
            "title": TEXTS["title"], "source": TEXTS["source"], "status": "finished",
            "controller": "pid",
        }  # fmt: skip


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_the_scenario_is_in_the_log(path, engine):
    with xr.open_dataset(path, engine=engine, group="provenance") as found:
        text = found.resolved_yaml.item()
        assert (text.decode() if isinstance(text, bytes) else text) == YAML


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_a_run_that_logged_nothing_opens(tmp_path, engine):
    path = tmp_path / "log.h5"
    path.write_bytes(log(recording(rows=0, status="diverged", message="diverged at t = 0 s")))
    with xr.open_dataset(path, engine=engine) as found:
        assert dict(found.sizes) == {"time": 0, "node": 8, "input": 3}
        assert found.attrs["message"] == "diverged at t = 0 s"


def test_nothing_in_a_log_is_of_variable_length():
    for name, thing in objects(log()).items():
        kinds = {key: thing.attrs.get_id(key).dtype for key in set(thing.attrs) - SCALES}
        if isinstance(thing, h5py.Dataset):
            kinds["value"] = thing.dtype
        for key, kind in kinds.items():
            assert not kind.hasobject, (name, key)
            text = h5py.check_string_dtype(kind)
            assert text is None or (text.encoding == "utf-8" and text.length), (name, key)


def test_every_array_lies_in_one_piece_where_a_map_can_use_it():
    datasets = objects(log())
    for name in (*recording().signals, *recording().fixed):
        found = datasets[name]
        assert found.chunks is None
        assert found.id.get_offset() % 8 == 0


def test_compressed_arrays_are_the_same_and_smaller(tmp_path):
    recorded = recording(rows=20_000)
    plain, packed = log(recorded), log(recorded, compress=True)
    found = objects(packed)["W_hat_u"]
    assert (found.compression, found.shuffle) == ("gzip", True)
    assert len(packed) < 0.98 * len(plain)
    (tmp_path / "log.h5").write_bytes(packed)
    assert_same(recorded, log_reader.read_log(tmp_path / "log.h5"))


def test_hdf5_1_8_and_so_every_matlab_can_read_it():
    assert log()[8] == 2, "version of the superblock"


def test_a_signal_without_a_meaning_is_a_bug():
    signals = dict(recording().signals) | {"tau_w": np.zeros(50)}
    with pytest.raises(KeyError, match="tau_w"):
        log(recording(signals=signals))


@pytest.mark.parametrize("shape", [(49,), (50, 8), ()])
def test_a_signal_of_another_shape_is_a_bug(shape):
    signals = dict(recording().signals) | {"x": np.zeros(shape)}
    with pytest.raises(ValueError, match=r"x: 49 values along time, not 50|zip"):
        log(recording(signals=signals))


def test_texts_longer_than_an_attribute_of_old_files_can_be(tmp_path):
    path, text = tmp_path / "log.h5", "# Schräglage ψ\n" * 20_000
    path.write_bytes(log(title=text, resolved_yaml=text))
    assert log_reader.resolved_yaml(path) == text
    with xr.open_dataset(path, engine="netcdf4") as found:
        assert found.attrs["title"] == text


def test_a_text_that_no_file_can_hold_is_spelt_out():
    title = objects(log(title="half \ud83d"))["/"].attrs["title"]
    assert title.decode() == r"half \ud83d"


def test_a_simulated_run_comes_back_as_it_was(tmp_path):
    recorded, path = run(corrected(), 2.0), tmp_path / "log.h5"
    path.write_bytes(log(recorded))
    assert_same(recorded, log_reader.read_log(path))
    with xr.open_dataset(path, engine="netcdf4") as found:
        assert found.W_hat_r.dims == ("time", "node")
        assert set(found.data_vars) | {"time"} == {*recorded.signals, *recorded.fixed}


# --- signals of laws that podusv does not know


SPEED = Signal("speed_2", "m/s", "a law's own speed", r"\nu_2", ("layer",), wrapped=True)
GAINS = Signal("gains", "1", "a law's own gains", "K", ("layer",), fixed=True)


def test_signals_of_others_bring_their_description(tmp_path):
    base = recording()
    recorded = recording(
        signals={**base.signals, "speed_2": np.ones((50, 3))},
        fixed={**base.fixed, "gains": np.arange(3.0)},
        about={**base.about, "speed_2": SPEED, "gains": GAINS},
    )
    path = tmp_path / "log.h5"
    path.write_bytes(log(recorded))
    found = log_reader.read_log(path)
    assert_same(recorded, found)
    assert found.about == {name: recorded.about[name] for name in found.about}
    assert {"speed_2", "gains", "W_hat_u"} <= set(found.about)
    with xr.open_dataset(path, engine="h5netcdf") as seen:
        assert seen.speed_2.dims == ("time", "layer")
        assert seen.gains.dims == ("layer",)


# --- the file in memory in which HDF5 lays the log out


def test_a_layout_is_a_file_whose_empty_parts_take_no_room(tmp_path):
    layout, plain = LogLayout(), io.BytesIO()
    random = np.random.default_rng(3)
    for _ in range(200):
        place, content = int(random.integers(40_000)), random.bytes(int(random.integers(1, 9000)))
        for file in (layout, plain):
            file.seek(place)
            assert file.write(content) == len(content)
            assert file.tell() == place + len(content)
        place = int(random.integers(40_000))
        plain.seek(place)
        layout.seek(place)
        known = plain.read(5000)
        assert layout.read(5000)[: len(known)] == known
    with (tmp_path / "file").open("wb", buffering=0) as out:
        layout.write_to(out)
    assert (tmp_path / "file").read_bytes() == plain.getvalue()
    layout.truncate(2**50)
    assert (layout.seek(0, io.SEEK_END), layout.size) == (2**50, 2**50)
