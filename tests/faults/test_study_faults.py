"""A study after killed processes and failed writes has the bytes of an undisturbed one."""

import errno
import math
import os
import random
import signal
import subprocess
import sys
import time

import pytest
from counts import count
from small_study import TEXT, made, small
from storage_samples import Saboteur, fails

from podusv_cli.core.errors import StorageError
from podusv_cli.storage import files
from podusv_cli.studies.making.record import about
from podusv_cli.studies.making.store import RUNS, Store
from podusv_cli.workflows import sweep

KILLS, WRITES = count(2, 200), count(4, 60)
LONGER = TEXT.replace("duration: 1.0", "duration: 20.0").replace("draws: 40", "draws: 300")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return made(tmp_path_factory.mktemp("whole") / "study")


def content(store):
    return (store.folder / RUNS).read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("error", [errno.EIO, errno.ENOSPC])
def test_after_a_failed_write_the_study_goes_on(whole, tmp_path, error):
    """The n-th call that writes, names or syncs fails; what was whole before is still there."""
    nth, failed = 1, True
    while failed and nth <= 400:
        failed = sabotaged(tmp_path / str(nth), nth, error)
        again = made(tmp_path / str(nth))
        assert content(again) == content(whole), nth
        left = [path.name for path in again.folder.rglob("*") if ".podusv-" in path.name]
        assert not left
        nth += count(11, 1)


def sabotaged(folder, nth, code):
    """Whether the call failed before the study was whole; a StorageError says that it did."""
    calls = []
    saboteur = Saboteur(lambda: (calls.append(nth), fails(code)())[1], nth)
    with pytest.MonkeyPatch.context() as patch:
        saboteur.watch(patch, "write", "fsync", "replace")
        try:
            made(folder)
            told = ""
        except StorageError as error:
            told = str(error)
    assert not told or (calls and "cannot write" in told)
    return bool(calls)


@pytest.mark.slow
def test_killed_at_any_time_it_goes_on_where_it_was(tmp_path):
    config = tmp_path / "small.yaml"
    config.write_text(LONGER)
    undisturbed = sweep.Request(out=tmp_path / "undisturbed", figures=False)
    sweep.run(config, undisturbed, lambda tally: None)
    chance = random.Random(5)
    for _ in range(KILLS):
        process = started(tmp_path, "killed")
        time.sleep(chance.uniform(0.8, 3.0))
        process.send_signal(signal.SIGKILL)
        process.wait()
        children_are_gone(process.pid)
    assert started(tmp_path, "killed").wait(120) == 0
    one, other = ((tmp_path / name / RUNS).read_bytes() for name in ("undisturbed", "killed"))
    assert one == other


def started(folder, name):
    command = [sys.executable, "-m", "podusv_cli", "sweep", "run", "small.yaml", "--out", name]
    return subprocess.Popen(
        [*command, "--no-figures"],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def children_are_gone(group, patience=20.0):
    """Processes that simulate notice that the one that started them is gone."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return
        time.sleep(0.02)
    raise AssertionError("processes of a killed study go on")


@pytest.mark.slow
def test_a_full_disk_is_a_sentence_and_nothing_is_lost(whole, tmp_path):
    """The disk is full before the first unit is whole, halfway, and before the last file."""
    needed, kept = written_within(tmp_path / "roomy", math.inf), []
    begun = (tmp_path / "roomy/study.json").stat().st_size
    for share in (-0.5, 0.6, 0.95):  # of what is written after study.json
        folder = tmp_path / str(share)
        with pytest.raises(StorageError, match="the disk is full"):
            written_within(folder, begun + share * (needed - begun))
        kept.append(
            sum(int(m.sum()) for m in Store(folder, about(small())).covered_draws().values())
        )
        assert content(made(folder)) == content(whole)
    assert 0 == kept[0] < kept[1] < kept[2] < 2 * small().sweep.draws


def written_within(folder, room):
    """Bytes that a study writes on a disk with so much room."""
    real, written = files._create, [0]

    def limited(path, bytes_):
        if written[0] + len(bytes_) > room:
            raise OSError(errno.ENOSPC, "full")
        written[0] += len(bytes_)
        return real(path, bytes_)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(files, "_create", limited)
        made(folder)
    return written[0]
