"""Folders in the making: at the same time, failing and killed at every step, left behind."""

import errno
import os
import shutil
import subprocess
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import pytest
from storage_samples import (
    ENVIRONMENT,
    NEW,
    OLD,
    PYTHON,
    Saboteur,
    beside,
    content,
    fails,
    interrupts,
    kills,
    until_nothing_breaks,
    write,
)

from podusv_cli.core.errors import StorageError
from podusv_cli.storage import manifest, staging
from podusv_cli.storage.run_folder import RunWriter

CALLS = ("mkdir", "write", "fsync", "replace", "rename")
DEADLY = (*CALLS, "open", "unlink", "rmdir")


@pytest.fixture
def final(tmp_path):
    return tmp_path / "results" / "run"


@pytest.mark.parametrize("named", [False, True])
def test_of_two_writers_the_first_to_finish_wins_and_the_other_keeps_what_it_has(final, named):
    """An error only where the user asked for this very name."""
    with RunWriter(final, named=named) as one, RunWriter(final, force=not named) as other:
        one.add("log.h5", b"one")
        other.add("log.h5", b"other")
        assert other.finish("finished") == final
        if named:
            with pytest.raises(StorageError, match=r"exists already; .* in .*/run-2 instead"):
                one.finish("finished")
        else:
            assert one.finish("finished").name == "run-2"
    assert content(final) == {"log.h5": b"other"}
    assert content(final.with_name("run-2")) == {"log.h5": b"one"}
    assert beside(final) == {"run-2"}


@pytest.mark.parametrize("named", [False, True])
def test_a_name_that_nobody_asked_for_is_never_taken_from_another_run(final, named):
    with RunWriter(final, force=True, named=named) as writer:
        writer.add("log.h5", b"new")
        write(final, OLD)
        writer.finish("finished")
    assert content(final) == ({"log.h5": b"new"} if named else OLD)
    assert beside(final) == (set() if named else {"run-2"})


def test_a_lesser_one_takes_no_place(final):
    write(final, OLD)
    with RunWriter(final, force=True) as writer:
        writer.add("log.h5", b"half")
        with pytest.raises(StorageError, match=r"full; .*left as it is; .* in .*/run-2 instead"):
            writer.finish("finished", "the disk is full")
    assert content(final) == OLD
    assert content(final.with_name("run-2")) == {"log.h5": b"half"}


@pytest.fixture(params=[True, False], ids=["exchanging", "plain"])
def exchanging(request, monkeypatch):
    """Whether the file system lets two names trade places."""
    if not request.param:
        monkeypatch.setattr(staging, "exchange", lambda one, other: fails(errno.EINVAL)())
    return bool(request.param)


@pytest.mark.parametrize("force", [False, True])
def test_writers_that_finish_at_the_same_time(final, force, exchanging):
    writers = [RunWriter(final, force=force) for _ in range(8)]
    for number, writer in enumerate(writers):
        writer.add("log.h5", bytes([number]) * 1000)
    start = Barrier(len(writers))

    def race(number: int) -> int | None:
        with writers[number] as writer:
            start.wait()
            try:
                writer.finish("finished")
            except StorageError:
                return None
        return number

    with ThreadPoolExecutor(len(writers)) as pool:
        winners = [number for number in pool.map(race, range(8)) if number is not None]
    found = content(final)["log.h5"]
    assert found in [bytes([number]) * 1000 for number in winners]
    assert force or len(winners) == 1
    assert not (force and exchanging) or len(winners) == 8
    others = {content(final.with_name(name))["log.h5"][0] for name in beside(final)}
    assert others == set(range(8)) - set(winners)


def test_a_folder_that_is_renamed_while_it_is_looked_at_costs_no_result(final, monkeypatch):
    def gone(folder: Path, found: manifest.Manifest) -> list[str]:
        raise StorageError(f"cannot list {folder}: no such file or folder")

    with RunWriter(final) as writer:
        writer.finish("finished")
    with RunWriter(final, force=True) as writer:
        writer.add("log.h5", b"new")
        monkeypatch.setattr(manifest, "foreign", gone)
        with pytest.raises(StorageError, match=r"this result is in .*/run-2 instead"):
            writer.finish("finished")
    assert content(final.with_name("run-2")) == {"log.h5": b"new"}


@pytest.mark.parametrize("deed", [fails(errno.ENOSPC), interrupts])
@pytest.mark.parametrize("before", [None, OLD])
def test_a_failure_at_any_step_leaves_the_old_run_or_the_new_one(final, before, deed, exchanging):
    def attempt(saboteur: Saboteur) -> None:
        shutil.rmtree(final, ignore_errors=True)
        if before:
            write(final, before)
        with pytest.MonkeyPatch.context() as patch:
            saboteur.watch(patch, *CALLS)
            try:
                write(final, NEW, force=True)
            except (StorageError, KeyboardInterrupt):
                assert saboteur.struck

    seen = []
    for _ in until_nothing_breaks(attempt, deed):
        assert not final.parent.exists() or beside(final) == set()
        seen.append(content(final) if final.exists() else None)
    assert len(seen) > 15
    assert before in seen
    assert seen[-1] == NEW
    assert all(found in (before, NEW) for found in seen)


def in_a_child(work: Callable[[], object]) -> None:
    """Do something in a process of its own and wait for its end, however it comes."""
    child = os.fork()
    if child == 0:
        try:
            work()
        finally:
            os._exit(0)
    os.waitpid(child, 0)


@pytest.mark.slow
@pytest.mark.parametrize("lost", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_killed_at_any_step_the_old_run_or_the_new_one_comes_back(final, lost, exchanging):
    """`lost`: somebody deletes the folder before the next run clears up; no half of one appears.

    It need not even come back where names can trade places: it was there all the time.
    """
    other = final.with_name("other")

    def attempt(saboteur: Saboteur) -> None:
        write(final, OLD, force=True)

        def replace() -> None:
            with pytest.MonkeyPatch.context() as patch:
                saboteur.watch(patch, *DEADLY)
                write(final, NEW, force=True)
            os.write(survived, b"!")

        alive, survived = os.pipe()
        in_a_child(replace)
        os.close(survived)
        saboteur.left = 1 if os.read(alive, 1) else 0
        os.close(alive)

    seen = []
    for _ in until_nothing_breaks(attempt, kills):
        assert not exchanging or content(final) in (OLD, NEW)
        if lost:
            shutil.rmtree(final, ignore_errors=True)
        write(other, NEW, force=True)  # the next run to the same place clears up
        assert beside(final) == {"other"}
        seen.append(content(final) if final.exists() else None)
    assert len(seen) > 30
    assert (OLD in seen) != (lost and exchanging)
    assert seen[-1] == (None if lost else NEW)
    assert all(found in ((None, OLD) if lost else (OLD, NEW)) for found in seen)


def test_what_a_live_run_is_making_is_left_alone(final):
    code = (
        "import sys; from pathlib import Path\n"
        "from podusv_cli.storage.run_folder import RunWriter\n"
        "writer = RunWriter(Path(sys.argv[1])); writer.add('log.h5', b'live')\n"
        "print('ready', flush=True); sys.stdin.read(); writer.finish('finished')\n"
    )
    with subprocess.Popen(
        [PYTHON, "-c", code, str(final)],
        env=ENVIRONMENT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    ) as live:
        assert live.stdout is not None
        assert live.stdout.readline() == b"ready\n"
        write(final.with_name("other"), NEW)
        live.communicate(b"", timeout=60)
    assert content(final) == {"log.h5": b"live"}
    assert beside(final) == {"other"}


def test_a_nested_run_that_was_killed_leaves_no_trace(final):
    def die() -> None:
        RunWriter(several.folder / "pid").add("log.h5", b"half a log")
        kills()

    with RunWriter(final) as several:
        in_a_child(die)
        several.add("comparison.csv", b"controller,iae\n")
        several.finish("finished")
    assert content(final) == {"comparison.csv": b"controller,iae\n"}
