"""Reading logs back: whole ones exactly, damaged and hostile ones with one sentence."""

import io
import math
import os
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from conftest import corrected, run
from numpy.testing import assert_array_equal
from storage_samples import TEXTS, YAML, assert_same, deadline, log, recording, rewritten

from podusv_cli.core.errors import StorageError
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import Signal
from podusv_cli.storage import log_reader
from podusv_cli.storage.log import LogLayout

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
    "too short": (replaced("x", data=FIFTY[1:], **PACKED), "49 values along time"),
    "other nodes": (replaced("rbf_width", data=FIFTY[:4], **PACKED), "4 values along input"),
    "giant in all": (only_time(2**40), "claims 8796093022208 bytes.*; read it with h5py or xarray"),
    "unknown signal": (lambda file: file.create_dataset("tau_w", data=FIFTY), "damaged"),
    "later format": (described("podusv_format", np.int32(3)), "format 3; this .* reads format 2$"),
    "unknown status": (described("status", np.bytes_("asleep")), "unknown status 'asleep'"),
    "no text": (described("controller", np.bytes_(b"\xff")), "utf-8"),
}


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


# --- as others see it

DIMENSIONS = {
    "time": ("time",),
    "x": ("time",),
    "tau_u_cmd": ("time",),
    "z_e": ("time",),
    "W_hat_u": ("time", "node"),
    "rbf_center": ("node", "input"),
    "rbf_width": ("input",),
    "node": ("node",),
    "input": ("input",),
}
# Attributes that HDF5 itself keeps for dimension scales; they refer to other objects by nature.
SCALES = {"DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME"}


@pytest.fixture
def written(tmp_path):
    file = tmp_path / "log.h5"
    file.write_bytes(log())
    return file


def objects(content: bytes) -> dict[str, h5py.Group | h5py.Dataset]:
    """Everything in a log by name, the file open for as long as these live."""
    things = {"/": h5py.File(io.BytesIO(content))["/"]}
    things["/"].visititems(lambda name, thing: things.update({name: thing}))
    return things


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4", None])
def test_xarray_reads_every_signal_with_its_axes_and_units(written, engine):
    recorded = recording()
    with xr.open_dataset(written, engine=engine) as dataset:
        assert {name: dataset[name].dims for name in dataset.variables} == DIMENSIONS
        assert dict(dataset.sizes) == {"time": 50, "node": 8, "input": 3}
        for name, array in {**recorded.signals, **recorded.fixed}.items():
            assert_array_equal(dataset[name].to_numpy(), array, err_msg=name)
            signal = recorded.about[name]
            assert dataset[name].attrs == {
                "units": signal.unit,
                "long_name": signal.meaning,
                "symbol": signal.symbol,
                "axes": " ".join(DIMENSIONS[name]),
            }
        assert "time" in dataset.x.coords
        assert_array_equal(dataset.node, np.arange(8))


def test_every_axis_has_its_scale_by_name():
    things = objects(log())
    for name, axes in DIMENSIONS.items():
        scales = [list(axis.keys()) for axis in things[name].dims]
        assert things[name].is_scale or scales == [[axis] for axis in axes], name


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_attributes_of_the_file(written, engine):
    with xr.open_dataset(written, engine=engine) as dataset:
        assert dataset.attrs == {
            "podusv_format": 2,
            "podusv_version": "1.2.3",
            "Conventions": "CF-1.11",
            "title": TEXTS["title"],
            "source": TEXTS["source"],
            "status": "finished",
            "controller": "pid",
        }


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_the_scenario_is_in_the_log(written, engine):
    with xr.open_dataset(written, engine=engine, group="provenance") as dataset:
        text = dataset.resolved_yaml.item()
        assert (text.decode() if isinstance(text, bytes) else text) == YAML


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_a_run_that_logged_nothing_opens(tmp_path, engine):
    path = tmp_path / "log.h5"
    path.write_bytes(log(recording(rows=0, status="diverged", message="diverged at t = 0 s")))
    with xr.open_dataset(path, engine=engine) as dataset:
        assert dict(dataset.sizes) == {"time": 0, "node": 8, "input": 3}
        assert dataset.attrs["message"] == "diverged at t = 0 s"


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
        array = datasets[name]
        assert array.chunks is None
        assert array.id.get_offset() % 8 == 0


def test_compressed_arrays_are_the_same_and_smaller(tmp_path):
    recorded = recording(rows=20_000)
    plain, packed = log(recorded), log(recorded, compress=True)
    array = objects(packed)["W_hat_u"]
    assert (array.compression, array.shuffle) == ("gzip", True)
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
    with xr.open_dataset(path, engine="netcdf4") as dataset:
        assert dataset.attrs["title"] == text


def test_a_text_that_no_file_can_hold_is_spelt_out():
    title = objects(log(title="half \ud83d"))["/"].attrs["title"]
    assert title.decode() == r"half \ud83d"


def test_a_simulated_run_comes_back_as_it_was(tmp_path):
    recorded, path = run(corrected(), 2.0), tmp_path / "log.h5"
    path.write_bytes(log(recorded))
    assert_same(recorded, log_reader.read_log(path))
    with xr.open_dataset(path, engine="netcdf4") as dataset:
        assert dataset.W_hat_r.dims == ("time", "node")
        assert set(dataset.data_vars) | {"time"} == {*recorded.signals, *recorded.fixed}


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
