"""The search for the gains of one law: batch by batch, each in two steps of simulation.

All trials of a batch meet the first draws; those that are clearly worse than the best of earlier
batches are pruned, the others meet the rest. What is simulated is decided by trials of earlier
batches alone, so it does not depend on the order in which runs end.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from podusv_cli.core.errors import StorageError
from podusv_cli.studies.counting.runs import STATUSES, Unit, UnitResult
from podusv_cli.studies.making.plan import StudyPlan
from podusv_cli.studies.tuning import trials
from podusv_cli.studies.tuning.objective import Outcomes, evaluate, excess
from podusv_cli.studies.tuning.plan import TunePlan
from podusv_cli.studies.tuning.sampler import Sampler
from podusv_cli.studies.tuning.space import with_gains
from podusv_cli.studies.tuning.trials import CUT, FINISHED, PRUNED, GainTrial

FIRST = 4  # a trial is judged after one in so many draws
WORSE = 1.5  # times the best: a trial that is worse by more is pruned


@dataclass
class Attempt:
    """A trial under way: its gains, how many draws it may meet, and what it has met so far.

    `plan` is None where the law refuses the gains.
    """

    gains: dict[str, object]
    draws: int
    plan: StudyPlan | None
    results: list[UnitResult]

    @property
    def draws_met(self) -> int:
        """How many draws it has met."""
        return sum(result.unit.count for result in self.results)


class GainSearch:
    """The search for the gains of a law with one of the tuner's seeds."""

    def __init__(self, plan: TunePlan, law: str, number: int, folder: Path) -> None:
        """Nothing is asked yet. `number` counts the law's searches; it also seeds the sampler.

        `folder` holds the trials of an earlier session, if any.
        """
        self.plan, self.law, self.number, self._folder = plan, law, number, folder
        assert plan.scenario.sweep
        seed = [plan.scenario.sweep.seed, number, law]
        self._sampler = Sampler(plan.gains[law], seed)
        self.trials: list[GainTrial] = []
        self.leader: GainTrial | None = None  # of the trials so far
        self._kept = trials.read(folder, self.name)
        self._batch = 0
        self._attempts: list[Attempt] = []
        self._waiting = 0

    @property
    def name(self) -> str:
        """The name of its file."""
        return f"{self.law}-{self.number}"

    @property
    def runs_spent(self) -> int:
        """How many runs its trials took."""
        return sum(trial.runs for trial in self.trials)

    @property
    def first(self) -> int:
        """After how many draws a trial is judged."""
        return max(1, self.plan.tune.train // FIRST)

    def begin(self) -> list[tuple[int, StudyPlan, Unit]]:
        """The first units of the next batch that has to be simulated; none when the budget is used.

        A unit comes with its trial's place in the batch. Batches that an earlier session has
        finished are given to the sampler without being simulated again.
        """
        while (left := self.plan.tune.budget - self.runs_spent) > 0:
            self._ask(left)
            kept = self._known_trials()
            if kept is not None:
                self._tell_sampler(kept)
            elif units := self._first_units():
                return units
        return []

    def _first_units(self) -> list[tuple[int, StudyPlan, Unit]]:
        """The units of a batch's first draws.

        Empty where the law refuses all gains; then the batch ends.
        """
        draws = self._attempts[0].draws
        # Refused gains fail at once, in both steps.
        units = self._units(min(self.first, draws)) or self._units(draws)
        if not units:
            self._end()
        return units

    def _ask(self, left: int) -> None:
        """Ask for the trials of a batch, as many as there is budget for (`left`, in runs).

        If it does not suffice for a whole trial, a single one is cut to what is left.
        """
        tune = self.plan.tune
        count, draws = min(tune.batch, left // tune.train), tune.train
        if not count:
            count, draws = 1, left
        self._attempts = [
            self._attempt(gains, draws) for gains in self._sampler.ask(self._batch, count)
        ]

    def _attempt(self, gains: dict[str, object], draws: int) -> Attempt:
        """A trial of these gains, to meet `draws` draws.

        It has no plan where the law refuses the gains.
        """
        taken = with_gains(self.plan.laws[self.law], gains)
        named = {self.law: (self.law, gains)}
        stream = self.plan.stream(self.number)
        return Attempt(gains, draws, self.plan.variant(named, stream, draws) if taken else None, [])

    def _known_trials(self) -> list[GainTrial] | None:
        """The trials of this batch in the file; None where it has to be simulated.

        That is so for a batch that is missing or that a smaller budget cut. Raises StorageError
        where the file has other gains than those asked for.
        """
        kept = [trial for trial in self._kept if trial.batch == self._batch]
        whole = [attempt.draws == self.plan.tune.train for attempt in self._attempts]
        if [trial.status != CUT for trial in kept] != whole:
            return None
        if [dict(trial.gains) for trial in kept] != [attempt.gains for attempt in self._attempts]:
            raise StorageError(
                f"{self._folder / trials.FOLDER}: batch {self._batch} of {self.name} has other "
                "gains than this machine asks for; continue the search on the machine that it "
                "began on, or name another folder with --out"
            )
        return kept

    def _units(self, until: int) -> list[tuple[int, StudyPlan, Unit]]:
        """The units that take every attempt to `until` draws, with its place in the batch.

        Pruned attempts get none; those that the law refuses fail at once.
        """
        units = []
        for place, attempt in enumerate(self._attempts):
            unit = Unit(self.law, 0, attempt.draws_met, until - attempt.draws_met)
            if not unit.count or self._is_over(attempt):
                continue
            if attempt.plan:
                units.append((place, attempt.plan, unit))
            else:
                attempt.results.append(self._refuse_unit(unit))
        self._waiting = len(units)
        return units

    def _refuse_unit(self, unit: Unit) -> UnitResult:
        """The result of a unit whose gains the law refuses: no run, all invalid."""
        nothing = np.full(unit.count, np.nan)
        status = np.full(unit.count, STATUSES.index("invalid"), np.uint8)
        return UnitResult(unit, {}, status, nothing, ("the law refuses these gains",) * unit.count)

    def take_result(self, place: int, result: UnitResult) -> list[tuple[int, StudyPlan, Unit]]:
        """Take in the result of the trial at `place`, and return the units to make next.

        Units follow once all results of the step are in.
        """
        self._attempts[place].results.append(result)
        self._waiting -= 1
        return [] if self._waiting else self._next()

    def _next(self) -> list[tuple[int, StudyPlan, Unit]]:
        """The next units: the rest of this batch's draws, or the first of the batch after it."""
        more = self._units(self._attempts[0].draws)
        if more:
            return more
        self._end()
        return self.begin()

    def _end(self) -> None:
        """Keep the trials of a batch."""
        self._tell_sampler(list(self._make_trials()))
        trials.write(self._folder, self.name, self.trials)

    def _is_over(self, attempt: Attempt) -> bool:
        """Whether a trial is pruned after the first draws.

        It is if a sound trial of earlier batches is far better on these draws.
        """
        # The very first batch is never pruned, as nothing is known to compare with.
        if not self.trials or attempt.draws_met < self.first:
            return False
        value = self._value(self._first(attempt))
        sound = [t for t in self.trials if t.status == FINISHED and t.excess == 0.0]
        return any(_far(trial.first, value) for trial in sound)

    def _make_trials(self) -> Iterator[GainTrial]:
        """The trials of the batch that is over: finished, pruned, or cut short by the budget.

        A trial that was cut was to meet fewer draws than `train` from the start.
        """
        tune = self.plan.tune
        for place, attempt in enumerate(self._attempts):
            runs, met = self._runs(attempt), attempt.draws_met
            status = (
                FINISHED if met == tune.train else CUT if attempt.draws < tune.train else PRUNED
            )
            yield GainTrial(
                len(self.trials) + place,
                self._batch,
                attempt.gains,
                met,
                status,
                self._value(runs),
                tuple(excess(text, runs, self.plan.metrics) for text in self.plan.inequalities),
                self._value(self._first(attempt)),
                float(np.mean(runs.failed)),
            )

    def _tell_sampler(self, made: Sequence[GainTrial]) -> None:
        """Give the sampler the results, and choose the leader of all trials."""
        self._sampler.tell([t.value for t in made], [t.excesses for t in made])
        self.trials += made
        self.leader = trials.best(self.trials)
        self._batch += 1

    def _runs(self, attempt: Attempt) -> Outcomes:
        return self.plan.runs(attempt.results)

    def _first(self, attempt: Attempt) -> Outcomes:
        """The runs of a trial's first draws, by which trials are compared for pruning."""
        metrics, failed = self._runs(attempt)
        return Outcomes({n: v[: self.first] for n, v in metrics.items()}, failed[: self.first])

    def _value(self, runs: Outcomes) -> float:
        """The objective of some runs; less is better."""
        return evaluate(self.plan.objective, runs, self.plan.metrics)


def _far(best: float, value: float) -> bool:
    """Whether a value is worse than the best by more than WORSE - 1 times its size."""
    # Not WORSE * best: an objective may be negative, and that would then be better.
    return value > best + (WORSE - 1.0) * abs(best)
