"""Units made by the workers of a Dask cluster; only this process writes.

A worker reports what it computes with before the march, and again before each of its units, because
workers may join and restart. It gets no units where that is not what this process computes with.
"""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import astuple, dataclass, replace
from queue import Empty, SimpleQueue
from typing import Any

from podusv_cli.core.errors import StorageError, UsageError
from podusv_cli.process.interrupts import interrupts_deferred, interrupts_enabled
from podusv_cli.process.workers import Outcome
from podusv_cli.studies.counting.runs import Unit
from podusv_cli.studies.making import remote
from podusv_cli.studies.making.dispatch import Done, Executor, Processes, Units
from podusv_cli.studies.making.plan import Variant, digest
from podusv_cli.studies.making.remote import Reply, Report, StudyText

WINDOW = 2  # units under way for each thread of a worker, so that none waits for this process
LOOK = 2.0  # s, after which it is looked again which workers there are
PATIENCE = 30.0  # s for the connection
REPORTING = 300.0  # s for the reports; a worker that is later is checked before its first unit
LOST = (OSError, CancelledError)  # what Dask raises where the scheduler is gone
TALKERS = ("distributed.client", "distributed.utils")  # they log tracebacks of what is raised here
KILLED = "KilledWorker"  # Dask's exception for a task whose worker died, time after time


@dataclass(frozen=True)
class UnitTask:
    """A unit of a study or of a variant of it, and the terms of its making.

    `allowed` are the workers that may make it (None: all); `alone` that nothing else is under way.
    """

    number: int
    variant: Variant | None
    unit: Unit
    allowed: frozenset[str] | None = None
    alone: bool = False


def executor(
    scheduler: str, workers: int, study: StudyText, identity: str
) -> AbstractContextManager[Executor]:
    """Where units are made: processes of this machine, or the workers of a scheduler.

    `scheduler` is an address, "" for none; `workers` is how many processes (0: one a core).
    `identity` digests the study's identity.
    """
    if not scheduler:
        return nullcontext(Processes(workers))
    return connect_cluster(scheduler, study, identity)


@contextmanager
def connect_cluster(address: str, study: StudyText, identity: str) -> Iterator[Cluster]:
    """The cluster of a scheduler, its workers checked; `identity` digests the study's identity.

    Raises UsageError without Dask and for a worker that computes with something else, StorageError
    where no scheduler answers.
    """
    with _client(address) as client:
        ours = remote.report(study.text, study.plugins) | {"the study": identity}
        cluster = Cluster(client, study, ours)
        cluster.check()
        yield cluster


@contextmanager
def _client(address: str) -> Iterator[Any]:
    """A client of the scheduler at `address`. Raises UsageError without Dask, StorageError."""
    try:
        from distributed import Client
    except ImportError:
        raise UsageError("--scheduler needs Dask: pip install 'podusv[cluster]'") from None
    with _silent_talkers():
        try:
            # Not the default: what else uses Dask in this process keeps the client that it has.
            client = Client(address, timeout=PATIENCE, set_as_default=False)
        except (OSError, ValueError) as error:
            raise StorageError(
                f"--scheduler {address}: no scheduler answers ({' '.join(str(error).split())}); "
                "start one with `dask scheduler`, and give the address that it prints"
            ) from error
        with client:
            yield client


@contextmanager
def _silent_talkers() -> Iterator[None]:
    """Dask's loggers are silent but for critical records; afterwards they are as before.

    A filter is added, since a saved and restored level could be that of another thread's cluster.
    """
    loggers, critical = [*map(logging.getLogger, TALKERS)], _Critical()
    for logger in loggers:
        logger.addFilter(critical)
    try:
        yield
    finally:
        for logger in loggers:
            logger.removeFilter(critical)


class _Critical(logging.Filter):
    def filter(self, record: logging.LogRecord) -> bool:
        """Whether it is so bad that it is said."""
        return record.levelno >= logging.CRITICAL


class Cluster:
    """Makes units on the workers of a cluster; an `Executor`."""

    def __init__(self, client: Any, study: StudyText, ours: Report) -> None:
        """Take a client of Dask, the study, and what every worker has to report."""
        self._client, self._study, self._ours = client, study, ours
        # Threads by worker, and when they were last looked up: at once, with this value.
        self._threads, self._looked = dict[str, int](), -LOOK
        self._running, self._finished = dict[Any, UnitTask](), SimpleQueue[Any]()
        # Units to hand out once more, and units whose worker died, which are tried alone.
        self._again, self._suspects = deque[UnitTask](), deque[UnitTask]()
        # Units that killed a worker when alone, and why a worker gets no units, by worker.
        self._guilty, self._refused = list[UnitTask](), dict[str, str]()
        # For provenance: machine and units of each worker.
        self._machines, self._made = dict[str, str](), dict[str, list[UnitTask]]()

    def check(self) -> None:
        """Raise UsageError where a worker computes with something else, or where there is none."""
        self._look()
        if not self._threads:
            raise UsageError(
                "the scheduler has no workers yet; start one with `dask worker ADDRESS "
                "--nthreads 1`, and run it again"
            )
        text, plugins = self._study.text, self._study.plugins
        reports = {
            worker: self._client.submit(remote.report, text, plugins, workers=[worker], pure=False)
            for worker in sorted(self._threads)
        }
        # All workers report at the same time, so they share one limit; the last one still gets 0.1
        # s.
        end = time.monotonic() + REPORTING
        for worker, future in reports.items():
            self._check(worker, future, max(0.1, end - time.monotonic()))

    def _check(self, worker: str, future: Any, patience: float) -> None:
        """Raise UsageError where a worker cannot load the study, or computes with other code.

        `future` is the worker's report, which is awaited for `patience` [s]; a slow worker passes
        here and is checked again before its first unit.
        """
        try:
            report = future.result(timeout=patience)
        except TimeoutError:  # it is slow, or gone
            return
        except LOST as error:
            raise lost_scheduler(error) from error
        except Exception as error:  # podusv or Dask may be another one there, or miss
            raise UsageError(f"worker {worker} cannot load the study: {_words(error)}") from error
        finally:
            future.release()
        if wrong := remote.differing(self._ours, report):
            raise UsageError(f"worker {worker} computes with something else: {wrong}")

    def __call__(self, units: Units, done: Done) -> bool:
        """As `Executor` says. Raises StorageError where the scheduler is lost.

        An interrupt is let through only while waiting, so that no outcome is taken in half.
        """
        with interrupts_deferred():
            try:
                while self._fill(units):
                    with interrupts_enabled():
                        future, reply = self._wait()
                    if reply:
                        self._receive(self._running.pop(future), reply, done)
            except KeyboardInterrupt:
                return False
            finally:
                self._client.cancel(list(self._running))
                self._running.clear()
        return True

    def _fill(self, units: Units) -> bool:
        """Hand out units while workers have room; whether any unit is under way or waits."""
        self._look()
        # None: every worker, also one that joins later.
        allowed = frozenset(self._threads) - frozenset(self._refused) if self._refused else None
        # Where all are refused, units wait: a worker that fits may still join.
        while allowed != frozenset() and self._has_room() and (task := self._next(units)):
            self._submit(replace(task, allowed=allowed))
        return bool(self._running or self._again or self._suspects)

    def _has_room(self) -> bool:
        alone = any(task.alone for task in self._running.values())
        # Without a worker one unit waits at the scheduler, so that one that joins has work at once.
        return not alone and len(self._running) < max(1, WINDOW * sum(self._threads.values()))

    def _next(self, units: Units) -> UnitTask | None:
        """The next unit to hand out, or None where nothing can be handed out now.

        First units that a worker gave back, then new ones; suspects go last, one at a time.
        """
        if self._again:
            return self._again.popleft()
        if not self._suspects:
            taken = next(units, None)
            if not taken:
                return None
            number, plan, unit = taken
            task = UnitTask(number, plan.variant, unit)
            if not self._is_guilty(task):
                return task
            self._suspects.append(replace(task, alone=True))
        # A unit whose worker died may only have been beside the one that killed it.
        return None if self._running else self._suspects.popleft()

    def _is_guilty(self, task: UnitTask) -> bool:
        """Whether the unit is part of one that killed its worker when nothing else was under way.

        Halves of such a unit are tried alone from the start.
        """
        unit, at = task.unit, (task.variant, task.unit.law, task.unit.cell)
        return any(
            at == (guilty.variant, guilty.unit.law, guilty.unit.cell)
            and unit.first in guilty.unit.draws
            for guilty in self._guilty
        )

    def _submit(self, task: UnitTask) -> None:
        """Hand a unit to the cluster; its future is put into `_finished` when it is done."""
        # Text and numbers alone, see `remote`.
        future = self._client.submit(
            remote.make_unit,
            self._study.text,
            self._study.plugins,
            astuple(task.unit),
            digest(self._ours),
            astuple(task.variant) if task.variant else None,
            # Else Dask would take a unit that is tried again for one that it has made already.
            pure=False,
            workers=sorted(task.allowed) if task.allowed else None,
        )
        self._running[future] = task
        future.add_done_callback(self._finished.put)

    def _wait(self) -> tuple[Any, Reply | None]:
        """The next future that is done, and its reply; none when it is time to look for workers."""
        try:
            future = self._finished.get(timeout=LOOK)
        except Empty:
            return None, None
        # A future that was taken back comes here, too, and is no longer under way.
        return future, self._reply(future) if future in self._running else None

    def _reply(self, future: Any) -> Reply:
        """What a worker answered; an error becomes an outcome with a failure.

        `future` is that of Dask, and is over. Raises StorageError where the scheduler is lost.
        """
        if future.status == "error":
            error = future.exception()
            killed = type(error).__name__ == KILLED
            words = "the worker that made it ended, every time" if killed else _words(error)
            return Reply("", "", {}, Outcome(failure=words, killed=killed))
        try:
            reply: Reply = future.result()
        except Exception as error:
            raise lost_scheduler(error) from error
        future.release()
        return reply

    def _receive(self, task: UnitTask, reply: Reply, done: Done) -> None:
        """Pass an outcome on to `done`, or plan the unit again.

        It is planned again where the worker computes with something else, or died with other units
        under way, so that nobody knows which unit killed it.
        """
        if reply.outcome is None:
            self._refused[reply.worker] = (
                f"worker {reply.worker} got no units, because it computes with something else: "
                f"{remote.differing(self._ours, reply.report)}"
            )
            self._again.append(task)
        elif reply.outcome.killed and not task.alone:
            self._suspects.append(replace(task, alone=True))
        else:
            # No worker has signed it: the unit, alone, ended its worker, or Dask failed.
            if reply.worker:
                self._machines[reply.worker] = reply.machine
                self._made.setdefault(reply.worker, []).append(task)
            else:
                self._guilty.append(task)
            done(task.number, reply.outcome)

    def _look(self) -> None:
        """Note which workers there are; take back units that none of them may make."""
        if time.monotonic() - self._looked < LOOK:
            return
        self._looked = time.monotonic()
        try:
            # All of them: by default newer versions of Dask tell of five.
            workers = self._client.scheduler_info(n_workers=-1)["workers"]
        except LOST as error:
            raise lost_scheduler(error) from error
        self._threads = {name: worker["nthreads"] for name, worker in workers.items()}
        # A future that is bound to workers that left would wait without end.
        for future, task in list(self._running.items()):
            if task.allowed is not None and task.allowed.isdisjoint(self._threads):
                self._again.append(self._running.pop(future))
                self._client.cancel([future])

    @property
    def workers(self) -> int:
        """How many threads all present workers have together."""
        return max(1, sum(self._threads.values()))

    def provenance(self) -> dict[str, Any]:
        """Which worker made how many runs, of the study which ones, and who was refused."""
        workers = [
            {
                "worker": worker,
                "machine": self._machines[worker],
                "runs": sum(task.unit.count for task in tasks),
                "units": list(_join_units(task.unit for task in tasks if task.variant is None)),
            }
            for worker, tasks in self._made.items()
        ]
        return {"workers": workers, "refused": self._refused}


def lost_scheduler(error: BaseException) -> StorageError:
    """What to say where the scheduler does not answer any more."""
    return StorageError(
        f"the connection to the scheduler was lost ({_words(error)}); all finished units are kept: "
        "run it again to continue"
    )


def _join_units(units: Iterable[Unit]) -> Iterator[str]:
    """Units as text, with adjoining ones as one: `pid[0] draws 0 to 63` (0 is the cell)."""
    joined: list[Unit] = []
    for unit in sorted(units):
        last = joined[-1] if joined else None
        if last and (last.law, last.cell, last.draws.stop) == (unit.law, unit.cell, unit.first):
            joined[-1] = replace(last, count=last.count + unit.count)
        else:
            joined.append(unit)
    for unit in joined:
        yield f"{unit.law}[{unit.cell}] draws {unit.first} to {unit.draws[-1]}"


def _words(error: BaseException) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"
