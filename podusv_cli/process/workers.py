"""Jobs in processes of their own: a job that kills its process affects no other job."""

from __future__ import annotations

import multiprocessing
import os
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
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
Report = Callable[[int, float], None]
GRACE = 1.5  # s for jobs to return what they have after an interrupt
INTERRUPTED = "interrupted"
FORK = multiprocessing.get_context("fork")  # which inherits what is imported and compiled
TRIES = 2  # a job whose process is killed runs once more


@dataclass(frozen=True)
class Outcome:
    """A job's result, or in `failure` the reason why there is none.

    `cut`: an interrupt came before the job was over. `code`: the exit code of its error.
    """

    result: Any = None
    failure: str = ""
    cut: bool = False
    code: int = 0


def workers_here() -> int:
    """How many processes this process may keep busy."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1


def run_all(
    jobs: Sequence[Job], progress: Report = lambda position, fraction: None, workers: int = 0
) -> list[Outcome]:
    """Run every job, at most `workers` at a time (0: one a core); the outcomes in order.

    `progress` is called with a job's position and the fraction that it reports. A job's PodusvError
    becomes its failure; any other exception too, with its traceback. An interrupt is passed on to
    the jobs, which begin with interrupts held; those that hear it have a moment to return what they
    have, then all are killed.
    """
    pool = _Pool(jobs, progress)
    with interrupts_held():
        try:
            while pool.waiting or pool.busy:
                pool.start(workers or workers_here())
                with interrupts_heard():
                    ready = wait(pool.busy)
                pool.receive(ready)
        except KeyboardInterrupt:
            pool.interrupt()
        finally:
            pool.kill()
    missing = Outcome(failure=INTERRUPTED, cut=True)
    return [pool.outcomes.get(position, missing) for position in range(len(jobs))]


class _Pool:
    """Jobs that wait, by position; processes at work, by the pipe that they write to; outcomes."""

    def __init__(self, jobs: Sequence[Job], progress: Report) -> None:
        self._jobs, self._progress, self._tries = jobs, progress, Counter[int]()
        self.waiting = list(range(len(jobs)))
        self.busy: dict[Connection, tuple[int, BaseProcess]] = {}
        self.outcomes: dict[int, Outcome] = {}

    def start(self, most: int) -> None:
        """Start jobs until this many are at work."""
        while self.waiting and len(self.busy) < most:
            position = self.waiting.pop(0)
            ours, theirs = FORK.Pipe(duplex=False)
            # A process notices that its parent has ended only if no other holds the pipe's end.
            inherited = [ours, *self.busy]
            process = FORK.Process(target=_work, args=(self._jobs[position], theirs, inherited))
            process.start()
            theirs.close()
            self._tries[position] += 1
            self.busy[ours] = position, process

    def receive(self, ready: Iterable[Any]) -> None:
        """Read one message from each of these pipes: a fraction, an outcome, or the end."""
        for pipe in ready:
            position, process = self.busy[pipe]
            try:
                message = pipe.recv()
            except (EOFError, OSError, UnpicklingError):  # killed, perhaps within a message
                message = None
            if isinstance(message, float):
                self._progress(position, message)
                continue
            del self.busy[pipe]
            pipe.close()
            process.join()
            if message is None and self._tries[position] < TRIES:
                self.waiting.append(position)
            else:
                killed = f"its process ended with exit code {process.exitcode}, {TRIES} times"
                self.outcomes[position] = message or Outcome(failure=killed)

    def interrupt(self) -> None:
        """Interrupt all processes and take what they return within the time of grace."""
        self._progress = lambda position, fraction: None
        done, end = set(self.outcomes), time.monotonic() + GRACE
        for _, process in self.busy.values():
            process.terminate()
        while self.busy and (left := end - time.monotonic()) > 0:
            self.receive(wait(self.busy, left))
        for position in self.outcomes.keys() - done:
            self.outcomes[position] = replace(self.outcomes[position], cut=True)

    def kill(self) -> None:
        """Leave no process behind."""
        for pipe, (_, process) in self.busy.items():
            process.kill()
            process.join()
            pipe.close()


def _work(job: Job, pipe: Connection, inherited: Iterable[Connection]) -> None:
    for end in inherited:
        end.close()
    # A broken pipe means that the parent has ended.
    with interrupts_caught() as interrupts, interrupts_held(), suppress(BrokenPipeError):
        outcome = _outcome(job, pipe.send, interrupts)
        try:
            pipe.send(outcome)
        except (AttributeError, TypeError, PicklingError) as error:
            pipe.send(Outcome(failure=f"its result cannot be sent: {error}"))


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
    except Exception:  # compiled code may turn an interrupt into another exception
        return Outcome(failure=INTERRUPTED if interrupts.number else traceback.format_exc())
