"""Workers of a comparison that are killed, and workers whose comparison is."""

import json
import os
import signal
import time
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from command_samples import BASE, LONG, PATIENCE, gone, under_way, wait_for, write
from rotation import one_in

from podusv_cli.process.workers import run_all
from podusv_cli.storage import manifest

PROC = Path("/proc")
pytestmark = pytest.mark.skipif(not PROC.is_dir(), reason="looks for workers in /proc")


def worker_of(parent: int, but: int = 0) -> int:
    """The one worker of a process, once there is no other."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        children = (PROC / f"{parent}/task/{parent}/children").read_text().split()
        alive = [int(child) for child in children if int(child) != but]
        if len(alive) == 1:
            return alive[0]
        time.sleep(0.02)
    raise AssertionError("there is no worker")


@pytest.mark.slow
def test_a_worker_killed_twice_is_reported_and_the_others_finish(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = [write("a.yaml", BASE), write("long.yaml", LONG), write("b.yaml", BASE)]
    with under_way("compare", *names, "--out", "x", "--no-figures", "--json") as process:
        for name in ("a", "b"):
            wait_for(f".x.podusv-*.part/new/{name}/manifest.json")
        first = worker_of(process.pid)
        os.kill(first, signal.SIGKILL)
        os.kill(worker_of(process.pid, but=first), signal.SIGKILL)
        out, err = process.communicate(timeout=PATIENCE)
        assert process.returncode == 3, err
        assert gone(process)
    told = "its process ended with exit code -9, 2 times"
    found = json.loads(out)
    assert f"long: {told}\n" in err
    assert found["failed"] == {"long": told}
    assert [run["run"] for run in found["runs"]] == ["x/a", "x/b"]
    assert manifest.check(Path("x/b")).status == "finished"
    assert sorted(p.name for p in Path("x").iterdir() if p.is_dir()) == ["a", "b"]


@pytest.mark.slow
def test_workers_do_not_outlive_a_comparison_that_is_killed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = [write("a.yaml", LONG), write("b.yaml", LONG)]
    with under_way("compare", *names, "--out", "x", "--no-figures") as process:
        wait_for(".x.podusv-*.part/new/.b.podusv-*.part")
        os.kill(process.pid, signal.SIGKILL)
        process.communicate(timeout=PATIENCE)
        assert gone(process)


def choke(said: bytes, progress: Any) -> None:
    """Die in the middle of a message."""
    os.write(progress.__self__.fileno(), said)
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.parametrize("said", one_in(3, [b"\0\0\1\0half", b"\0", b"\xff\xff\xff\xf0"]))
def test_a_message_cut_short_is_a_worker_killed(said):
    outcomes = run_all([partial(choke, said), partial(pow, 3)], workers=1)
    assert "exit code -9, 2 times" in outcomes[0].failure
    assert "TypeError" in outcomes[1].failure


def unfit(progress: Any) -> Any:
    """A result that no pipe can carry."""
    return lambda: None


def test_a_result_that_cannot_be_sent_is_told_as_such():
    outcome = run_all([unfit], workers=1)[0]
    assert outcome.result is None
    assert outcome.failure.startswith("its result cannot be sent: Can't pickle")
