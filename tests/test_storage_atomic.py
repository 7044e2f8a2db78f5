"""One file, whole or not at all, whatever fails on the way."""

import errno
import os
import re

import pytest
from storage_samples import (
    Saboteur,
    durable_steps,
    fails,
    files,
    interrupts,
    until_nothing_breaks,
)

from podusv_cli.core.errors import StorageError
from podusv_cli.storage import files as atomic

OLD, NEW = b"old" * 1000, b"new" * 2000
CALLS = ("open", "write", "fsync", "replace", "close")


@pytest.fixture
def path(tmp_path):
    file = tmp_path / "metrics.json"
    file.write_bytes(OLD)
    return file


def in_pieces(patch: pytest.MonkeyPatch) -> None:
    """Let the system take at most 700 bytes at once, as it may."""
    write = os.write
    patch.setattr(os, "write", lambda descriptor, content: write(descriptor, content[:700]))


def test_writes_and_replaces(tmp_path, path, monkeypatch):
    in_pieces(monkeypatch)
    atomic.write_bytes(path, NEW)
    atomic.write_bytes(tmp_path / "empty", b"")
    assert files(tmp_path) == {"metrics.json": NEW, "empty": b""}


def test_it_lasts_before_it_has_its_name_and_then_so_does_the_name(path, monkeypatch):
    steps = durable_steps(monkeypatch)
    atomic.write_bytes(path, NEW)
    (first, part), *rest = steps
    assert first == "sync"
    assert re.fullmatch(rf"{path.parent}/\.podusv-[0-9a-f-]+\.part", part)
    assert rest == [("name", str(path)), ("sync", str(path.parent))]


def test_others_may_read_what_the_user_lets_them(path):
    before = os.umask(0o027)
    try:
        atomic.write_bytes(path, NEW)
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize("deed", [fails(errno.ENOSPC), fails(errno.EIO), interrupts])
def test_a_failure_at_any_step_leaves_the_old_file_or_the_new_one(path, deed):
    def attempt(saboteur: Saboteur) -> None:
        path.write_bytes(OLD)
        with pytest.MonkeyPatch.context() as patch:
            in_pieces(patch)
            saboteur.watch(patch, *CALLS)
            try:
                atomic.write_bytes(path, NEW)
            except (StorageError, KeyboardInterrupt):
                assert saboteur.struck
            else:
                assert not saboteur.struck

    seen = []
    for _ in until_nothing_breaks(attempt, deed):
        assert list(files(path.parent)) == [path.name], "something was left behind"
        seen.append(path.read_bytes())
    assert set(seen) == {OLD, NEW}
    assert seen == sorted(seen, reverse=True), "once new, it stays new"
    assert len(seen) > len(NEW) / 700 + 6, "every write was sabotaged"


def test_a_disk_that_fills_up_leaves_all_of_several_files(path):
    """None is new unless all are."""
    contents = {path: NEW, path.with_name("metrics.csv"): NEW}

    def attempt(saboteur: Saboteur) -> None:
        with pytest.MonkeyPatch.context() as patch:
            in_pieces(patch)
            saboteur.watch(patch, "write")
            try:
                atomic.write_all(contents)
            except StorageError:
                assert files(path.parent) == {path.name: OLD}

    for _ in until_nothing_breaks(attempt, fails(errno.ENOSPC)):
        pass
    assert files(path.parent) == {each.name: content for each, content in contents.items()}


@pytest.mark.parametrize(
    ("number", "cause"),
    [
        (errno.ENOSPC, "the disk is full"),
        (errno.EDQUOT, "the disk quota is used up"),
        (errno.EACCES, "not permitted"),
        (errno.EROFS, "the file system is read-only"),
        (errno.EIO, os.strerror(errno.EIO)),
    ],
)
def test_one_sentence_names_path_size_and_cause(path, monkeypatch, number, cause):
    Saboteur(fails(number), 1).watch(monkeypatch, "write")
    with pytest.raises(StorageError) as caught:
        atomic.write_bytes(path, NEW)
    assert str(caught.value) == f"cannot write {path} (6000 bytes): {cause}"


def test_a_folder_that_is_missing_or_a_file(tmp_path, path):
    with pytest.raises(StorageError, match="no such file or folder"):
        atomic.write_bytes(tmp_path / "nowhere/log.h5", NEW)
    with pytest.raises(StorageError, match="is a file, not a folder"):
        atomic.write_bytes(path / "log.h5", NEW)
    assert path.read_bytes() == OLD


def test_file_systems_that_cannot_sync_folders_are_good_enough(path, monkeypatch):
    Saboteur(fails(errno.EINVAL), 2).watch(monkeypatch, "fsync")
    atomic.write_bytes(path, NEW)
    assert path.read_bytes() == NEW


def test_create_never_touches_a_file_that_is_there(path):
    with pytest.raises(StorageError, match="exists"):
        atomic.create(path, NEW)
    assert path.read_bytes() == OLD
