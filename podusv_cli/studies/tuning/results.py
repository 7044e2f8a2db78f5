"""What a search found, as tables: gains, laws before and after, pairs of laws, every trial."""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from podusv_cli.core.kernel import Vector
from podusv_cli.studies.counting import statistics
from podusv_cli.studies.counting.runs_file import RunsTable
from podusv_cli.studies.counting.statistics import Interval
from podusv_cli.studies.telling import summary
from podusv_cli.studies.tuning.objective import (
    Inequality,
    OfGains,
    Outcomes,
    evaluate,
    excess,
    metrics_in,
    numbers_of,
    share_of,
)
from podusv_cli.studies.tuning.plan import TunePlan
from podusv_cli.studies.tuning.sampler import importances
from podusv_cli.studies.tuning.searches import LawRatios, compare_laws, places
from podusv_cli.studies.tuning.space import Gain
from podusv_cli.studies.tuning.trials import FINISHED, GainTrial, best
from podusv_cli.studies.tuning.validation import choose_search, searched_names, tuned_name

ALWAYS = (
    "iae",
    "z_e_steady",
    "e_ct_rms",
)  # metrics that the tables have beside those of the objective
VARIATION = "tv_tau_u"
MARGIN = 0.01  # relative, of pairs
PARTS = 8  # of the trials; importances are computed without each, to see how sure they are
FEWEST = 24  # trials that importances are computed from


@dataclass(frozen=True)
class SearchResults:
    """A finished search: its trials by law, a list for each search, and the runs on fresh draws."""

    plan: TunePlan
    trials: Mapping[str, Sequence[Sequence[GainTrial]]]
    runs: RunsTable

    @property
    def level(self) -> float:
        """Confidence of all intervals."""
        assert self.plan.scenario.sweep
        return self.plan.scenario.sweep.level

    @property
    def runs_spent(self) -> dict[str, int]:
        """How many runs the searches of each law simulated, by law."""
        return {
            law: sum(trial.runs for repeat in repeats for trial in repeat)
            for law, repeats in self.trials.items()
        }

    @cached_property
    def winners(self) -> dict[str, list[GainTrial]]:
        """The best trial of every search by law; none of a law that is kept as it is."""
        return {law: [best(one) for one in found] for law, found in self.trials.items()}

    @cached_property
    def shown_metrics(self) -> list[str]:
        """The metrics of the tables."""
        trees = [self.plan.objective, *(inequality.tree for inequality in self.plan.inequalities)]
        wanted = [name for tree in trees for name in metrics_in(tree, self.plan.metrics)]
        return [n for n in dict.fromkeys([*wanted, *ALWAYS]) if n in self.runs.metrics]

    def after(self, law: str) -> str:
        """The name of a law after the search, its own where it is kept as it is."""
        return tuned_name(law) if law in self.winners else law

    def winner(self, law: str) -> GainTrial:
        """The trial whose gains are taken."""
        return self.winners[law][choose_search(self.trials[law])]

    def outcomes_of(self, name: str) -> Outcomes:
        """The fresh runs of a law by the name of the table."""
        metrics = {n: self.runs.metric(name, n)[0] for n in self.runs.metrics}
        return Outcomes(metrics, ~self.runs.success(name)[0])

    @cached_property
    def laws(self) -> pd.DataFrame:
        """Every law: failures and objective before and after on the fresh draws, and its ranks.

        `place_low` and `place_high` are the ranks that it may have over all searches and draws; NaN
        where each law was searched once. A law that does not settle has no rank and no place.
        """
        table = pd.DataFrame([self._law(law) for law in self.plan.laws])
        for when in ("before", "after"):
            objectives = [
                number if self.settles(law, when) and math.isfinite(number) else math.nan
                for law, number in zip(table.law, table[f"objective_{when}"], strict=True)
            ]
            # Int64, not int: a law that does not settle has no rank, and stays missing.
            table[f"rank_{when}"] = pd.Series(objectives).rank(method="min").astype("Int64")
            table[f"better_than_{when}"] = [self._better_than(law, when) for law in table.law]
        ranges: dict[str, tuple[float, float]] = {}
        if self.plan.tune.searches > 1:
            ranked = table.law[table.rank_after.notna()].tolist()
            pairs = self.searches
            ranges |= places(pairs[pairs.a.isin(ranked) & pairs.b.isin(ranked)], ranked)
        table["place_low"], table["place_high"] = zip(
            *(ranges.get(law, (math.nan, math.nan)) for law in table.law), strict=True
        )
        return table

    def settles(self, law: str, when: str) -> bool:
        """Whether a law ends at its target in at least half of the fresh draws, before or after."""
        met = self.outcomes_of(law if when == "before" else self.after(law))
        # Whether a law aims at a target at all is the law's own.
        scenario = self.plan.scenario.model_copy(update={"controller": self.plan.laws[law]})
        ends = [
            not failed and scenario.at_target({name: met.metrics[name][i] for name in met.metrics})
            for i, failed in enumerate(met.failed)
        ]
        return 2 * sum(ends) >= len(ends)

    @cached_property
    def searches(self) -> pd.DataFrame:
        """The table of `compared`."""
        return self.pairs_of_laws.table()

    @cached_property
    def pairs_of_laws(self) -> LawRatios:
        """Every pair of laws by the first metric.

        All searches and the fresh draws count.
        """
        metric = self.shown_metrics[0]
        runs = {}
        for law in self.plan.laws:
            met = [self.outcomes_of(name) for name in self._searched_names(law)]
            runs[law] = np.array([worst_where_unknown(of_law, metric).ravel() for of_law in met])
        assert self.plan.scenario.sweep
        seed, sets = self.plan.scenario.sweep.seed, self.plan.tune.training_sets
        return compare_laws(runs, self.level, seed, sets=sets)

    def _searched_names(self, law: str) -> list[str]:
        """The names of a law with the gains of each of its searches; its own where it has none."""
        return searched_names(law, self.trials[law]) if law in self.trials else [law]

    def _better_than(self, law: str, when: str) -> int:
        """How many laws this one beats in the same draw, with the whole interval of the ratio.

        `when` is before or after.
        """
        pairs = self.pairs
        if not len(pairs):
            return 0
        pairs = pairs[(pairs["when"] == when) & (pairs.metric == self.shown_metrics[0])]
        ahead = (pairs.a == law) & (pairs.ratio_high < 1.0)
        return int((ahead | (pairs.b == law) & (pairs.ratio_low > 1.0)).sum())

    def _law(self, law: str) -> dict[str, Any]:
        """A law's row: failures and objective before and after, their ratio, spread of searches."""
        row: dict[str, Any] = {"law": law, "runs": self.runs_spent.get(law, 0)}
        for when, name in (("before", law), ("after", self.after(law))):
            runs = self.outcomes_of(name)
            failed = statistics.share(int(runs.failed.sum()), len(runs.failed), self.level)
            row |= failed.columns(f"failed_{when}")
            row |= self.objective(runs, self.plan.objective).columns(f"objective_{when}")
        pairs = self.pairs
        own = pairs[(pairs["when"] == "tuning") & (pairs.a == tuned_name(law))]
        own = own[own.metric == self.shown_metrics[0]]
        # A law that was not searched is its own before and after.
        for end in ("ratio", "ratio_low", "ratio_high"):
            row[end] = float(own[end].iloc[0]) if len(own) else 1.0
        spread = self.spread(law)
        ends = float(np.median(spread)), min(spread), max(spread)
        row |= zip(("repeats_median", "repeats_low", "repeats_high"), ends, strict=True)
        return row

    def objective(self, runs: Outcomes, tree: ast.expr) -> Interval:
        """The value of an objective or statistic, with an interval where it is one quantile.

        NaN ends for anything else, such as a sum.
        """
        number = evaluate(tree, runs, self.plan.metrics)
        if not isinstance(tree, ast.Call):
            return Interval(number, math.nan, math.nan)
        values = numbers_of(tree, OfGains(self.plan.metrics, runs=runs))
        ends = statistics.quantile(values, share_of(tree), self.level)
        return Interval(number, ends.low, ends.high)

    @cached_property
    def limits(self) -> pd.DataFrame:
        """Every inequality on the fresh draws, before and after, for every law."""
        return pd.DataFrame(
            [
                {
                    "law": law,
                    "when": when,
                    "inequality": inequality.text,
                    **self._limit(inequality, name),
                    "held_in_training": law in self.winners and self.winner(law).excesses[i] <= 0.0,
                }
                for law in self.plan.laws
                for when, name in (("before", law), ("after", self.after(law)))
                for i, inequality in enumerate(self.plan.inequalities)
            ],
            columns=[
                "law",
                "when",
                "inequality",
                "value",
                "value_low",
                "value_high",
                "holds",
                "held_in_training",
            ],
        )

    def _limit(self, inequality: Inequality, name: str) -> dict[str, Any]:
        """The value of an inequality's left side on fresh draws, and whether it holds."""
        runs = self.outcomes_of(name)
        holds = excess(inequality, runs, self.plan.metrics) <= 0.0
        return {**self.objective(runs, inequality.tree).columns("value"), "holds": holds}

    def spread(self, law: str) -> list[float]:
        """The objective on the fresh draws of every search's winner, or of a law that is kept."""
        return [
            evaluate(self.plan.objective, self.outcomes_of(name), self.plan.metrics)
            for name in self._searched_names(law)
        ]

    @cached_property
    def effort(self) -> pd.DataFrame:
        """Medians of the first metric and of the demand's variation, before and of each search.

        Empty where the runs have no total variation.
        """
        rows = [
            {
                "law": law,
                "before": name == law,
                "error": median(self.outcomes_of(name), self.shown_metrics[0]),
                "variation": median(self.outcomes_of(name), VARIATION),
            }
            for law in self.plan.laws
            if VARIATION in self.runs.metrics
            for name in dict.fromkeys((law, *self._searched_names(law)))
        ]
        return pd.DataFrame(rows, columns=["law", "before", "error", "variation"])

    @cached_property
    def pairs(self) -> pd.DataFrame:
        """Two laws in the same fresh draws: all before, all after, and each after and before."""
        known = {
            name: about for name, about in self.plan.metrics.items() if name in self.shown_metrics
        }
        compared = [
            ("before", {law: law for law in self.plan.laws}),
            ("after", {law: self.after(law) for law in self.plan.laws}),
            # The tuned law first, so that a ratio below 1 is an improvement.
            *(("tuning", {tuned_name(law): tuned_name(law), law: law}) for law in self.winners),
        ]
        tables = [
            pd.DataFrame(rows).assign(when=when)
            for when, names in compared
            for rows in [summary.pairs(self.runs, MARGIN, self.level, known, names)]
        ]
        return pd.concat([table for table in tables if len(table)] or tables, ignore_index=True)

    @cached_property
    def gains(self) -> pd.DataFrame:
        """Every gain: its range, the scenario's value, the found one, and those of all searches."""
        return pd.DataFrame(
            [
                {
                    "law": law,
                    "gain": gain.key,
                    **_ends(gain),
                    "before": gain.own,
                    "after": self.winner(law).gains[gain.key],
                    "at": gain.bound(self.winner(law).gains[gain.key]),
                    "repeats": " ".join(str(t.gains[gain.key]) for t in self.winners[law]),
                }
                for law in self.winners
                for gain in self.plan.gains[law]
            ],
            columns=["law", "gain", "low", "high", "before", "after", "at", "repeats"],
        )

    @cached_property
    def history(self) -> pd.DataFrame:
        """Every trial in its order, with the best so far."""
        return pd.DataFrame(
            [
                row
                for law, all_ in self.trials.items()
                for repeat, trials in enumerate(all_, 1)
                for row in _history(law, repeat, trials)
            ]
        )

    @cached_property
    def importance(self) -> pd.DataFrame:
        """How much each gain matters, with the least and the most of searches and of parts."""
        rows = [
            {"law": law, "gain": gain.key, **_range([part.get(gain.key, 0.0) for part in parts])}
            for law in self.trials
            for parts in [list(self._importances(law))]
            if parts
            for gain in self.plan.gains[law]
        ]
        return pd.DataFrame(rows, columns=["law", "gain", "importance", "low", "high"])

    def _importances(self, law: str) -> Iterator[dict[str, float]]:
        """The importances of gains, PARTS times for each search.

        Each time another part of the trials is left out. Searches with too few trials give none.
        """
        for trials in self.trials[law]:
            for part in range(PARTS):
                kept = [trial for place, trial in enumerate(trials) if place % PARTS != part]
                # As many as are left of FEWEST trials without one of their parts.
                if len(kept) >= FEWEST * (PARTS - 1) / PARTS:
                    importance = importances(
                        self.plan.gains[law], [t.gains for t in kept], [t.value for t in kept]
                    )
                    if importance:
                        yield importance

    @property
    def label(self) -> str:
        """The objective with its unit, where it is a statistic of one metric."""
        text = self.plan.tune.objective
        match self.plan.objective:
            case ast.Call(args=[ast.Name(id=name), *_]) if unit := self.plan.metrics[name].unit:
                return f"{text} [{unit}]"
        return text


def worst_where_unknown(runs: Outcomes, metric: str) -> Vector:
    """A metric of runs (draws,); infinite where a run failed, and where it has none."""
    numbers = np.where(runs.failed, np.inf, runs.metrics[metric])
    return np.asarray(np.where(np.isnan(numbers), np.inf, numbers))


def median(runs: Outcomes, metric: str) -> float:
    """Of a metric over runs."""
    return float(np.median(worst_where_unknown(runs, metric)))


def _ends(gain: Gain) -> dict[str, float]:
    """The ends of a range; words have none."""
    low, high = (math.nan, math.nan) if gain.words else (gain.low, gain.high)
    return {"low": low, "high": high}


def _range(values: Sequence[float]) -> dict[str, float]:
    """Mean, least and largest of the importances `values` of one gain."""
    return {"importance": float(np.mean(values)), "low": min(values), "high": max(values)}


def _history(law: str, repeat: int, trials: Sequence[GainTrial]) -> Iterator[dict[str, Any]]:
    """A row for each trial of a search: runs spent so far, and the best objective so far."""
    spent, leader = 0, (math.inf, math.inf)
    for trial in trials:
        spent += trial.runs
        if trial.status == FINISHED:
            # Inequalities come before the objective, as in `trials.best`.
            leader = min(leader, (trial.excess, trial.value))
        yield {
            "law": law,
            "repeat": repeat,
            "trial": trial.number,
            "batch": trial.batch,
            "status": trial.status,
            "runs": trial.runs,
            "spent": spent,
            "objective": trial.value,
            "failures": trial.failures,
            "excess": trial.excess,
            "best": leader[1],
            "gains": " ".join(f"{key}={number}" for key, number in trial.gains.items()),
        }
