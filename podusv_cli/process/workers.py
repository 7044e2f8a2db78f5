"""Jobs in processes of their own: a job that kills its process affects no other job.

A process is forked for each job where that is safe, on Linux. Elsewhere a process begins empty,
which takes a second, and does one job after the other.

Each process has a pipe of its own. The pools of concurrent.futures and pebble share one, and a
process that is killed while it sends its result stops all others.
"""

from __future__ import annotations

import multiprocessing
import pickle
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from pickle import PicklingError, UnpicklingError
from types import ModuleType
from typing import Any, Protocol

from podusv_cli.core.errors import PodusvError, StorageError
from podusv_cli.core.system import ask_to_end, usable_cores
from podusv_cli.process.interrupts import (
    Interrupts,
    interrupts_caught,
    interrupts_deferred,
    interrupts_enabled,
)

Progress = Callable[[float], None]
Job = Callable[[Progress], Any]
Report = Callable[[int, float], None]
Pipe = Any  # the end of one, whose class is another on Windows
GRACE = 1.5  # s after an interrupt, in which jobs may return a partial result
INTERRUPTED = "interrupted"
SHARE = 4  # small jobs, at least, that are worth a process
TRIES = 2  # a job whose process is killed runs once more


@dataclass(frozen=True)
class Outcome:
    """A job's result, or in `failure` the reason why there is none.

    `interrupted`: an interrupt came before the job ended. `code`: the exit code of its error.
    `killed`: its process ended by itself, twice.
    """

    result: Any = None
    failure: str = ""
    interrupted: bool = False
    code: int = 0
    killed: bool = False


def available_workers() -> int:
    """How many worker processes to use: the cores that this process may run on.

    One where Python lets this process start none, as in a worker of `multiprocessing.Pool`.
    """
    if multiprocessing.current_process().daemon:
        return 1
    return usable_cores()


def run_all(
    jobs: Sequence[Job], progress: Report = lambda position, fraction: None, workers: int = 0
) -> list[Outcome]:
    """Run every job, at most `workers` at a time (0: one a core); the outcomes in order.

    `progress` is called with a job's position and the fraction that it reports. A job's PodusvError
    becomes its failure; any other exception too, with its traceback. Jobs start with interrupts
    deferred. An interrupt is passed on to them; after GRACE seconds those that have not returned
    are killed.
    """
    outcomes: dict[int, Outcome] = {}
    run_each(enumerate(jobs), outcomes.__setitem__, progress, workers)
    missing = Outcome(failure=INTERRUPTED, interrupted=True)
    return [outcomes.get(position, missing) for position in range(len(jobs))]


def run_shares(
    jobs: Sequence[Job], progress: Progress = lambda fraction: None, workers: int = 0
) -> list[Outcome]:
    """Run small jobs, several in a process, so that they share what it has loaded and cached.

    The outcomes are in the order of the jobs. `progress` is called with the fraction of jobs that
    are over. If a process is killed, each of its jobs runs again in a process of its own. Jobs
    start with interrupts deferred.
    """
    count = min(workers or available_workers(), -(-len(jobs) // SHARE))
    # Every count-th job: neighbours, which often take as long, go to different processes
    shares = [range(first, len(jobs), count) for first in range(count)]
    done = dict.fromkeys(range(count), 0.0)

    def advance(position: int, fraction: float) -> None:
        """Note the fraction of a share of jobs that is over, and pass on that of all jobs."""
        done[position] = fraction * len(shares[position])
        progress(sum(done.values()) / len(jobs))

    together = [partial(_one_by_one, [jobs[number] for number in share]) for share in shares]
    by_job: dict[int, Outcome] = {}
    for share, whole in zip(shares, run_all(together, advance, workers), strict=True):
        if whole.killed and len(share) > 1:
            by_job |= zip(share, run_all([jobs[n] for n in share], workers=workers), strict=True)
        else:
            # Without a result, as after an interrupt, each job has the outcome of its share.
            outcomes = whole.result or [whole] * len(share)
            by_job |= zip(
                share,
                (replace(o, interrupted=whole.interrupted or o.interrupted) for o in outcomes),
                strict=True,
            )
    return [by_job[number] for number in range(len(jobs))]


def _one_by_one(jobs: Sequence[Job], tell: Progress) -> list[Outcome]:
    """The outcome of each job, in order, in this process; `tell` hears which share is done.

    After an interrupt the jobs that are left count as interrupted.
    """
    outcomes: list[Outcome] = []
    with interrupts_caught() as interrupts:
        for job in jobs:
            if interrupts.number:
                outcomes.append(Outcome(failure=INTERRUPTED, interrupted=True))
                continue
            outcomes.append(outcome_of(job, lambda fraction: None, interrupts))
            tell(len(outcomes) / len(jobs))
    return outcomes


def run_each(
    jobs: Iterable[tuple[int, Job]],
    done: Callable[[int, Outcome], None],
    progress: Report = lambda position, fraction: None,
    workers: int = 0,
) -> bool:
    """Run numbered jobs, as `run_all`, that are taken one by one as processes become free.

    `done` is called with a job's number and outcome, and may add jobs to those that are still to be
    taken. False after an interrupt; jobs that did not return have no outcome then.
    """
    pool = _Pool(iter(jobs), done, progress)
    with interrupts_deferred():
        try:
            while pool.start(workers or available_workers()):
                with interrupts_enabled():  # only while waiting, so that no outcome is lost
                    ready = wait(pool.running)
                pool.receive(ready)
        except KeyboardInterrupt:
            pool.interrupt()
            return False
        finally:
            pool.kill()
    return True


class Crew(Protocol):
    """How processes come to their jobs."""

    def begin(self, job: Job, others: Iterable[Pipe]) -> tuple[Pipe, BaseProcess]:
        """The pipe of a process that does a job now, and the process; `others` are under way."""

    def end(self, pipe: Pipe, process: BaseProcess) -> None:
        """To be called when a process has sent its outcome, or has ended."""

    def dismiss(self) -> None:
        """Let all processes go, as no job comes any more."""


class Forked:
    """A process a job: it inherits the job, and all code that is imported and compiled."""

    def __init__(self) -> None:
        """A crew that forks a process for every job, so that none changes anything of another."""
        self._context: Any = multiprocessing.get_context("fork")

    def begin(self, job: Job, others: Iterable[Pipe]) -> tuple[Pipe, BaseProcess]:
        """As `Crew` says."""
        ours, theirs = self._context.Pipe(duplex=False)
        # A process notices that its parent has ended only if no other holds the pipe's end.
        process = self._context.Process(target=_work, args=(job, theirs, [ours, *others]))
        process.start()
        theirs.close()
        return ours, process

    def end(self, pipe: Pipe, process: BaseProcess) -> None:
        """As `Crew` says; it was for this job alone."""
        pipe.close()
        process.join()

    def dismiss(self) -> None:
        """Nothing is left to do: each process had one job, and has ended with it."""


class Spawned:
    """Processes that begin empty, and do one job after the other, which cross as bytes."""

    def __init__(self) -> None:
        """No process yet."""
        self._context: Any = multiprocessing.get_context("spawn")
        self._idle: list[tuple[Pipe, BaseProcess]] = []

    def begin(self, job: Job, others: Iterable[Pipe]) -> tuple[Pipe, BaseProcess]:
        """As `Crew` says. Raises PicklingError, TypeError for a job that cannot cross."""
        from podusv_cli.process.job_bytes import as_bytes  # which is not needed with `fork`

        content = as_bytes(job)
        pipe, process = self._idle.pop() if self._idle else self._start()
        with suppress(OSError):  # it has ended, which `receive` notices
            pipe.send_bytes(content)
        return pipe, process

    def _start(self) -> tuple[Pipe, BaseProcess]:
        """A new process that waits for jobs, and the pipe to it."""
        ours, theirs = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(theirs,))
        with _without_main():
            process.start()
        theirs.close()
        return ours, process

    def end(self, pipe: Pipe, process: BaseProcess) -> None:
        """As `Crew` says; it waits for another job, unless it has ended."""
        if process.is_alive():
            self._idle.append((pipe, process))
        else:
            pipe.close()
            process.join()

    def dismiss(self) -> None:
        """End the processes that wait."""
        # All pipes first, so that the processes end side by side.
        for pipe, _ in self._idle:
            pipe.close()
        for _, process in self._idle:
            process.join()


CREW: type[Forked] | type[Spawned] = Forked if sys.platform == "linux" else Spawned


def workers_inherit() -> bool:
    """Whether a worker has all that this process has imported and made."""
    return CREW is Forked


@contextmanager
def _without_main() -> Iterator[None]:
    """Hide the main module for as long as a process is spawned.

    The process would first run the user's script once more, which no job needs.
    """
    before = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = before


class _Pool:
    """Jobs that wait, running processes by their pipe, and where outcomes go."""

    def __init__(
        self,
        jobs: Iterator[tuple[int, Job]],
        done: Callable[[int, Outcome], None],
        progress: Report,
    ) -> None:
        """Workers for numbered `jobs`; `done` gets each outcome, `progress` the fractions done."""
        self._jobs, self._done, self._progress = jobs, done, progress
        self._tries = Counter[int]()
        self._again: list[tuple[int, Job]] = []
        self._crew: Crew = CREW()
        self.running: dict[Pipe, tuple[int, Job, BaseProcess]] = {}

    def start(self, most: int) -> bool:
        """Start jobs until `most` processes run; whether any runs."""
        while len(self.running) < most:
            waiting = self._again.pop() if self._again else next(self._jobs, None)
            if waiting is None:
                break
            number, job = waiting
            pipe, process = self._crew.begin(job, self.running)
            self._tries[number] += 1
            self.running[pipe] = number, job, process
        return bool(self.running)

    def receive(self, ready: Iterable[Any]) -> None:
        """Read one message from each pipe: progress (a float), an outcome, or the end of the pipe.

        A job whose process was killed runs once more, then has an outcome that says so.
        """
        for pipe in ready:
            number, job, process = self.running[pipe]
            try:
                message = pipe.recv()
            except (EOFError, OSError, UnpicklingError):  # killed, perhaps within a message
                message = None
                # The pipe closes a moment before the process has ended.
                process.join()
            if isinstance(message, float):
                self._progress(number, message)
                continue
            del self.running[pipe]
            self._crew.end(pipe, process)
            if message is None and self._tries[number] < TRIES:
                self._again.append((number, job))
                continue
            killed = f"its process ended with exit code {process.exitcode}, {TRIES} times"
            del self._tries[number]
            self._done(number, message or Outcome(failure=killed, killed=True))

    def interrupt(self) -> None:
        """Interrupt all processes and collect what they return within GRACE seconds.

        Their outcomes count as interrupted, and no job is tried again.
        """
        self._progress, done = lambda number, fraction: None, self._done
        self._done = lambda number, outcome: done(number, replace(outcome, interrupted=True))
        self._tries.update(dict.fromkeys((number for number, _, _ in self.running.values()), TRIES))
        end = time.monotonic() + GRACE
        for _, _, process in self.running.values():
            ask_to_end(process)
        while self.running and (left := end - time.monotonic()) > 0:
            self.receive(wait(self.running, left))

    def kill(self) -> None:
        """Kill all processes that still run, and let those go that wait."""
        for pipe, (_, _, process) in self.running.items():
            process.kill()
            process.join()
            pipe.close()
        self._crew.dismiss()


def _work(job: Job, pipe: Pipe, inherited: Iterable[Pipe]) -> None:
    """Run a job in a new process and send its outcome; `inherited` are others' ends of pipes."""
    for end in inherited:
        end.close()
    # A broken pipe means that the parent has ended.
    with interrupts_caught() as interrupts, interrupts_deferred(), suppress(BrokenPipeError):
        _send_outcome(job, pipe, interrupts)


def _serve(pipe: Pipe) -> None:
    """Run the jobs that come through the pipe, until it is closed, and send their outcomes."""
    with interrupts_caught() as interrupts, interrupts_deferred(), suppress(EOFError, OSError):
        while content := pipe.recv_bytes():
            _send_outcome(partial(_run_job_of_bytes, content), pipe, interrupts)


def _run_job_of_bytes(content: bytes, tell: Progress) -> Any:
    """The result of a job that crossed as bytes; what it raises, or what reading it raises."""
    return pickle.loads(content)(tell)


def _send_outcome(job: Job, pipe: Pipe, interrupts: Interrupts) -> None:
    """Run a job, which tells its progress through the pipe, and send its outcome there.

    Raises BrokenPipeError where the parent has ended.
    """
    outcome = outcome_of(job, pipe.send, interrupts)
    try:
        pipe.send(outcome)
    # What cannot be pickled is any of these three, by its kind.
    except (AttributeError, TypeError, PicklingError) as error:
        pipe.send(Outcome(failure=f"its result cannot be sent: {error}"))


def outcome_of(job: Job, progress: Progress, interrupts: Interrupts) -> Outcome:
    """Run a job; its result, or why it has none.

    Raises BrokenPipeError where the parent has ended, since nobody waits for the outcome then.
    """
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
