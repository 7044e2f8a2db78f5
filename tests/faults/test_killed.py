"""Killed at any moment: what was there is there, or what is new; the next one clears up.

The moment is the n-th call of the system that makes, fills or names something, or any time at all.
"""

import errno
import itertools
import os
import random
import signal
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from children import Died, begun, in_a_child
from command_samples import Said
from counts import count, few
from old_results import COMMANDS, SUCCESS, assert_nothing_lost, assert_whole, bring_back, left_over
from storage_samples import Saboteur, fails, files, until_nothing_breaks

from podusv_cli.engine.machine import object_cache
from podusv_cli.process import code_folder, workers
from podusv_cli.process.interrupts import Interrupts
from podusv_cli.process.temporary_names import temporary_name
from podusv_cli.storage import provenance, staging
from podusv_cli.workflows import compare

CALLS = ("mkdir", "open", "write", "fsync", "replace", "rename", "unlink", "rmdir")


@pytest.fixture
def podusv(beside_old_results):
    return beside_old_results


def counted(work: Callable[[], object], nth: int = 0) -> int:
    """Do some work and die before the nth of CALLS in this process; how many there were."""
    here = os.getpid()
    saboteur = Saboteur(lambda: kill() if os.getpid() == here else None, nth)
    saboteur.watch(pytest.MonkeyPatch(), *CALLS)
    work()
    return nth - saboteur.left


def kill() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def killed_after(work: Callable[[], object], seconds: float) -> object:
    child = begun(work)
    time.sleep(seconds)
    child.process.kill()
    return child.result()


def attempts(work: Callable[[], object], seeds: range) -> list[Callable[[], object]]:
    """Ways to do some work in a process that is killed before its end, after doing it once."""
    began = time.monotonic()
    total = in_a_child(partial(counted, work))
    took = time.monotonic() - began
    chances = [random.Random(seed) for seed in seeds]
    at_calls = [
        partial(in_a_child, partial(counted, work, c.randint(1, total))) for c in chances[::2]
    ]
    at_times = [partial(killed_after, work, c.uniform(0.0, took)) for c in chances[1::2]]
    return [*at_calls, *at_times]


@pytest.mark.slow
@pytest.mark.parametrize(("made", "words"), few(COMMANDS), ids=str)
def test_old_or_new_and_the_next_one_clears_up(podusv, before, made, words):
    old, work = files(before), partial(podusv, *words)
    deaths, seen = attempts(work, range(count(2, 26))), []
    new = files(Path())
    for attempt in deaths:
        bring_back(before)
        try:
            attempt()
        except Died:
            seen.append(attempt)
        assert_whole(made, old, new)
        assert work().code == SUCCESS.get(words[0], 0)
        assert_whole(made, old, new)
        assert not left_over()
    assert len(seen) >= len(deaths) / 2  # a process may be faster than it was


def test_no_piece_of_code_is_left_half_written(tmp_path, monkeypatch):
    monkeypatch.setenv("PODUSV_CACHE", str(tmp_path))
    found = partial(code_folder.code_folder.__wrapped__, "0123456789abcdef")
    path, piece = found() / "law.code", object_cache.Code("law", b"\x90" * 1000)

    def attempt(saboteur: Saboteur) -> None:
        path.unlink(missing_ok=True)

        def keep() -> int:
            saboteur.watch(pytest.MonkeyPatch(), *CALLS)
            object_cache._write(path, piece)
            return saboteur.left

        try:
            saboteur.left = in_a_child(keep)
        except Died:
            saboteur.left = 0

    seen = []
    for _ in until_nothing_breaks(attempt, kill):
        found()  # as the next process does
        assert {each.name for each in path.parent.iterdir()} <= {path.name, code_folder.MARK}
        seen.append(object_cache._read(path))
    assert set(seen) == {None}
    assert object_cache._read(path) == piece


@pytest.mark.long
def test_what_others_may_be_making_is_left_alone(podusv):
    """Parts of a process that lives or of another machine, and names that only look like parts."""
    mine = temporary_name()
    dead = in_a_child(temporary_name)
    machine = mine.split("-")[1]
    kept = [mine, dead.replace(machine, "0" * 8), ".podusv-notes.part", f"my{dead}"]
    for name in (*kept, dead):
        Path("figures", name).write_bytes(b"")
    assert podusv("plot", "x", "--out", "figures").code == 0
    assert {path.name for path in Path("figures").iterdir() if "podusv" in path.name} == set(kept)


# --- the n-th call that makes, writes or names something fails, for every n (by default some)

NAMING = ("replace", "rename")
FILLING = ("write", "fsync")


def one_by_one(jobs: Sequence[workers.Job], *more: object) -> list[workers.Outcome]:
    """The jobs of a comparison in this process, where their calls are counted."""
    return [workers.outcome_of(job, lambda fraction: None, Interrupts()) for job in jobs]


@pytest.fixture
def podusv_alone(beside_old_results, monkeypatch):
    monkeypatch.setattr(provenance, "collect", lambda *of_a_run: {})  # which takes its time
    monkeypatch.setattr(compare, "run_all", one_by_one)
    return beside_old_results


def sabotaged(
    work: Callable[[], Said], error: int, nth: int, *, lasting: bool = False
) -> tuple[int, Said]:
    """Do some work whose nth call fails, and with `lasting` all that fill something from there on.

    How often calls failed, and what the work said.
    """
    failures = []

    def deed() -> None:
        failures.append(nth)
        saboteur.left += lasting
        fails(error)()

    saboteur = Saboteur(deed, nth)
    with pytest.MonkeyPatch.context() as patch:
        saboteur.watch(patch, *FILLING, *(() if lasting else NAMING))
        if not lasting:
            patch.setattr(staging, "exchange", saboteur._instead_of(staging.exchange))
        watch_where(patch, saboteur, "open", to_write)
        watch_where(patch, saboteur, "mkdir", lambda path, *mode: not os.path.isdir(path))
        said = work()
    return len(failures), said


def watch_where(
    patch: pytest.MonkeyPatch, saboteur: Saboteur, name: str, counts: Callable[..., object]
) -> None:
    """Watch those calls of a function whose arguments count."""
    plain = getattr(os, name)
    watched = saboteur._instead_of(plain)

    def call(*given: Any, **more: Any) -> object:
        return (watched if counts(*given) else plain)(*given, **more)

    patch.setattr(os, name, call)


def to_write(path: object, flags: int, *mode: int) -> int:
    """New files, and folders that are synced: neither what deletes nor what reads."""
    return flags & (os.O_CREAT | os.O_DIRECTORY)


@pytest.mark.slow
@pytest.mark.parametrize(("error", "lasting"), [(errno.EIO, False), (errno.ENOSPC, True)])
@pytest.mark.parametrize(("made", "words"), few(COMMANDS), ids=str)
def test_it_is_a_line_and_nothing_is_lost(podusv_alone, before, made, words, error, lasting):
    old, said = files(before), podusv_alone(*words)
    assert said.code == SUCCESS.get(words[0], 0)
    new = files(Path())
    every = count(36 if words[1] in ("two.yaml", "both") and made != "figures" else 14, 1)
    for nth in itertools.count(1 + len(made + words[0]) % every, every):
        bring_back(before)
        failures, said = sabotaged(lambda: podusv_alone(*words), error, nth, lasting=lasting)
        if not failures:
            break
        assert_nothing_lost(made, old, new, said)
    assert nth > 2 * every or words[0] == "verify"
