"""A client of Dask whose workers make up the results of units at once, without simulating."""

from dataclasses import dataclass, field

import numpy as np

from podusv_cli.process.workers import Outcome
from podusv_cli.studies.counting.runs import Unit, UnitResult
from podusv_cli.studies.making import remote
from podusv_cli.studies.making.plan import digest
from podusv_cli.studies.making.remote import Reply

REPORT = {"podusv": "1.0", "numpy": "2.0", "the kernels of pid": "abc", "the study": "def"}


class KilledWorker(Exception):
    """As Dask's, by name."""


def invented(unit, metrics):
    """A result of a unit in which every number tells the draw."""
    numbers = np.arange(unit.first, unit.draws.stop, dtype=float)
    status = np.zeros(unit.count, np.uint8)
    return UnitResult(unit, dict.fromkeys(metrics, numbers), status, numbers, ("",) * unit.count)


@dataclass(eq=False)
class StubFuture:
    """A task; it is done when somebody wants to know."""

    client: object
    function: object
    args: tuple
    options: dict
    status: str = "pending"
    value: object = None

    def add_done_callback(self, callback):
        self.client.waiting.append((self, callback))

    def result(self, timeout=None):
        if self.function is remote.report:
            if self.client.lost_reporting:
                raise self.client.lost_reporting
            return self.client.reports[self.options["workers"][0]]
        if self.status == "cancelled":
            raise RuntimeError("scheduler-connection-lost")
        return self.value

    def exception(self):
        return self.value

    def release(self):
        self.client.released += 1


@dataclass(eq=False)
class StubClient:
    """Workers by name with their reports; `deadly` draws end the worker, `after` is called."""

    metrics: tuple
    reports: dict
    seconds: float = 0.5  # of computing that each run is said to take
    deadly: frozenset = frozenset()
    lost_after: float = float("inf")  # units, after which the scheduler is gone
    lost_reporting: Exception | None = None  # what a report raises, as the scheduler is gone
    join: dict = field(default_factory=dict)  # workers that join after the first unit
    waiting: list = field(default_factory=list)
    cancelled: list = field(default_factory=list)
    made: list = field(default_factory=list)  # of (worker, unit)
    killers: list = field(default_factory=list)  # units that ended their worker
    submitted: int = 0
    released: int = 0
    most: int = 0  # tasks at a time
    looks: int = 0

    def scheduler_info(self, n_workers):
        self.looks += 1
        return {"workers": {name: {"nthreads": 1} for name in self.reports}}

    def submit(self, function, *args, **options):
        self.submitted += 1
        return StubFuture(self, function, args, options)

    def cancel(self, futures):
        self.cancelled += futures

    def finish(self):
        """Let the longest-waiting task be done; called in place of waiting."""
        self.most = max(self.most, len(self.waiting))
        beside = [Unit(*future.args[2]) for future, _ in self.waiting]
        future, callback = self.waiting.pop(0)
        if len(self.made) >= self.lost_after:
            future.status = "cancelled"
        elif any(draw in self.deadly for unit in beside for draw in unit.draws):
            future.status, future.value = "error", KilledWorker("died")
            self.killers.append(Unit(*future.args[2]))
        else:
            future.status, future.value = "finished", self._reply(future)
        callback(future)

    def _reply(self, future):
        _, _, place, expected, _ = future.args
        workers = future.options["workers"] or list(self.reports)
        worker, unit = workers[len(self.made) % len(workers)], Unit(*place)
        told = self.reports[worker]
        self.made.append((worker, unit))
        self.reports |= self.join
        outcome = None
        if digest(told) == expected:
            outcome = Outcome((invented(unit, self.metrics), self.seconds * unit.count))
        return Reply(worker, "a stub", told, outcome)
