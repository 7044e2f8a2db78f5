"""Gains that a search found, judged on the draws of another scenario, such as another hull's.

    python examples/reproduce/judge.py CONFIG GAINS FOLDER

CONFIG has the keys `sweep` and `tune` and the laws of the search; GAINS is the search's gains.csv.
Every law meets `tune.validate` draws of CONFIG with its own gains ("before") and with those of each
search ("after"). FOLDER gets laws.csv and searches.csv; docs/tuning.md says what is in them.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from podusv_cli.components.controllers.base import Controller
from podusv_cli.core.kernel import Vector
from podusv_cli.process.workers import run_all
from podusv_cli.scenario.load import load
from podusv_cli.scenario.sweep import Sweep
from podusv_cli.studies.counting import statistics
from podusv_cli.studies.making.check import sweep_faults
from podusv_cli.studies.making.plan import StudyPlan
from podusv_cli.studies.making.unit import Unit, UnitResult, make, prepare
from podusv_cli.studies.tuning import searches
from podusv_cli.studies.tuning.check import tune_faults
from podusv_cli.studies.tuning.objective import Outcomes, excess
from podusv_cli.studies.tuning.plan import VALIDATE, TunePlan
from podusv_cli.studies.tuning.results import worst_where_unknown

METRIC = "iae"
Numbers = dict[str, float]  # of a law, by key


def sets_of_gains(gains: pd.DataFrame, law: Controller) -> list[Numbers]:
    """The numbers that a law is to have: none of its own changed, then those of each search.

    A gain that the scenario has another value for than the search began with is changed by the
    factor that the search changed it by. A law without gains is judged as it is.
    """
    columns = []
    for name, before, found in zip(gains.gain, gains.before, gains.repeats, strict=True):
        factor = getattr(law, name) / float(before)
        columns.append([(name, float(number) * factor) for number in str(found).split()])
    return [{}, *(map(dict, zip(*columns, strict=True)) if columns else [{}])]


def simulated(plan: TunePlan, sets: Mapping[str, list[Numbers]]) -> dict[str, list[Outcomes]]:
    """The runs of every law with each of its sets of gains; equal sets are simulated once."""
    keys = {law: [(law, tuple(numbers.items())) for numbers in each] for law, each in sets.items()}
    every = dict.fromkeys(key for each in keys.values() for key in each)
    names = {key: f"{key[0]} {number}" for number, key in enumerate(every)}
    laws = {name: (law, dict(new)) for (law, new), name in names.items()}
    study = plan.variant(laws, VALIDATE, plan.tune.validate)
    for each in keys.values():  # compiled before the fork
        prepare(study, names[each[0]], 0, len(each) * plan.tune.validate)
    met = dict(zip(every, all_made(study, list(laws)), strict=True))
    return {law: [plan.runs([met[key]]) for key in each] for law, each in keys.items()}


def all_made(study: StudyPlan, names: Sequence[str]) -> list[UnitResult]:
    """All draws of every law by name, in as many processes as there are cores."""
    units = [Unit(name, 0, 0, study.sweep.draws) for name in names]
    outcomes = run_all([partial(make, study, unit) for unit in units])
    if failures := [outcome.failure for outcome in outcomes if outcome.failure]:
        raise RuntimeError(failures[0])
    return [outcome.result for outcome in outcomes]


def errors(met: Sequence[Outcomes]) -> Vector:
    """The metric by set of gains and draw, infinite for a run that failed."""
    return np.array([worst_where_unknown(runs, METRIC) for runs in met])


@dataclass(frozen=True)
class Verdict:
    """What the runs of all laws say."""

    plan: TunePlan
    runs: Mapping[str, Sequence[Outcomes]]  # by law: those before, then those of each search

    @property
    def sweep(self) -> Sweep:
        """Level and seed of the intervals."""
        return self.plan.base.sweep

    def pairs(self) -> pd.DataFrame:
        """Every pair of laws over all of their searches and draws."""
        after = {law: errors(met[1:]) for law, met in self.runs.items()}
        level, seed, sets = self.sweep.level, self.sweep.seed, self.plan.tune.training_sets
        return searches.ratios(after, level, seed, sets=sets)

    def laws(self, pairs: pd.DataFrame) -> pd.DataFrame:
        """A row a law, the least median of its searches first."""
        places = searches.places(pairs, list(self.runs))
        table = pd.DataFrame({"law": law, **self._law(law)} for law in self.runs)
        table.insert(1, "place_low", [places[law][0] for law in table.law])
        table.insert(2, "place_high", [places[law][1] for law in table.law])
        return table.sort_values("after", kind="stable")

    def _law(self, law: str) -> dict[str, Any]:
        before, *after = self.runs[law]
        own, found = errors([before]), errors(after)
        medians = statistics.quantile(found, 0.5, self.sweep.level).estimate
        held = [self._holds(runs) for runs in (before, *after)]
        return {
            "searches": len(after),
            "draws": own.size,
            "failed_before": before.failed.mean(),
            **over_searches("failed_after", [runs.failed.mean() for runs in after]),
            **statistics.quantile(own[0], 0.5, self.sweep.level).columns("before"),
            **over_searches("after", medians),
            **dict(self._ratio(own, found)),
            "held_before": held[0],
            "held_after": sum(held[1:]),
        }

    def _ratio(self, own: Vector, found: Vector) -> Iterator[tuple[str, float]]:
        """After over before, at a level at which the intervals of all laws hold together."""
        level = 1.0 - (1.0 - self.sweep.level) / len(self.runs)
        row = searches.ratios({"after": found, "before": own}, level, self.sweep.seed).iloc[0]
        return ((end, row[end]) for end in ("ratio", "ratio_low", "ratio_high"))

    def _holds(self, runs: Outcomes) -> bool:
        """Whether the runs hold all inequalities of the search."""
        return all(excess(one, runs, self.plan.metrics) <= 0.0 for one in self.plan.inequalities)


def over_searches(name: str, values: Sequence[float] | Vector) -> dict[str, float]:
    """Median and range."""
    return {name: float(np.median(values)), f"{name}_low": min(values), f"{name}_high": max(values)}


def judged(config: Path, gains: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The tables by name."""
    plan = TunePlan(load(config, (), [sweep_faults, tune_faults]).scenario)
    sets = {law: sets_of_gains(gains[gains.law == law], one) for law, one in plan.laws.items()}
    verdict = Verdict(plan, simulated(plan, sets))
    pairs = verdict.pairs()
    return {"laws": verdict.laws(pairs), "searches": pairs}


def main() -> None:
    """Judge, and write the tables."""
    config, gains, folder = map(Path, sys.argv[1:])
    tables = judged(config, pd.read_csv(gains))
    folder.mkdir(parents=True, exist_ok=True)
    for name, table in tables.items():
        table.to_csv(folder / f"{name}.csv", index=False, float_format="%.6g", lineterminator="\n")


if __name__ == "__main__":
    main()
