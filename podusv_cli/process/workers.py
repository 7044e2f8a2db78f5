"""Jobs in processes of their own: one that dies takes no other with it."""

from __future__ import annotations

import multiprocessing
import os
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pickle import PicklingError, UnpicklingError
from typing import Any

from podusv_cli.core.errors import PodusvError, StorageError
from podusv_cli.process.interrupts import (
    Interrupts,
    interrupts_caught,
    interrupts_heard,
    interrupts_held,
)

Progress = Callable[[float], None]
Job = Callable[[Progress], Any]
GRACE = 1.5  # s for workers to bring home what they have when the user interrupts
INTERRUPTED = "interrupted"
TRIES = 2  # a worker that was killed is replaced once


@dataclass(frozen=True)
class Outcome:
    """What became of a job: its result, or in `failure` the reason why there is none.

    `cut`: it was not over when an interrupt came. `code`: the exit code that its error stands for.
    """

    result: Any = None
    failure: str = ""
    cut: bool = False
    code: int = 0


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
    the jobs, which begin with interrupts held: those that hear them have a moment to bring home
    what they have, the others are ended.
    """
    shift = _Shift(jobs, deque(range(len(jobs))))
    with interrupts_held(), _cleared(shift):
        try:
            while shift.waiting or shift.busy:
                while shift.waiting and len(shift.busy) < (workers or workers_here()):
                    shift.busy.append(_started(shift, shift.waiting.popleft()))
                with interrupts_heard():
                    ready = wait([worker.channel for worker in shift.busy])
                _listen_to_all(shift, ready, progress)
        except KeyboardInterrupt:
            _call_home(shift)
    missing = Outcome(failure=INTERRUPTED, cut=True)
    return [shift.outcomes.get(position, missing) for position in range(len(jobs))]


def _call_home(shift: _Shift) -> None:
    """Interrupt all workers and wait a moment for what they have."""
    shift.tries = dict.fromkeys(range(len(shift.jobs)), TRIES)
    for worker in shift.busy:
        worker.process.terminate()
    over, end = set(shift.outcomes), time.monotonic() + GRACE
    while shift.busy and time.monotonic() < end:
        left = max(0.0, end - time.monotonic())
        _listen_to_all(shift, wait([worker.channel for worker in shift.busy], left), None)
    for position in shift.outcomes.keys() - over:
        shift.outcomes[position] = replace(shift.outcomes[position], cut=True)


def _listen_to_all(
    shift: _Shift, ready: Sequence[object], progress: Callable[[int, float], None] | None
) -> None:
    for worker in [worker for worker in shift.busy if worker.channel in ready]:
        _listen(shift, worker, progress)


def _started(shift: _Shift, position: int) -> _Worker:
    # Forked workers have all that this process has imported and compiled; where there is no fork
    # they start from nothing, and jobs must be picklable.
    forks = "fork" in multiprocessing.get_all_start_methods()
    context: Any = multiprocessing.get_context("fork" if forks else "spawn")
    ours, theirs = context.Pipe(duplex=False)
    # A pipe is closed only when nobody holds its end: without that a worker would not notice that
    # this process was killed.
    inherited = [ours, *(worker.channel for worker in shift.busy)] if forks else []
    process = context.Process(target=_work, args=(shift.jobs[position], theirs, inherited))
    process.start()
    theirs.close()
    shift.tries[position] = shift.tries.get(position, 0) + 1
    return _Worker(position, process, ours)


def _work(job: Job, channel: Connection, inherited: Sequence[Connection]) -> None:
    for end in inherited:
        end.close()
    # Where nobody listens any more there is nobody to tell.
    with interrupts_caught() as interrupts, interrupts_held(), suppress(BrokenPipeError):
        outcome = _outcome(job, channel.send, interrupts)
        try:
            channel.send(outcome)
        except (AttributeError, TypeError, PicklingError) as error:
            channel.send(Outcome(failure=f"its result cannot be sent: {error}"))


def _outcome(job: Job, progress: Progress, interrupts: Interrupts) -> Outcome:
    try:
        return Outcome(job(progress))
    except BrokenPipeError:
        raise
    except PodusvError as error:
        return Outcome(failure=str(error), code=error.exit_code)
    except OSError as error:  # as the command line tells it
        return Outcome(failure=str(error), code=StorageError.exit_code)
    except KeyboardInterrupt:
        return Outcome(failure=INTERRUPTED)
    except Exception:  # machine code may turn an interrupt into another exception
        return Outcome(failure=INTERRUPTED if interrupts.number else traceback.format_exc())


def _listen(shift: _Shift, worker: _Worker, progress: Callable[[int, float], None] | None) -> None:
    try:
        said = worker.channel.recv()
    except (EOFError, OSError, UnpicklingError):  # it died, perhaps in the middle of a message
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
            worker.process.kill()
            worker.process.join()
            worker.channel.close()
