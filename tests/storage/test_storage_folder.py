"""Run folders appear whole, replace only what they may, and open again."""

from __future__ import annotations

import errno
import os
import re
from datetime import UTC, datetime
from pathlib import Path

import pytest
from old_results import draw_quickly
from storage_samples import (
    NEW,
    OLD,
    YAML,
    Saboteur,
    assert_same,
    beside,
    content,
    durable_steps,
    fails,
    files,
    interrupts,
    log,
    recording,
    until_nothing_breaks,
    write,
)

from podusv_cli.core.errors import StorageError
from podusv_cli.storage import files as atomic
from podusv_cli.storage import manifest
from podusv_cli.storage.run_folder import RunWriter, default_folder, open_run


@pytest.fixture
def final(tmp_path):
    return tmp_path / "results" / "run"


def run_to(final: Path, **how: bool) -> Path:
    """A complete run folder."""
    with RunWriter(final, **how) as writer:
        writer.add("scenario.yaml", b"name: a\n")
        writer.add("resolved.yaml", YAML.encode())
        writer.add("log.h5", log())
        writer.add_json(
            "metrics.json", {"status": "finished", "metrics": {"iae": 1.5, "ise": None}}
        )
        writer.add_json("provenance.json", {"podusv": "1.2.3"})
        return writer.finish("finished")


def test_a_folder_appears_only_when_it_is_finished(final):
    with RunWriter(final) as writer:
        for name, part in NEW.items():
            writer.add(name, part)
        assert not final.exists()
        assert all(name.startswith(".") for name in beside(final))
        assert writer.finish("finished") == final
    assert content(final) == NEW
    assert beside(final) == set()
    assert manifest.read(final).status == "finished"


def test_everything_in_it_lasts_before_it_has_its_name(final, monkeypatch):
    steps = durable_steps(monkeypatch)
    with RunWriter(final) as writer:
        for name, part in NEW.items():
            writer.add(name, part)
        making = writer.folder
        writer.finish("finished")
    named = steps.index(("name", str(final)))
    before = {path for step, path in steps[:named] if step == "sync"}
    assert {str(making), str(making / "figures"), *(str(making / name) for name in NEW)} <= before
    assert ("sync", str(final.parent)) in steps[named:]


def test_every_file_of_a_run_is_synced_before_the_run_has_its_name(podusv, monkeypatch):
    """The log, too, which is written in another way than the other files."""
    steps = durable_steps(monkeypatch)
    draw_quickly(monkeypatch)
    assert podusv("run", "a.yaml", "--out", "x", "-q").code == 0
    named = [Path(path).name if step == "name" else "" for step, path in steps].index("x")
    synced = {Path(path).name for step, path in steps[:named] if step == "sync"}
    made = {path.name for path in Path("x").rglob("*") if path.is_file()}
    assert {"log.h5", "metrics.json", "errors.png"} <= made
    assert made - synced == {"manifest.json"}  # which is synced under a hidden name


def test_without_finish_nothing_is_left(final):
    with RunWriter(final) as writer:
        writer.add("log.h5", b"new log")
    assert list(final.parent.iterdir()) == []


def test_a_file_is_written_once_and_only_inside(final):
    with RunWriter(final) as writer:
        writer.add("figures/a.png", b"a")
        for name in ("../a", "/tmp/a", "a/../../a", "", ".", "manifest.json", "a\0b", "figures/"):
            with pytest.raises(StorageError, match="is no file of this folder"):
                writer.add(name, b"b")
        with pytest.raises(StorageError, match="exists"):
            writer.add("figures/a.png", b"b")
        assert files(writer.folder) == {"figures/a.png": b"a"}


def test_a_finished_folder_needs_force(final):
    write(final, OLD)
    with pytest.raises(StorageError, match="exists already; --force replaces it"):
        RunWriter(final)
    assert content(final) == OLD
    write(final, NEW, force=True)
    assert content(final) == NEW
    assert beside(final) == set()


@pytest.mark.parametrize("name", ["notes.txt", "figures/mine.png"])
def test_files_that_others_put_into_a_run_folder_are_not_removed(final, name):
    write(final, OLD)
    (final / ".DS_Store").touch()  # of a system that shows folders
    write(final, OLD, force=True)
    (final / name).write_text("mine")
    before = files(final)
    says = f"run holds {name}, which is not the run's; --force would remove it"
    with pytest.raises(StorageError, match=re.escape(says)):
        RunWriter(final, force=True)
    assert files(final) == before


@pytest.mark.parametrize("force", [False, True])
def test_what_is_no_run_folder_is_never_replaced(final, force):
    final.mkdir(parents=True)
    (final / "thesis.tex").write_text("ten years")
    with pytest.raises(StorageError, match="not a finished run folder; name another folder with"):
        RunWriter(final, force=force)
    (final / "manifest.json").write_text('{"files": {}}')  # of some other program
    with pytest.raises(StorageError, match=re.escape(f"{final} exists")):
        RunWriter(final, force=force)
    assert beside(final) == set()
    assert (final / "thesis.tex").read_text() == "ten years"


@pytest.mark.parametrize("force", [False, True])
def test_what_became_no_run_folder_meanwhile_is_not_replaced(final, force):
    with RunWriter(final, force=force) as writer:
        writer.add("log.h5", b"new log")
        final.mkdir()
        (final / "thesis.tex").write_text("ten years")
        with pytest.raises(StorageError, match=re.escape(f"{final} exists")):
            writer.finish("finished")
    assert files(final) == {"thesis.tex": b"ten years"}
    assert content(final.with_name("run-2")) == {"log.h5": b"new log"}
    assert beside(final) == {"run-2"}


@pytest.mark.parametrize("force", [False, True])
def test_an_empty_folder_may_be_filled(final, force):
    final.mkdir(parents=True)
    write(final, NEW, force=force)
    assert content(final) == NEW


@pytest.mark.parametrize("force", [False, True])
def test_files_and_links_are_not_replaced(final, force):
    final.parent.mkdir()
    final.write_text("precious")
    link = final.with_name("latest")
    link.symlink_to(write(final.with_name("real"), OLD))
    for place in (final, link, final.parent / "..", Path("/")):
        with pytest.raises(StorageError, match=r"is not a folder|own name is needed"):
            RunWriter(place, force=force)
    assert final.read_text() == "precious"
    assert content(link.resolve()) == OLD


def test_a_finished_run_opens_with_all_that_plots_and_comparisons_need(final):
    run = open_run(run_to(final))
    assert run.path == final
    assert run.status == "finished"
    assert run.metrics == {"iae": 1.5, "ise": None}
    assert run.provenance == {"podusv": "1.2.3"}
    assert run.resolved_yaml == YAML
    assert_same(recording(), run.recording)
    assert run.recording is run.recording


def test_only_finished_runs_open(final, tmp_path):
    with pytest.raises(StorageError, match="no such file"):
        open_run(tmp_path / "nowhere")
    with pytest.raises(StorageError, match="no such file"):
        open_run(tmp_path)
    write(final, OLD)
    with pytest.raises(StorageError, match=r"not the folder of a run: it has no metrics\.json"):
        open_run(final)
    run_to(final, force=True)
    (final / "resolved.yaml").unlink()
    with pytest.raises(StorageError, match=r"resolved\.yaml is missing"):
        open_run(final)


@pytest.mark.parametrize("metrics", [{}, {"metrics": [1.0]}])
def test_metrics_of_another_shape_do_not_open(final, metrics):
    with RunWriter(final) as writer:
        for name in ("resolved.yaml", "log.h5", "provenance.json"):
            writer.add(name, b"{}")
        writer.add_json("metrics.json", metrics)
        writer.finish("finished")
    with pytest.raises(StorageError, match="holds no metrics"):
        open_run(final)


def test_the_default_folder_tells_time_and_scenario(tmp_path):
    before = datetime.now(UTC).replace(microsecond=0)
    folder = default_folder(tmp_path, "ferry", YAML)
    assert folder.parent == tmp_path / "ferry"
    stamp, digest = folder.name.split("-")
    when = datetime.strptime(stamp, "%Y%m%dT%H%M%SZ").replace(tzinfo=UTC)
    assert before <= when <= datetime.now(UTC)
    assert re.fullmatch("[0-9a-f]{8}", digest)
    assert digest == default_folder(tmp_path, "tug", YAML).name.split("-")[1]
    assert digest != default_folder(tmp_path, "tug", YAML + " ").name.split("-")[1]


def test_a_second_run_in_the_same_second_has_a_name_of_its_own(tmp_path, monkeypatch):
    class Clock(datetime):
        @classmethod
        def now(cls, tz: object = None) -> Clock:
            return cls(2026, 1, 1, 12, tzinfo=UTC)

    monkeypatch.setattr("podusv_cli.storage.run_folder.datetime", Clock)
    for ending in ("", "-2", "-3"):
        folder = default_folder(tmp_path, "ferry", YAML)
        assert folder.name == f"20260101T120000Z-{folder.name[17:25]}{ending}"
        folder.mkdir(parents=True)


# --- one file, whole or not at all, whatever fails on the way

WAS, BECOMES = b"old" * 1000, b"new" * 2000
CALLS = ("open", "write", "fsync", "replace", "close")


@pytest.fixture
def path(tmp_path):
    file = tmp_path / "metrics.json"
    file.write_bytes(WAS)
    return file


def in_pieces(patch: pytest.MonkeyPatch) -> None:
    """Let the system take at most 700 bytes at once, as it may."""
    write = os.write
    patch.setattr(os, "write", lambda descriptor, content: write(descriptor, content[:700]))


def test_writes_and_replaces(tmp_path, path, monkeypatch):
    in_pieces(monkeypatch)
    atomic.write_bytes(path, BECOMES)
    atomic.write_bytes(tmp_path / "empty", b"")
    assert files(tmp_path) == {"metrics.json": BECOMES, "empty": b""}


def test_it_lasts_before_it_has_its_name_and_then_so_does_the_name(path, monkeypatch):
    steps = durable_steps(monkeypatch)
    atomic.write_bytes(path, BECOMES)
    (first, part), *rest = steps
    assert first == "sync"
    assert re.fullmatch(rf"{path.parent}/\.podusv-[0-9a-f-]+\.part", part)
    assert rest == [("name", str(path)), ("sync", str(path.parent))]


def test_others_may_read_what_the_user_lets_them(path):
    before = os.umask(0o027)
    try:
        atomic.write_bytes(path, BECOMES)
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize("deed", [fails(errno.ENOSPC), fails(errno.EIO), interrupts])
def test_a_failure_at_any_step_leaves_the_old_file_or_the_new_one(path, deed):
    def attempt(saboteur: Saboteur) -> None:
        path.write_bytes(WAS)
        with pytest.MonkeyPatch.context() as patch:
            in_pieces(patch)
            saboteur.watch(patch, *CALLS)
            try:
                atomic.write_bytes(path, BECOMES)
            except (StorageError, KeyboardInterrupt):
                assert saboteur.struck
            else:
                assert not saboteur.struck

    seen = []
    for _ in until_nothing_breaks(attempt, deed):
        assert list(files(path.parent)) == [path.name], "something was left behind"
        seen.append(path.read_bytes())
    assert set(seen) == {WAS, BECOMES}
    assert seen == sorted(seen, reverse=True), "once new, it stays new"
    assert len(seen) > len(BECOMES) / 700 + 6, "every write was sabotaged"


def test_a_disk_that_fills_up_leaves_all_of_several_files(path):
    """None is new unless all are."""
    contents = {path: BECOMES, path.with_name("metrics.csv"): BECOMES}

    def attempt(saboteur: Saboteur) -> None:
        with pytest.MonkeyPatch.context() as patch:
            in_pieces(patch)
            saboteur.watch(patch, "write")
            try:
                atomic.write_all(contents)
            except StorageError:
                assert files(path.parent) == {path.name: WAS}

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
        atomic.write_bytes(path, BECOMES)
    assert str(caught.value) == f"cannot write {path} (6000 bytes): {cause}"


def test_a_folder_that_is_missing_or_a_file(tmp_path, path):
    with pytest.raises(StorageError, match="no such file or folder"):
        atomic.write_bytes(tmp_path / "nowhere/log.h5", BECOMES)
    with pytest.raises(StorageError, match="is a file, not a folder"):
        atomic.write_bytes(path / "log.h5", BECOMES)
    assert path.read_bytes() == WAS


def test_file_systems_that_cannot_sync_folders_are_good_enough(path, monkeypatch):
    Saboteur(fails(errno.EINVAL), 2).watch(monkeypatch, "fsync")
    atomic.write_bytes(path, BECOMES)
    assert path.read_bytes() == BECOMES


def test_create_never_touches_a_file_that_is_there(path):
    with pytest.raises(StorageError, match="exists"):
        atomic.create(path, BECOMES)
    assert path.read_bytes() == WAS
