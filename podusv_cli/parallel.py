"""Jobs in processes of their own: one that dies takes no other with it."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any

from podusv_cli.errors import PodusvError
from podusv_cli.interrupts import hold_interrupts, interrupts_held

Progress = Callable[[float], None]
Job = Callable[[Progress], Any]
GRACE = 1.5  # s for workers to bring home what they have when the user interrupts
INTERRUPTED = "interrupted"
TRIES = 2  # a worker that was killed is replaced once


@dataclass(frozen=True)
class Outcome:
    """What became of a job: its result, or in `failure` the reason why there is none."""

    result: Any = None
    failure: str = ""


@dataclass
class _Worker:
    """A running job."""

    position: int
    process: BaseProcess
    channel: Connection


@dataclass
class _Shift:
    """Jobs waiting, at work and done."""

    jobs: Sequence[Job]
    waiting: deque[int]
    busy: list[_Worker] = field(default_factory=list)
    outcomes: dict[int, Outcome] = field(default_factory=dict)
    tries: dict[int, int] = field(default_factory=dict)


def workers_here() -> int:
    """How many processes this process may keep busy."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1


def run_all(
    jobs: Sequence[Job], progress: Callable[[int, float], None] | None = None, workers: int = 0
) -> list[Outcome]:
    """Run every job, at most `workers` at a time (0: one a core); outcomes in order.

    `progress` is called with a job's position and the fraction that it reports. A job's PodusvError
    becomes its failure; any other exception too, with its traceback. An interrupt is passed on to
    the jobs, which have a moment to bring home what they have; a second one ends everything.
    """
    shift = _Shift(jobs, deque(range(len(jobs))))
    with _cleared(shift):
        try:
            while shift.waiting or shift.busy:
                while shift.waiting and len(shift.busy) < (workers or workers_here()):
                    shift.busy.append(_started(shift, shift.waiting.popleft()))
                _listen_to_all(shift, progress)
        except KeyboardInterrupt:
            _call_home(shift)
    missing = Outcome(failure=INTERRUPTED)
    return [shift.outcomes.get(position, missing) for position in range(len(jobs))]


def _call_home(shift: _Shift) -> None:
    """Interrupt all workers and wait a moment for what they have."""
    shift.tries = dict.fromkeys(range(len(shift.jobs)), TRIES)
    for worker in shift.busy:
        with suppress(OSError):
            os.kill(worker.process.pid or 0, signal.SIGINT)
    end = time.monotonic() + GRACE
    while shift.busy and time.monotonic() < end:
        _listen_to_all(shift, None, timeout=max(0.0, end - time.monotonic()))


def _listen_to_all(
    shift: _Shift, progress: Callable[[int, float], None] | None, timeout: float | None = None
) -> None:
    for channel in wait([worker.channel for worker in shift.busy], timeout):
        worker = next(worker for worker in shift.busy if worker.channel is channel)
        _listen(shift, worker, progress)


def _started(shift: _Shift, position: int) -> _Worker:
    # Forked workers have all that this process has imported and compiled; where there is no fork
    # they start from nothing, and jobs must be picklable.
    forks = "fork" in multiprocessing.get_all_start_methods()
    context: Any = multiprocessing.get_context("fork" if forks else "spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_work, args=(shift.jobs[position], theirs))
    with interrupts_held():  # until the worker can deal with them
        process.start()
    theirs.close()
    shift.tries[position] = shift.tries.get(position, 0) + 1
    return _Worker(position, process, ours)


def _work(job: Job, channel: Connection) -> None:
    try:
        hold_interrupts(False)
        outcome = Outcome(job(channel.send))
    except PodusvError as error:
        outcome = Outcome(failure=str(error))
    except KeyboardInterrupt:
        outcome = Outcome(failure=INTERRUPTED)
    except Exception:
        outcome = Outcome(failure=traceback.format_exc())
    channel.send(outcome)


def _listen(shift: _Shift, worker: _Worker, progress: Callable[[int, float], None] | None) -> None:
    try:
        said = worker.channel.recv()
    except EOFError:
        said = _buried(shift, worker)
    if isinstance(said, float):
        if progress:
            progress(worker.position, said)
        return
    worker.process.join()
    worker.channel.close()
    shift.busy.remove(worker)
    if said is None:
        shift.waiting.append(worker.position)
    else:
        shift.outcomes[worker.position] = said


def _buried(shift: _Shift, worker: _Worker) -> Outcome | None:
    """The failure of a worker that died without a word, or None where it is to be tried again."""
    worker.process.join()
    if shift.tries[worker.position] < TRIES:
        return None
    code = worker.process.exitcode
    return Outcome(failure=f"its process ended with exit code {code}, {TRIES} times")


@contextmanager
def _cleared(shift: _Shift) -> Iterator[None]:
    """Leave no process behind, however the block ends."""
    try:
        yield
    finally:
        for worker in shift.busy:
            worker.process.terminate()
            worker.process.join()
            worker.channel.close()
