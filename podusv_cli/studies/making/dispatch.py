"""Simulating all units of a plan that are not there yet, in processes of one machine or of many."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import count, islice
from operator import length_hint
from typing import Any, Protocol, Self

import numpy as np

from podusv_cli.core.errors import PodusvError
from podusv_cli.process.workers import Job, Outcome, available_workers, run_each
from podusv_cli.studies.counting.runs import STATUSES, Mask, Unit, UnitResult
from podusv_cli.studies.counting.runs_file import stretches
from podusv_cli.studies.making.plan import LawInCell, StudyPlan
from podusv_cli.studies.making.store import Store
from podusv_cli.studies.making.unit import Part, alike, crashed_unit, make_together, prepare

FIRST = 8  # draws of a unit before it is known how long a run takes
AIM = 4.0  # s of computing that a unit is to take
MOST = 4096  # draws of a unit
TOGETHER = 16  # units, at most, that are made in one process
# Causes are part of runs.h5, which has the same bytes whichever executor made it.
ENDED = "it ended its process, each time that it was made; provenance.json tells how"
EARLY = 3.0  # s in which a rate says little, as no unit or few are made


Shard = tuple[int, int]  # its number from 1, and how many there are


@dataclass
class StudyTally:
    """How far a study is, for its progress."""

    wanted: int
    made: int = 0
    failed: int = 0
    began: float = field(default_factory=time.monotonic)
    before: int = 0  # runs that were there already
    computed: dict[str, float] = field(default_factory=dict)  # processor time by law [s]
    ran: dict[str, int] = field(default_factory=dict)  # runs by law of which this is the time
    ended: dict[str, str] = field(default_factory=dict)  # runs that ended their process, and how

    @classmethod
    def of(cls, there: Mapping[tuple[str, int], Mask]) -> Self:
        """That of a study in which these runs are there."""
        made = sum(int(mask.sum()) for mask in there.values())
        return cls(sum(map(len, there.values())), made, before=made)

    def note(self, unit: Unit, seconds: float) -> None:
        """Enter the processor time `seconds` [s] of a unit."""
        self.computed[unit.law] = self.computed.get(unit.law, 0.0) + seconds
        self.ran[unit.law] = self.ran.get(unit.law, 0) + unit.count

    @property
    def rate(self) -> float:
        """Runs a second, of those made now."""
        return (self.made - self.before) / max(time.monotonic() - self.began, 1e-9)

    @property
    def left(self) -> float:
        """The time until all runs are made at this rate [s].

        It is infinite while it is too early to say.
        """
        early = time.monotonic() - self.began < EARLY
        return math.inf if early or not self.rate else (self.wanted - self.made) / self.rate


Tell = Callable[[StudyTally], None]
Gaps = dict[LawInCell, int]  # how many runs, by law and cell
# Numbered, with the study that each is of; after the last, there may be more.
Units = Iterator[tuple[int, StudyPlan, Unit]]
Done = Callable[[int, Outcome], None]


class Executor(Protocol):
    """Where units are made."""

    def __call__(self, units: Units, done: Done) -> bool:
        """Take units as workers become free, and tell the outcome of each by its number.

        `done` may add units to those that are still to be taken. The result of an outcome is that
        of `timed`. False after an interrupt; units under way have no outcome then.
        """

    @property
    def workers(self) -> int:
        """How many units are made at a time."""

    def provenance(self) -> dict[str, Any]:
        """What a study's provenance has to say about the workers."""


@dataclass(frozen=True)
class Processes:
    """Units are made in processes of this machine."""

    count: int = 0  # one a core

    def __call__(self, units: Units, done: Done) -> bool:
        """As `Executor` says."""
        shares = _Shares(units, done, self.workers)
        return run_each(shares, shares.take_outcome, workers=self.workers)

    @property
    def workers(self) -> int:
        """As asked for, or one a core."""
        return self.count or available_workers()

    def provenance(self) -> dict[str, Any]:
        """Nothing: the workers are those of the machine."""
        return {}


class _Shares:
    """Jobs, each of a unit or of several that wait at once, numbered by its first.

    A process begins by copying what this one has, which takes as long as a few short runs; and
    runs of several units march side by side. If it is killed, each of its units has one of its own.
    """

    def __init__(self, units: Units, done: Done, workers: int) -> None:
        """`units` are dealt to `workers` processes, several a job where they are short.

        `done` is called for each.
        """
        self._units, self._done, self._workers = units, done, workers
        self._parts = dict[int, list[tuple[int, StudyPlan, Unit]]]()
        self._again = deque[tuple[int, StudyPlan, Unit]]()

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> tuple[int, Job]:
        """A number, and the job that makes one share; raises StopIteration at the end."""
        parts = [self._again.popleft()] if self._again else self._take_share()
        number = parts[0][0]
        self._parts[number] = parts
        return number, partial(_timed_together, [(plan, unit) for _, plan, unit in parts])

    def _take_share(self) -> list[tuple[int, StudyPlan, Unit]]:
        """The next units for one process: an equal share of those that wait, TOGETHER at most."""
        # A driver that does not say how many units wait (length hint 0) gets one unit a job.
        first, waiting = next(self._units), length_hint(self._units)
        return [first, *islice(self._units, min(TOGETHER - 1, waiting // self._workers))]

    def take_outcome(self, number: int, outcome: Outcome) -> None:
        """Tell the outcome of each unit of the job `number`.

        A killed job's units are made once more, singly.
        """
        parts = self._parts.pop(number)
        if outcome.killed and len(parts) > 1:
            self._again.extend(parts)
            return
        results = outcome.result or [None] * len(parts)
        for (own, _, _), result in zip(parts, results, strict=True):
            self._done(own, replace(outcome, result=result))


def _timed_together(
    parts: Sequence[Part], progress: Callable[[float], None]
) -> list[tuple[UnitResult, float]]:
    """The result of each unit with its processor time [s], in the order of `parts`.

    Units that are `alike` march as one batch. Its time is divided in proportion to their draws.
    """
    kinds = [alike(part) for part in parts] if len(parts) > 1 else [""]
    made: dict[int, tuple[UnitResult, float]] = {}
    for kind in dict.fromkeys(kinds):
        own = [i for i, other in enumerate(kinds) if other == kind]
        began = time.process_time()
        results = make_together([parts[i] for i in own])
        each = (time.process_time() - began) / sum(result.unit.count for result in results)
        made |= {i: (r, each * r.unit.count) for i, r in zip(own, results, strict=True)}
    return [made[i] for i in range(len(parts))]


class StudyDriver:
    """Hands out units, keeps what comes back, and finds the run that ends its process."""

    def __init__(
        self, store: Store, plan: StudyPlan, tell: Tell, until: float, part: Shard
    ) -> None:
        """Hand out the missing runs of one shard (`part`) until the monotonic time `until` [s]."""
        self.store, self.plan, self._tell, self._until = store, plan, tell, until
        there, inside = store.covered_draws(), np.zeros(self.plan.sweep.draws, bool)
        inside[shard(len(inside), *part)] = True
        self._gaps = {key: stretches(inside & np.logical_not(mask)) for key, mask in there.items()}
        self.tally = StudyTally.of({key: mask[inside] for key, mask in there.items()})
        self._units, self._numbers = dict[int, Unit](), count()
        # Halves of units that ended their process; they come before anything else.
        self._halves: deque[Unit] = deque()
        self._seconds = 0.0  # of computing a run, so far the longest average of a unit
        self.failure: Outcome | None = None

    def __iter__(self) -> Units:
        """The units; more may come while some are under way."""
        return self

    def __next__(self) -> tuple[int, StudyPlan, Unit]:
        """The next unit with a number of its own and the plan; StopIteration at the end."""
        unit = self._next()
        if unit is None:
            raise StopIteration
        number = next(self._numbers)
        self._units[number] = unit
        return number, self.plan, unit

    def missing(self) -> Gaps:
        """How many runs of each law and cell are missing, without those of which none is."""
        return {key: sum(map(len, ranges)) for key, ranges in self._gaps.items() if ranges}

    def _next(self) -> Unit | None:
        """The next range of missing draws of a law in a cell, or None when all are handed out.

        None, too, after a failure and when the time is over; units under way still come back, and
        so do the halves of one that ended its worker.
        """
        if self._halves:
            return self._halves.popleft()
        if self.failure or time.monotonic() > self._until:
            return None
        left = {key: ranges for key, ranges in self._gaps.items() if ranges}
        if not left:
            return None
        # All laws advance together, so that an unfinished study compares them on the same draws.
        law, cell = min(left, key=lambda key: left[key][0].start)
        ranges = self._gaps[law, cell]
        first, stop = ranges[0].start, min(ranges[0].stop, ranges[0].start + self._size())
        ranges[0] = range(stop, ranges[0].stop)
        if not ranges[0]:
            ranges.pop(0)
        return Unit(law, cell, first, stop - first)

    def _size(self) -> int:
        return min(MOST, max(FIRST, round(AIM / self._seconds))) if self._seconds else FIRST

    def take_outcome(self, number: int, outcome: Outcome) -> None:
        """Keep the result of unit `number`; halve one that ended its process.

        Halving goes on until the single run is found, which then counts as crashed.
        """
        unit = self._units.pop(number)
        if outcome.result:
            result, seconds = outcome.result
            # The slowest law sets the size of units, so that none takes much longer than AIM.
            self._seconds = max(self._seconds, seconds / unit.count)
            self.tally.note(unit, seconds)
            self._keep(result)
        elif outcome.killed and unit.count > 1:
            self._halves.extend(unit.halves())
        elif outcome.killed:
            self.tally.ended[f"{unit.law}[{unit.cell}] draw {unit.first}"] = outcome.failure
            self._keep(crashed_unit(unit, self.plan.metrics, ENDED))
        elif not outcome.interrupted:
            self.failure = outcome

    def _keep(self, result: UnitResult) -> None:
        """Write a unit's result, and tell how many runs are made."""
        self.store.write(result)
        self.tally.made += result.unit.count
        self.tally.failed += int(np.count_nonzero(result.status != STATUSES.index("finished")))
        self._tell(self.tally)


def time_unit(
    plan: StudyPlan, unit: Unit, progress: Callable[[float], None]
) -> tuple[UnitResult, float]:
    """A unit, and the processor time that it took [s]."""
    return _timed_together([(plan, unit)], progress)[0]


def shard(draws: int, number: int, count: int) -> slice:
    """The draws of shard `number` (from 1) of `count`, as a slice; sizes differ by one at most."""
    return slice((number - 1) * draws // count, number * draws // count)


def dispatch(
    store: Store,
    plan: StudyPlan,
    tell: Tell,
    executor: Executor,
    *,
    seconds: float = math.inf,
    part: Shard = (1, 1),
    begin: Callable[[Gaps, Mapping[str, str]], None] = lambda missing, alone: None,
) -> tuple[StudyTally, bool]:
    """Simulate what is missing; how far it is, and whether all runs of this part are made.

    `tell` is called after each unit. `seconds` limits the time in which units are handed out [s],
    `part` is the shard. `begin` is told before the first run what is missing, and which laws march
    one by one and why. Every unit is on the disk before its process gets another. Raises
    PodusvError where a unit cannot be made or written, KeyboardInterrupt after an interrupt; what
    is made is kept.
    """
    driver = StudyDriver(store, plan, tell, time.monotonic() + seconds, part)
    missing = driver.missing()
    # Before the fork, so that no process compiles it again.
    reasons = {law: prepare(plan, law, cell) for law, cell in missing}
    begin(missing, {law: why for law, why in reasons.items() if why})
    driver.tally.began = time.monotonic()  # compiling and timing are over
    finished = executor(driver, driver.take_outcome)
    if driver.failure:
        raise PodusvError(driver.failure.failure)
    if not finished:
        raise KeyboardInterrupt
    return driver.tally, driver.tally.made == driver.tally.wanted
