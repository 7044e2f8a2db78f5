"""Simulating what all searches ask for, in processes of this machine or by workers of a cluster.

Searches do not depend on each other, so units of all of them are made side by side.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

from podusv_cli.core.errors import PodusvError
from podusv_cli.process.workers import Outcome
from podusv_cli.studies.counting.runs import Unit, UnitResult
from podusv_cli.studies.making.dispatch import Executor, StudyTally
from podusv_cli.studies.making.plan import StudyPlan
from podusv_cli.studies.making.unit import crashed_unit
from podusv_cli.studies.tuning.search import GainSearch

Tell = Callable[[StudyTally, Sequence[GainSearch]], None]
TrialUnit = tuple[int, StudyPlan, Unit]  # a trial's place in its batch, and what to simulate


class SearchDriver:
    """Hands out the units of all searches, and gives each what comes back."""

    def __init__(self, searches: Sequence[GainSearch], tell: Tell) -> None:
        """Ask every search for its first units; `tell` is called after each unit with the tally."""
        self._searches, self._tell = searches, tell
        self._waiting = deque[tuple[GainSearch, TrialUnit]]()
        self._busy: dict[int, tuple[GainSearch, TrialUnit]] = {}
        self._number = 0
        self.failure = ""
        for search in searches:
            self._add(search, search.begin())
        budget = sum(search.plan.tune.budget for search in searches)
        # After `begin`, which has taken in the batches of earlier sessions: these are made already.
        spent = sum(search.runs_spent for search in searches)
        self.tally = StudyTally(budget, spent, before=spent)

    def __iter__(self) -> SearchDriver:
        """The units; more may come while some are under way."""
        return self

    def __length_hint__(self) -> int:
        """How many units wait."""
        return len(self._waiting)

    def __next__(self) -> tuple[int, StudyPlan, Unit]:
        """The next unit, with its number and its study."""
        if self.failure or not self._waiting:
            raise StopIteration
        search, trial_unit = self._waiting.popleft()
        self._number += 1
        self._busy[self._number] = search, trial_unit
        return self._number, trial_unit[1], trial_unit[2]

    def take_outcome(self, number: int, outcome: Outcome) -> None:
        """Give a search the result of unit `number`; runs that ended their process are crashed."""
        search, (place, plan, unit) = self._busy.pop(number)
        if outcome.result:
            self._take(search, place, outcome.result[0])
        elif outcome.killed:
            self._take(search, place, crashed_unit(unit, plan.metrics, outcome.failure))
        elif not outcome.interrupted:
            self.failure = outcome.failure

    def _take(self, search: GainSearch, place: int, result: UnitResult) -> None:
        """Give a search the result of its trial at `place`, and queue what it asks for next."""
        self._add(search, search.take_result(place, result))
        self.tally.made += result.unit.count
        self.tally.failed += sum(map(bool, result.causes))
        self._tell(self.tally, self._searches)

    def _add(self, search: GainSearch, units: Sequence[TrialUnit]) -> None:
        self._waiting.extend((search, trial_unit) for trial_unit in units)


def dispatch(searches: Sequence[GainSearch], executor: Executor, tell: Tell) -> StudyTally:
    """Bring all searches to the end of their budget; the tally of their runs.

    `tell` is called after each unit. Every batch is on the disk before the next of its search is
    asked for. Raises PodusvError where a unit cannot be made at all, KeyboardInterrupt after an
    interrupt; finished batches are kept.
    """
    driver = SearchDriver(searches, tell)
    finished = executor(driver, driver.take_outcome)
    if driver.failure:
        raise PodusvError(driver.failure)
    if not finished:
        raise KeyboardInterrupt
    return driver.tally
