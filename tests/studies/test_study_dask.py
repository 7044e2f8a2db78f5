"""Studies on real Dask clusters: the bytes of a study that one process made."""

import json
import logging
import os
import signal
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager

import pytest
from small_study import TEXT, made, small

from podusv_cli.core.errors import StorageError
from podusv_cli.studies.making.cluster import TALKERS, _client, connect_cluster
from podusv_cli.studies.making.dispatch import dispatch
from podusv_cli.studies.making.record import about
from podusv_cli.studies.making.remote import StudyText
from podusv_cli.studies.making.store import RUNS, Store

PATIENCE = 60.0  # s
# So long that an interrupt comes before the end.
LONG = TEXT.replace("duration: 1.0", "duration: 20.0").replace("draws: 40", "draws: 1000")
DASK = [sys.executable, "-m", "dask"]


@pytest.fixture
def distributed():
    return pytest.importorskip("distributed", reason="Dask is not installed: podusv[cluster]")


@pytest.mark.slow
def test_a_worker_that_is_killed_changes_no_byte(distributed, tmp_path):
    whole = (made(tmp_path / "local").folder / RUNS).read_bytes()
    store, killed = Store(tmp_path / "study", about(small())), []
    store.open("now")

    def tell(tally):
        if not killed and tally.made > 8:
            killed.append(next(iter(local.workers.values())).pid)
            os.kill(killed[0], signal.SIGKILL)

    recipe = StudyText(TEXT)
    with (
        distributed.LocalCluster(2, threads_per_worker=1, dashboard_address=None) as local,
        connect_cluster(local.scheduler_address, recipe, store.seal) as executor,
    ):
        _, finished = dispatch(store, small(), tell, executor)
    assert finished
    assert killed
    store.write_runs()
    assert (store.folder / RUNS).read_bytes() == whole


@pytest.mark.slow
def test_dask_as_a_user_starts_it_and_an_interrupt(distributed, tmp_path):
    (tmp_path / "long.yaml").write_text(LONG)
    with ExitStack() as stack:
        place = tmp_path / "scheduler.json"
        stack.enter_context(
            background(
                *DASK,
                "scheduler",
                "--host",
                "127.0.0.1",
                "--port",
                "0",
                "--no-dashboard",
                "--scheduler-file",
                place,
            )
        )
        until(place.exists)
        address = json.loads(place.read_text())["address"]
        for threads in ("1", "2"):
            options = ("--nthreads", threads, "--no-dashboard", "--local-directory", tmp_path)
            stack.enter_context(background(*DASK, "worker", address, *options))
        with distributed.Client(address, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=PATIENCE)
        with sweep(tmp_path, address) as first:
            until(lambda: any((tmp_path / "study/units").glob("*.unit")))
            first.send_signal(signal.SIGINT)
            assert first.wait(PATIENCE) == 130
        assert not (tmp_path / "study" / RUNS).exists()
        with sweep(tmp_path, address) as second:
            assert second.wait(PATIENCE) == 0
        with sweep(tmp_path, "", "local") as alone:
            assert alone.wait(PATIENCE) == 0
    one, other = ((tmp_path / name / RUNS).read_bytes() for name in ("study", "local"))
    assert one == other
    sittings = json.loads((tmp_path / "study/provenance.json").read_text())["sittings"]
    assert sum(sitting["runs"] for sitting in sittings) == 2000
    assert sittings[0]["runs"] > 0
    assert {len(sitting["workers"]) for sitting in sittings} <= {1, 2}


@contextmanager
def background(*command, cwd=None):
    """A process in the background, ended at the end."""
    silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    process = subprocess.Popen(command, cwd=cwd, **silent)
    try:
        yield process
    finally:
        process.terminate()
        process.wait(PATIENCE)


def sweep(folder, address, name="study"):
    options = ("--scheduler", address, "--out", folder / name, "--no-figures")
    command = (sys.executable, "-m", "podusv_cli", "sweep", "run", folder / "long.yaml")
    return background(*command, *options)


def until(happened):
    end = time.monotonic() + PATIENCE
    while not happened():
        assert time.monotonic() < end, "nothing happens"
        time.sleep(0.02)


def test_no_scheduler_is_a_sentence(distributed, monkeypatch):
    monkeypatch.setattr("podusv_cli.studies.making.cluster.PATIENCE", 0.3)
    with (
        pytest.raises(StorageError, match=r"--scheduler tcp://127.0.0.1:9: no scheduler answers"),
        connect_cluster("tcp://127.0.0.1:9", StudyText(TEXT), ""),
    ):
        pass


def test_dask_says_to_its_users_afterwards_what_it_said_before(distributed, monkeypatch, caplog):
    """Of two clusters at a time, too, the first of which ends first."""
    monkeypatch.setattr("podusv_cli.studies.making.cluster.PATIENCE", 30.0)
    loggers = [logging.getLogger(name) for name in TALKERS]
    levels = [logger.level for logger in loggers]

    def said():
        caplog.clear()
        for logger in loggers:
            logger.propagate, before = True, logger.propagate
            logger.error("lost")
            logger.propagate = before
        return len(caplog.records)

    assert said() == 2
    with distributed.LocalCluster(
        1, threads_per_worker=1, processes=False, dashboard_address=None
    ) as local:
        first, second = ExitStack(), ExitStack()
        for cluster in (first, second):
            cluster.enter_context(_client(local.scheduler_address))
        for cluster in (first, second):
            assert said() == 0
            cluster.close()
    assert said() == 2
    with pytest.raises(StorageError), _client("nowhere:x"):
        pass
    assert said() == 2
    assert [logger.level for logger in loggers] == levels
