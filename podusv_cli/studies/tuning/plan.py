"""What a search is to simulate: laws with their gains, draws of three streams, and its identity."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from podusv_cli.components.controllers.base import Controller
from podusv_cli.core.errors import UsageError
from podusv_cli.metrics.metric import Metric
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.tune import Tune
from podusv_cli.studies.counting.expressions import judge_success, parse_success
from podusv_cli.studies.counting.runs import STATUSES, UnitResult
from podusv_cli.studies.making.cells import Cell
from podusv_cli.studies.making.check import singles
from podusv_cli.studies.making.plan import StudyPlan, Variant
from podusv_cli.studies.tuning.objective import (
    Inequality,
    Outcomes,
    parse_inequality,
    parse_objective,
)
from podusv_cli.studies.tuning.space import Gain, gains

TRAIN, VALIDATE = "tune", "tune validation"  # streams of draws, beside a sweep's own
# Settings that change no trial: more of them continues a search.
OPEN = ("budget", "validate", "repeats")
ENOUGH = 10  # whole trials for each gain; with fewer, repeats end in different places
Contestant = tuple[str, Mapping[str, Any]]  # a law of the scenario, and its numbers that are others


def is_few(trials: int, gains: int) -> bool:
    """Whether so many trials on all draws are few for so many gains."""
    return trials < ENOUGH * gains


@dataclass(frozen=True)
class TunePlan:
    """A scenario with the keys `sweep` and `tune`."""

    scenario: Scenario
    idle: Mapping[str, Sequence[str]] = field(default_factory=dict)  # change no run, by law

    @property
    def tune(self) -> Tune:
        """The settings of the search. Raises UsageError where the scenario has none."""
        if self.scenario.tune is None:
            raise UsageError(f"{self.scenario.name} has no key `tune`; see podusv docs tuning")
        return self.scenario.tune

    @cached_property
    def laws(self) -> dict[str, Controller]:
        """The laws that take part, by name."""
        return {label: single.controller for label, single in singles(self.scenario).items()}

    @cached_property
    def gains(self) -> dict[str, tuple[Gain, ...]]:
        """The gains of every law; none for a law that is kept as it is."""
        return {
            label: tuple(
                gain
                for gain in gains(single.controller, label, single, self.tune)
                if gain.key not in self.idle.get(label, ())
            )
            for label, single in singles(self.scenario).items()
        }

    @cached_property
    def metrics(self) -> dict[str, Metric]:
        """All metrics by name."""
        return self.scenario.known_metrics()

    @cached_property
    def objective(self) -> Any:
        """The tree of the objective."""
        return parse_objective(self.tune.objective, self.metrics)

    @cached_property
    def inequalities(self) -> list[Inequality]:
        """What has to hold."""
        return [parse_inequality(text, self.metrics) for text in self.tune.subject_to]

    @cached_property
    def _success(self) -> Any:
        assert self.scenario.sweep
        return parse_success(self.scenario.sweep.success, self.metrics)

    def runs_wanted(self) -> dict[str, tuple[int, int]]:
        """For every law, the runs of its searches and those on the draws for validation.

        The scenario's gains and those of each search meet all draws for validation.
        """
        tune = self.tune
        return {
            law: (tune.searches * tune.budget, (1 + tune.searches) * tune.validate)
            if of_law
            else (0, tune.validate)
            for law, of_law in self.gains.items()
        }

    def in_words(self) -> Iterator[str]:
        """The gains of every law, and how many runs there are."""
        for law, of_law in self.gains.items():
            if of_law:
                names = ", ".join(gain.key for gain in of_law)
                yield f"gains of {law} ({len(of_law)}): {names}{self._few(len(of_law))}"
            else:
                yield f"{law} has no gains and is kept as it is"
        yield "gains that change no run are left out when the search begins"
        yield self.size

    def _few(self, gains: int) -> str:
        """What to say of a budget that is small for so many gains."""
        whole = self.tune.budget // self.tune.train
        few = is_few(whole, gains)
        return f"; a budget of {whole} trials on all draws is few for them" if few else ""

    @property
    def size(self) -> str:
        """How many runs the searches and their validation take, in words."""
        search, other = (sum(n) for n in zip(*self.runs_wanted().values(), strict=True))
        tune = self.tune
        return (
            f"runs of the search: {search:,} (budget {tune.budget:,} for each law, repeats: "
            f"{tune.repeats}, training sets: {tune.training_sets}); on draws for validation: "
            f"{other:,}"
        )

    @cached_property
    def base(self) -> StudyPlan:
        """The scenario's own study, which all others are variants of."""
        return StudyPlan(self.scenario, (Cell(0, (), self.scenario),))

    def stream(self, search: int) -> str:
        """The name of the stream of training draws of search number `search` (from 0).

        Training sets are given out in turn; searches n and n + training_sets share one.
        """
        training_set = search % self.tune.training_sets
        return f"{TRAIN} {training_set}" if training_set else TRAIN

    def variant(self, laws: Mapping[str, Contestant], stream: str, draws: int) -> StudyPlan:
        """The study of `laws`, by their new names, on `draws` draws of a stream."""
        renamed = tuple((name, law, tuple(new.items())) for name, (law, new) in laws.items())
        return self.base.with_variant(Variant(stream, draws, renamed))

    def runs(self, results: list[UnitResult]) -> Outcomes:
        """The runs of some units of one law, in their order.

        Failed are those that the study does not call a success.
        """
        import numpy as np

        names = dict.fromkeys(name for result in results for name in result.metrics)
        # A unit whose gains the law refused has no metrics.
        blank = {id(result): np.full(result.unit.count, np.nan) for result in results}
        metrics = {
            name: np.concatenate(
                [result.metrics.get(name, blank[id(result)]) for result in results]
            )
            for name in names
        }
        ended = np.concatenate([result.status == STATUSES.index("finished") for result in results])
        return Outcomes(metrics, ~judge_success(self._success, metrics, ended, self.metrics))

    @cached_property
    def identity(self) -> dict[str, Any]:
        """All that the trials depend on, by dotted keys; searches that agree can be continued."""
        whole = self.variant({law: (law, {}) for law in self.laws}, TRAIN, self.tune.train)
        settings = {f"tune.{k}": v for k, v in self.tune.model_dump(exclude=set(OPEN)).items()}
        assert self.scenario.sweep
        return {**settings, "sweep.success": self.scenario.sweep.success, **whole.identity}
