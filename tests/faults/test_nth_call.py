"""The n-th call that makes, writes or names something fails, for every n (by default some)."""

import errno
import itertools
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from command_samples import Said
from counts import count, few
from old_results import COMMANDS, SUCCESS, assert_nothing_lost, bring_back
from storage_samples import Saboteur, fails, files

from podusv_cli.process import workers
from podusv_cli.process.interrupts import Interrupts
from podusv_cli.storage import provenance, staging
from podusv_cli.workflows import compare

NAMING = ("replace", "rename")
FILLING = ("write", "fsync")


def one_by_one(jobs: Sequence[workers.Job], *more: object) -> list[workers.Outcome]:
    """The jobs of a comparison in this process, where their calls are counted."""
    return [workers.outcome_of(job, lambda fraction: None, Interrupts()) for job in jobs]


@pytest.fixture
def podusv(beside_old_results, monkeypatch):
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
def test_it_is_a_line_and_nothing_is_lost(podusv, before, made, words, error, lasting):
    old, said = files(before), podusv(*words)
    assert said.code == SUCCESS.get(words[0], 0)
    new = files(Path())
    every = count(36 if words[1] in ("two.yaml", "both") and made != "figures" else 14, 1)
    for nth in itertools.count(1 + len(made + words[0]) % every, every):
        bring_back(before)
        failures, said = sabotaged(lambda: podusv(*words), error, nth, lasting=lasting)
        if not failures:
            break
        assert_nothing_lost(made, old, new, said)
    assert nth > 2 * every or words[0] == "verify"
