"""Jobs in processes of their own."""

import os
import re
import signal
import time
from functools import partial
from pathlib import Path

import pytest
from storage_samples import deadline

from podusv_cli.core.errors import StorageError
from podusv_cli.figures import drawing
from podusv_cli.process.extras import Extras
from podusv_cli.process.interrupts import Interrupts, interrupts_deferred, interrupts_enabled
from podusv_cli.process.workers import INTERRUPTED, Outcome, run_all, run_shares


def square(number, progress):
    progress(0.5)
    return number**2


def fail(progress):
    raise StorageError("the disk is full")


def crash(progress):
    raise ZeroDivisionError


def die(progress):
    os.kill(os.getpid(), signal.SIGKILL)


def die_once(marker: Path, progress):
    if not marker.exists():
        marker.touch()
        die(progress)
    return "second try"


def process_id(progress):
    time.sleep(0.05)
    return os.getpid()


def test_results_come_in_the_order_of_jobs():
    outcomes = run_all([partial(square, n) for n in range(7)], workers=3)
    assert [outcome.result for outcome in outcomes] == [n**2 for n in range(7)]


def test_every_job_has_a_process_of_its_own():
    outcomes = run_all([process_id] * 3, workers=2)
    assert len({outcome.result for outcome in outcomes} | {os.getpid()}) == 4


def test_progress_is_passed_on():
    seen = []
    run_all([partial(square, 1), partial(square, 2)], lambda at, done: seen.append((at, done)))
    assert sorted(seen) == [(0, 0.5), (1, 0.5)]


def test_a_failing_job_hides_no_other():
    outcomes = run_all([fail, crash, partial(square, 3)], workers=2)
    assert outcomes[0].failure == "the disk is full"
    assert "ZeroDivisionError" in outcomes[1].failure
    assert outcomes[2].result == 9


def test_a_killed_worker_is_replaced_once(tmp_path):
    outcomes = run_all([partial(die_once, tmp_path / "died"), partial(square, 2), die], workers=2)
    assert outcomes[0].result == "second try"
    assert outcomes[1].result == 4
    assert "2 times" in outcomes[2].failure


def test_small_jobs_share_processes_and_their_outcomes_keep_the_order():
    outcomes = run_shares([partial(square, n) for n in range(9)], workers=2)
    assert [outcome.result for outcome in outcomes] == [n**2 for n in range(9)]
    assert len({outcome.result for outcome in run_shares([process_id] * 9, workers=2)}) == 2
    assert run_shares([]) == []


def test_a_small_job_that_kills_its_process_or_fails_costs_no_other_its_result():
    outcomes = run_shares([partial(square, 2), die, fail, partial(square, 3)], workers=1)
    assert [outcome.result for outcome in outcomes] == [4, None, None, 9]
    assert outcomes[1].killed
    assert outcomes[2].failure == "the disk is full"


def test_interrupted_jobs_bring_home_what_they_have():
    def interrupt(position, done):
        raise KeyboardInterrupt

    def salvage(progress):
        try:
            progress(0.1)
            with interrupts_enabled():
                time.sleep(60)
        except KeyboardInterrupt:
            return "half of it"

    outcome = run_all([salvage], interrupt, workers=1)[0]
    assert (outcome.result, outcome.interrupted) == ("half of it", True)


@pytest.mark.slow
def test_an_interrupted_caller_leaves_no_process(tmp_path):
    started = []

    def interrupt(position, done):
        raise KeyboardInterrupt

    def linger(progress):
        (tmp_path / str(os.getpid())).touch()
        progress(0.1)
        time.sleep(600)

    with deadline():
        outcomes = run_all([linger, linger, linger], interrupt, workers=2)
    assert [outcome.failure for outcome in outcomes] == ["interrupted"] * 3
    started = [int(path.name) for path in tmp_path.iterdir()]
    assert started
    for process in started:
        with pytest.raises(ProcessLookupError):
            os.kill(process, 0)


def test_an_interrupt_while_figures_are_drawn_is_one_and_no_bug(monkeypatch):
    monkeypatch.setattr(
        drawing,
        "run_shares",
        lambda jobs, *rest: [Outcome(failure=INTERRUPTED, interrupted=True)] * 2,
    )
    with pytest.raises(KeyboardInterrupt):
        drawing.draw_in_parallel([], [*drawing.FIGURES.values()][:2], ["png"], Extras())


def test_an_interrupt_that_became_another_exception_is_one(tmp_path):
    def confused(progress=None):
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(60)
        except KeyboardInterrupt as error:
            raise SystemError("returned a result with an exception set") from error

    with interrupts_deferred():
        extras = Extras()
        assert extras.attempt("it", confused) is None
    assert extras.interrupted
    assert extras.attempt("it", lambda: 1) is None
    assert not extras.missing


@pytest.mark.parametrize("way", ["make_or_record", "attempt"])
def test_extras_that_fail_are_missing_and_what_cannot_be_stored_is_an_error(way):
    def unstorable():
        raise StorageError("the disk is full")

    with interrupts_deferred():
        extras = Extras()
        assert getattr(extras, way)("the quotient", lambda: 1 / 0) is None
        assert getattr(extras, way)("the sum", lambda: 1 + 1) == 2
        with pytest.raises(StorageError, match="full"):
            getattr(extras, way)("the file", unstorable)
    (missing,) = extras.missing
    here = r"the quotient could not be made: ZeroDivisionError: .* \(test_parallel.py, line \d+\)"
    assert re.fullmatch(here, str(missing))
    assert missing.trace.startswith("Traceback")
    assert not extras.interrupted


def test_held_interrupts_come_when_they_are_heard():
    with interrupts_deferred():
        os.kill(os.getpid(), signal.SIGTERM)
        os.kill(os.getpid(), signal.SIGINT)  # an echo of the first
        time.sleep(0.01)
        with pytest.raises(KeyboardInterrupt), interrupts_enabled():
            time.sleep(60)
        with interrupts_enabled():
            time.sleep(0.01)
    assert not isinstance(signal.getsignal(signal.SIGTERM), Interrupts)
