"""What podusv does where a system lacks what Linux has: tests with an `os` that lacks it, too."""

import os
import signal
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from podusv_cli.core import system
from podusv_cli.process import code_folder, temporary_names
from podusv_cli.scenario import yaml_text
from podusv_cli.scenario.yaml_tree import Mark
from podusv_cli.storage import files, staging

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
