"""Results of every podusv there was are read by this one, number by number.

For each format there are small finished runs in tests/fixtures, kept as they were written, and the
numbers in them in plain text beside. Whoever raises `manifest.FORMAT` reads the old ones on, and
makes new ones with `python tests/old_runs.py`.
"""

import io
import json
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from podusv_cli.core.errors import StorageError
from podusv_cli.storage import log_reader, manifest
from podusv_cli.storage.run_folder import open_run

FIXTURES = Path(__file__).with_name("fixtures")
ARCHIVES = sorted(FIXTURES.glob("format_*/*.tar.gz"))
NAMES = [f"{path.parent.name}-{path.name.removesuffix('.tar.gz')}" for path in ARCHIVES]
KINDS = ("adaptive_neural", "diverged", "pid", "pods")


def unpacked(archive: Path, folder: Path) -> Path:
    shutil.unpack_archive(archive, folder)  # ours; tarfile's own filters came with Python 3.11.4
    return folder


@pytest.fixture(params=ARCHIVES, ids=NAMES)
def archive(request):
    path: Path = request.param
    return path


@pytest.fixture
def run(archive, tmp_path):
    return unpacked(archive, tmp_path / "old")


@pytest.fixture
def told(archive):
    """What is in the run, in plain text."""
    return json.loads(archive.with_name(archive.name.replace(".tar.gz", ".json")).read_text())


def test_there_are_runs_of_every_format():
    formats = range(1, manifest.FORMAT + 1)
    wanted = {f"format_{number}-{kind}" for number in formats for kind in KINDS}
    assert wanted <= set(NAMES), "python tests/old_runs.py makes those of this format"


def test_every_number_is_read(run, told):
    log = log_reader.read_log(run / "log.h5")
    assert {*log.signals, *log.fixed} == set(told["arrays"])
    for name, numbers in told["arrays"].items():
        assert_array_equal(log[name], np.array(numbers), err_msg=name)
    assert (log.status, log.controller) == (told["status"], told["controller"])
    assert log.message.startswith("diverged at t = " if log.status == "diverged" else "")


def test_the_folder_is_opened(run, told):
    opened = open_run(run)
    assert opened.status == told["status"]
    assert opened.metrics == told["metrics"]
    assert bool(opened.theory) == ("V" in told["arrays"])
    assert opened.resolved_yaml == log_reader.resolved_yaml(run / "log.h5")


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_xarray_reads_every_number(run, told, engine):
    xarray = pytest.importorskip("xarray", reason="xarray reads logs but is not needed by podusv")
    pytest.importorskip({"netcdf4": "netCDF4"}.get(engine, engine), reason="an engine of xarray's")
    with xarray.open_dataset(run / "log.h5", engine=engine, decode_timedelta=False) as log:
        for name, numbers in told["arrays"].items():
            assert_array_equal(log[name].values, np.array(numbers), err_msg=name)
            assert log[name].attrs["long_name"]
        assert log["time"].dims == ("time",)


@pytest.fixture(params=range(1, manifest.FORMAT + 1))
def folders(request, tmp_path):
    """All runs of a format, and what is told of them."""
    place = FIXTURES / f"format_{request.param}"
    return {
        unpacked(place / f"{kind}.tar.gz", tmp_path / kind): json.loads(
            (place / f"{kind}.json").read_text()
        )
        for kind in KINDS
    }


def test_runs_are_drawn(folders, tmp_path, podusv):
    wanted = ("stability",)
    asked = [word for name in wanted for word in ("--figure", name)]
    said = podusv("plot", *folders, *asked, "--out", tmp_path / "drawn")
    assert said.code == 0
    assert {path.stem for path in (tmp_path / "drawn").iterdir()} == set(wanted)


def test_runs_are_compared(folders, tmp_path, podusv):
    said = podusv("compare", *folders, "--out", tmp_path / "all", "--no-figures", "--json")
    assert said.code == 3  # one of them diverged
    runs = {Path(run["run"]): run for run in json.loads(said.out)["runs"]}
    for folder, told in folders.items():
        assert runs[folder]["metrics"] == told["metrics"]
        assert runs[folder]["status"] == told["status"]


def test_it_differs_in_nothing_from_itself(run, podusv):
    said = podusv("diff", run, run)
    assert said == (0, "identical: scenario, metrics, log.h5 byte for byte\n", "")


# --- what comes after this podusv


def test_a_log_of_a_later_format_is_refused_in_a_sentence(run):
    later = manifest.FORMAT + 1
    content = io.BytesIO((run / "log.h5").read_bytes())
    with h5py.File(content, "r+") as file:
        file.attrs.modify("podusv_format", np.int32(later))
    (run / "log.h5").write_bytes(content.getvalue())
    words = f"written in format {later}; this podusv reads formats 1 to {manifest.FORMAT}$"
    with pytest.raises(StorageError, match=words):
        log_reader.read_log(run / "log.h5")


def test_a_folder_of_a_later_format_is_refused_in_a_sentence(run, podusv):
    later = manifest.FORMAT + 1
    stated = json.loads((run / manifest.NAME).read_text())
    (run / manifest.NAME).write_text(json.dumps(stated | {"podusv_format": later}))
    words = f"written in format {later}; this podusv reads formats 1 to {manifest.FORMAT}"
    for command in ("plot", "compare", "rerun"):
        assert podusv(command, run) == (5, "", f"{run / manifest.NAME}: {words}\n")
