"""What podusv does where a system lacks what Linux has: tests with an `os` that lacks it, too."""

import errno
import ntpath
import os
import signal
import subprocess
import sys
import tempfile
from contextlib import nullcontext
from functools import partial
from pathlib import Path, PureWindowsPath
from types import SimpleNamespace

import numpy as np
import pytest

from podusv_cli.core import system
from podusv_cli.process import code_folder, temporary_names
from podusv_cli.scenario import yaml_text
from podusv_cli.scenario.yaml_tree import Mark
from podusv_cli.storage import files, staging, writer

LACKING = (  # what Windows lacks of what podusv uses
    "O_CLOEXEC",
    "O_DIRECTORY",
    "O_NOFOLLOW",
    "O_NONBLOCK",
    "getuid",
    "posix_fallocate",
    "sched_getaffinity",
    "sysconf",
)
NO_EXCHANGE = OSError(errno.ENOSYS, "no such call")


@pytest.fixture
def elsewhere(monkeypatch, tmp_path):  # pytest asks `os.getuid` where that lies
    """This process as one on Windows, as far as names of `os` tell."""
    for name in LACKING:
        monkeypatch.delattr(os, name, raising=False)


def test_flags_that_a_system_lacks_are_left_out(elsewhere):
    assert system.open_flags("O_RDONLY", "O_NOFOLLOW", "O_CLOEXEC") == os.O_RDONLY


def test_files_are_opened_for_bytes_where_text_is_the_default(monkeypatch):
    monkeypatch.setattr(os, "O_BINARY", 1 << 20, raising=False)
    assert system.open_flags("O_WRONLY") == os.O_WRONLY | 1 << 20


def test_files_are_written_and_read(elsewhere, tmp_path):
    content = b"\x89HDF\r\n\x1a\n\n\r"
    files.write_all({tmp_path / "a.bin": content})
    assert (tmp_path / "a.bin").read_bytes() == content
    with files.open_regular(tmp_path / "a.bin") as file:
        assert file.read() == content
    faults = []
    (tmp_path / "a.yaml").write_text("a: 1\n")
    assert yaml_text.read_text(str(tmp_path / "a.yaml"), Mark("a"), "", faults) == "a: 1\n"
    assert faults == []


def test_a_long_log_lies_in_a_file_of_its_size(elsewhere, tmp_path):
    array = files.disk_array(tmp_path, 1000)
    array[:] = np.arange(1000.0)
    assert array.sum() == 499_500.0


def test_a_log_that_is_mapped_lies_in_no_folder_that_is_renamed(monkeypatch, tmp_path):
    """Windows gives a mapped file a name, and renames no folder with it inside."""
    asked = []

    def make(dir=None):
        asked.append(dir)
        return tempfile.TemporaryFile(dir=tmp_path)

    monkeypatch.setattr(files, "tempfile", SimpleNamespace(TemporaryFile=make))
    monkeypatch.setattr(files, "os", SimpleNamespace(name="nt"))
    array = files.disk_array(tmp_path / "new", 10)
    array[:] = 1.0
    assert (asked, array.sum()) == ([None], 10.0)


def rename_as_windows(source, target, *, busy=None):
    """`os.rename` as it is there: no folder is replaced, and one with an open file stays."""
    if busy:
        busy.pop()
        raise PermissionError(errno.EACCES, "in use")
    if os.path.lexists(target):
        raise FileExistsError(errno.EEXIST, "exists")
    rename(source, target)


rename = os.rename


def on_windows(monkeypatch, busy=None):
    """The names of `os` as renaming finds them there, with `busy` attempts that fail."""
    own = SimpleNamespace(
        name="nt", rmdir=os.rmdir, rename=partial(rename_as_windows, busy=busy), path=os.path
    )
    monkeypatch.setattr(system, "os", own)


def test_a_folder_takes_the_place_of_an_empty_one_where_rename_replaces_none(monkeypatch, tmp_path):
    for name in ("a", "empty", "full"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "x").touch() if name != "empty" else None
    on_windows(monkeypatch)
    with pytest.raises(FileExistsError):
        system.rename_folder(tmp_path / "a", tmp_path / "full")
    system.rename_folder(tmp_path / "a", tmp_path / "empty")
    assert [path.name for path in (tmp_path / "empty").iterdir()] == ["x"]


@pytest.mark.parametrize("more", [0, 1])
def test_a_folder_with_a_file_that_is_open_for_a_moment_is_renamed(monkeypatch, tmp_path, more):
    (tmp_path / "a").mkdir()
    on_windows(monkeypatch, busy=[None] * (system.TRIES - 1 + more))
    monkeypatch.setattr(system, "PAUSE", 0.0)
    with pytest.raises(PermissionError) if more else nullcontext():
        system.rename_folder(tmp_path / "a", tmp_path / "b")
    assert (tmp_path / "b").exists() == (not more)


def test_a_run_is_written_and_replaced_with_the_calls_that_windows_has(monkeypatch, tmp_path):
    on_windows(monkeypatch)
    monkeypatch.setattr(staging, "exchange", lambda one, other: (_ for _ in ()).throw(NO_EXCHANGE))
    for content in (b"old", b"new"):
        made = staging.Staging(tmp_path / "run")
        files.create(made.folder / "log", content)
        made.publish(replace=True)
    assert (tmp_path / "run/log").read_bytes() == b"new"
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_an_open_file_is_read_by_the_name_that_a_system_gives_it(monkeypatch, tmp_path):
    assert system.name_of_open_file(7, tmp_path / "log.h5") == "/dev/fd/7"
    monkeypatch.setattr(system, "os", SimpleNamespace(name="nt"))
    assert system.name_of_open_file(7, tmp_path / "log.h5") == str(tmp_path / "log.h5")


def test_paths_in_files_are_written_as_every_system_reads_them(monkeypatch, tmp_path):
    assert system.relative_path(tmp_path / "a/b.csv", tmp_path / "c") == "../a/b.csv"
    monkeypatch.setattr(os.path, "relpath", ntpath.relpath)
    monkeypatch.setattr(system, "Path", PureWindowsPath)
    assert system.relative_path("C:\\data\\a\\b.csv", "C:\\data\\c") == "../a/b.csv"


def test_a_folder_is_free_again_where_its_lock_cannot_be_removed_while_it_is_held(
    monkeypatch, tmp_path
):
    def unlink(path, missing_ok=False):
        raise PermissionError(errno.EACCES, "in use")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", unlink)
        with writer.sole_writer(tmp_path):
            pass
    with writer.sole_writer(tmp_path):
        pass


def test_files_of_an_archive_are_synced_one_by_one_without_the_system_call(monkeypatch, tmp_path):
    monkeypatch.delattr(os, "sync")
    assert not system.sync_disk()
    (tmp_path / "a").write_bytes(b"x")
    files.sync_file(tmp_path / "a")
    assert (tmp_path / "a").read_bytes() == b"x"


def test_two_folders_are_exchanged_in_two_steps_without_the_system_call(monkeypatch, tmp_path):
    monkeypatch.setattr(staging, "os", SimpleNamespace(name="nt", strerror=os.strerror))
    with pytest.raises(OSError, match=os.strerror(38)):
        staging.exchange(tmp_path / "a", tmp_path / "b")


def test_compiled_code_has_its_folder_where_owners_are_not_told(elsewhere, tmp_path, monkeypatch):
    monkeypatch.setenv("PODUSV_CACHE", str(tmp_path / "cache"))
    assert code_folder.code_folder.__wrapped__("0" * 16) == tmp_path / "cache" / ("0" * 16)


def test_a_process_that_runs_is_asked_for_and_not_ended():
    child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    try:
        assert system.is_running(child.pid)
        assert child.poll() is None
    finally:
        child.communicate(b"\n")
    assert not system.is_running(child.pid)
    assert system.is_running(2**70)
    assert system.is_running(os.getpid())


def test_unfinished_files_of_processes_that_ended_are_found(tmp_path, monkeypatch):
    name = temporary_names.temporary_name("log")
    (tmp_path / name).touch()
    assert list(temporary_names.find_abandoned(tmp_path)) == []
    monkeypatch.setattr(temporary_names, "is_running", lambda _: False)
    assert list(temporary_names.find_abandoned(tmp_path)) == [(tmp_path / name, "log")]


def test_cores_and_memory_are_those_of_this_machine():
    assert system.usable_cores() == len(os.sched_getaffinity(0))
    pages = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    assert system.physical_memory() == pages


def test_signals_are_those_that_this_system_has():
    assert {signal.SIGINT, signal.SIGTERM, signal.SIGHUP} == {*system.SIGNALS}
