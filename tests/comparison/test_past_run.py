"""A run that is over: its log is read when it is asked for, and crosses to other processes."""

from __future__ import annotations

import json
import pickle
import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from comparison_samples import past_run

import podusv
from podusv_cli.core.errors import StorageError
from podusv_cli.core.past_run import PastRun
from podusv_cli.process.workers import run_all
from podusv_cli.storage import log_reader
from podusv_cli.storage.run_folder import open_run
from podusv_cli.workflows.members import from_folder
from podusv_cli.workflows.run import Request, run

TEXT = """
name: kept
vessel: {preset: paper_nonlinear}
path: {kind: line}
disturbance: {kind: none}
actuator: {kind: saturated}
simulation: {duration: 20.0}
controller: {kind: pid}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run folder."""
    place = tmp_path_factory.mktemp("past")
    (place / "kept.yaml").write_text(TEXT)
    return run(place / "kept.yaml", Request(out=place / "run", figures=False)).folder


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The logs that are read in this process, as they are read."""
    known, read = list[Path](), log_reader.read_log

    def counted(path: Path) -> object:
        known.append(path)
        return read(path)

    monkeypatch.setattr(log_reader, "read_log", counted)
    return known


def opened(folder: Path) -> PastRun:
    """The run of a folder, of which nothing but the log is left to be read."""
    there = open_run(folder)
    assert there.about
    return there.as_run("mine", there.about)


def test_a_log_is_read_once_when_it_is_asked_for(folder: Path, reads: list[Path]) -> None:
    run = opened(folder)
    assert (run.label, run.metrics["iae"] > 0.0, reads) == ("mine", True, [])
    other = replace(run, label="other", cost={"law_ns": 7.0})
    assert (other.until, run.until, other.metric("law_ns")) == (20.0, 20.0, 7.0)
    assert run.recording is other.recording
    assert reads == [folder / "log.h5"]


def halfway(run: PastRun, progress: Callable[[float], None]) -> tuple[PastRun, float]:
    """A run back from another process, and what is halfway along its z_e there."""
    return run, float(run.signal("z_e")[1000])


@pytest.mark.parametrize("read_before", [False, True])
def test_a_run_crosses_to_a_worker_and_back(
    folder: Path, reads: list[Path], *, read_before: bool
) -> None:
    run = opened(folder)
    rows = len(run.recording["time"]) if read_before else 2001
    assert len(pickle.dumps(run)) < rows * 8  # not even one signal of the log goes along
    (outcome,) = run_all([partial(halfway, run)])
    assert not outcome.failure
    back, there = outcome.result
    assert len(reads) == read_before  # the worker reads its own
    np.testing.assert_array_equal(back.signal("z_e"), open_run(folder).recording["z_e"])
    assert back.signal("z_e")[1000] == there
    assert (back.label, back.about, dict(back.metrics)) == (run.label, run.about, dict(run.metrics))


def test_a_run_is_found_from_another_folder(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder.parent)
    crossing = pickle.dumps(opened(Path(folder.name)))
    monkeypatch.chdir(tmp_path)
    assert pickle.loads(crossing).until == 20.0


def test_a_run_in_memory_crosses_with_its_numbers() -> None:
    run = past_run({"iae": 3.0}, "diverged", "diverged at t = 3 s: why")
    back = pickle.loads(pickle.dumps(run))
    assert (back.until, back.ending) == (3.0, "diverged at t = 3 s")
    np.testing.assert_array_equal(back.signal("x_e"), run.signal("x_e"))


def test_a_log_that_is_gone_is_told_when_it_is_asked_for(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder, tmp_path / "copy")
    run = opened(tmp_path / "copy")
    (tmp_path / "copy/log.h5").unlink()
    assert run.metrics["iae"] > 0.0
    with pytest.raises(StorageError, match=r"copy/log\.h5"):
        _ = run.recording


def test_a_folder_of_before_about_json_opens_with_what_its_scenario_says(
    folder: Path, tmp_path: Path
) -> None:
    old = tmp_path / "old"
    shutil.copytree(folder, old)
    (old / "about.json").unlink()
    manifest = json.loads((old / "manifest.json").read_text())
    del manifest["files"]["about.json"]
    (old / "manifest.json").write_text(json.dumps(manifest))
    assert open_run(old).about is None
    (member,) = from_folder(old)
    assert member.folder is not None
    run, new = member.folder.as_run("old", member.about), opened(folder)
    assert run.about == new.about
    assert run.compared_metrics() == pytest.approx(new.compared_metrics(), rel=0, nan_ok=True)
    assert (run.until, run.check("underactuated")) == (20.0, new.check("underactuated"))


def test_a_run_of_python_s_keeps_its_log_wherever_its_folder_goes(folder: Path, tmp_path: Path):
    """Pickled, it has the numbers: the folder may be gone, or hold another run."""
    place = tmp_path / "run"
    shutil.copytree(folder, place)
    run = podusv.open_run(place)
    kept = pickle.dumps(run)
    shutil.rmtree(place)
    back = pickle.loads(kept)
    assert back.label == run.label
    np.testing.assert_array_equal(back["z_e"], podusv.open_run(folder)["z_e"])
