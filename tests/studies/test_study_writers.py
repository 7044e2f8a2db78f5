"""One process writes a study or a search; another one is refused and damages nothing."""

import errno
import fcntl
import os
import shutil
import signal
from contextlib import contextmanager
from pathlib import Path

import pytest
from command_samples import under_way, wait_for
from small_study import TEXT, folder_with_scenario, made, written

from podusv_cli.core.errors import StorageError
from podusv_cli.storage import writer
from podusv_cli.storage.writer import TABLES, sole_writer
from podusv_cli.studies.making.store import SCENARIO
from podusv_cli.workflows import sweep


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return folder_with_scenario(tmp_path_factory.mktemp("study") / "whole")


@pytest.fixture
def study(whole, tmp_path):
    return shutil.copytree(whole, tmp_path / "study")


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


COMMANDS = {
    "run": ("sweep", "run", "{study}", "--draws", "8", "--no-figures"),
    "merge": ("sweep", "merge", "{other}", "--out", "{study}"),
    "tune": ("tune", "{config}", "--out", "{study}"),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_second_writer_is_refused(study, whole, tmp_path, podusv, name):
    config = written(tmp_path / "tune.yaml", (TEXT[TEXT.index("  claims") :], TUNE))
    words = [word.format(study=study, other=whole, config=config) for word in COMMANDS[name]]
    with sole_writer(study):
        before = contents(study)
        said = podusv(*words)
        assert said.code == 5
        assert f"{study}: another podusv process ({os.getpid()} on " in said.err
        assert contents(study) == before
    assert not list(study.glob(".podusv*"))


TUNE = "tune: {budget: 16, train: 2, validate: 2}\n"


def test_a_driver_does_not_keep_others_from_looking(study, podusv):
    with sole_writer(study):
        for words in (("status",), ("export",), ("report", "--no-figures")):
            said = podusv("sweep", words[0], study, *words[1:])
            assert said.code == 0, said.err
    with sole_writer(study, TABLES):
        assert podusv("sweep", "report", study, "--no-figures").code == 5
        assert podusv("sweep", "status", study).code == 0


@pytest.mark.slow
def test_a_driver_waits_for_the_tables(study, podusv, monkeypatch):
    """A report is being written; were it never to end, the runs would be kept all the same."""
    monkeypatch.setattr("podusv_cli.workflows.sweep.PATIENCE", 0.1)
    with sole_writer(study, TABLES):
        said = podusv("sweep", "run", study, "--draws", "6", "--no-figures")
        assert said.code == 5
        assert said.err.count(f"process ({os.getpid()} on ") == 2  # while it waits, and at the end
        assert "waiting 0.1 s at most" in said.err
        assert "6" in podusv("sweep", "status", study).out
    assert podusv("sweep", "run", study, "--draws", "6", "--no-figures").code == 0


def test_a_report_is_of_the_draws_that_are_there_when_it_has_the_lock(study, monkeypatch):
    @contextmanager
    def late(*given):
        made(study, draws=8)  # by another process, after the command began
        (study / SCENARIO).write_text(TEXT.replace("draws: 40", "draws: 8"))
        with sole_writer(*given):
            yield

    monkeypatch.setattr(sweep, "sole_writer", late)
    done = sweep.report(study, sweep.Request(figures=False))
    assert (done.tally.made, done.tally.wanted) == (16, 16)


@pytest.mark.parametrize("number", [errno.ENOSYS, errno.ENOLCK])
def test_a_disk_without_locks_is_refused(study, monkeypatch, number):
    def flock(*given):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", flock)
    said = f"{study}: its file system has no locks"
    with pytest.raises(StorageError, match=said), sole_writer(study):
        pass


@pytest.mark.parametrize("words", [("run", "."), ("run", "{config}", "--out", ".")])
def test_the_folder_may_be_the_current_one(study, tmp_path, podusv, monkeypatch, words):
    monkeypatch.chdir(study)
    config = written(tmp_path / "small.yaml", ("draws: 40", "draws: 4"))
    said = podusv("sweep", *(word.format(config=config) for word in words), "--no-figures")
    assert said.code == 0, said.err


@pytest.mark.slow
def test_a_killed_driver_leaves_no_lock(tmp_path, podusv, monkeypatch):
    monkeypatch.chdir(tmp_path)
    config = written(tmp_path / "small.yaml", ("duration: 1.0", "duration: 400.0"))
    words = ("sweep", "run", str(config), "--out", "study", "--no-figures", "--workers", "2")
    with under_way(*words) as driver:
        wait_for("study/units/*.unit")
        said = podusv(*words)
        assert said.code == 5
        assert f"({driver.pid} on " in said.err
        os.kill(driver.pid, signal.SIGKILL)  # its workers are still there
        driver.wait()
        assert podusv(*words, "--set", "sweep.draws=40", "--until", "1s").code == 0


LINKS = ["units", "figures", "logs", "report.html"]


@pytest.mark.parametrize("name", LINKS)
def test_nothing_is_written_through_a_link(study, tmp_path, podusv, name):
    outside = tmp_path / "outside"
    outside.mkdir()
    if (study / name).exists():
        shutil.rmtree(study / name)
    (study / name).symlink_to(outside)
    before = contents(study)
    for words in (("run", study, "--draws", "6"), ("report", study)):
        said = podusv("sweep", *words)
        assert said.code == 5
        assert f"{study / name} is a symbolic link" in said.err
    assert contents(study) == before
    assert not list(outside.iterdir())


def test_a_lock_is_no_content_of_a_new_folder(tmp_path, podusv):
    config = written(tmp_path / "small.yaml", ("draws: 40", "draws: 4"))
    (tmp_path / "new").mkdir()
    (tmp_path / "new" / writer.RUNS).touch()  # of a process that was killed
    assert podusv("sweep", "run", config, "--out", tmp_path / "new", "--no-figures").code == 0
    assert Path(tmp_path / "new/manifest.json").exists()
    assert writer.TABLES not in Path(tmp_path / "new/manifest.json").read_text()
