"""Tables of a study: each law, each pair of laws, and what each metric depends on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import Any

import numpy as np

from podusv_cli.core.about import MetricAbout
from podusv_cli.core.kernel import Vector
from podusv_cli.studies.counting import statistics
from podusv_cli.studies.counting.runs import Mask, StudyRuns, worst

ENDS = ("_low", "_high")  # of an interval's columns
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
Known = Mapping[str, MetricAbout]
Rows = list[dict[str, Any]]  # of a table, each by the names of the columns


def summary(runs: StudyRuns, level: float, metrics: Known) -> Rows:
    """For every law, cell and metric: failures and quantiles over all draws, with intervals.

    `level` is the confidence of each interval, as 0.95.
    """
    return [
        {
            **_failures(runs, law, cell, level),
            "metric": name,
            "unit": metrics[name].unit,
            **_quantiles(values, level),
        }
        for law in runs.laws
        for cell in range(len(runs.cells))
        for name, values in _columns(runs, law, cell, metrics)
    ]


def pairs(
    runs: StudyRuns,
    margin: float,
    level: float,
    metrics: Known,
    names: Mapping[str, str] | None = None,
) -> Rows:
    """For every metric, cell and two laws a and b: who wins how often, and the median of a / b.

    Of the draws that both laws met. A win is a smaller metric by more than the `margin`, which is
    relative (0.01 is 1 %); a larger one where more is better. `level` is the confidence of
    intervals. `names` are those of the runs' laws that are compared, by their names in the table;
    by default all.
    """
    laws = names or {law: law for law in runs.laws}
    return [
        {
            "metric": name,
            "cell": runs.cells[cell],
            "a": a,
            "b": b,
            "margin": margin,
            **_pair(sign * of_a[used], sign * of_b[used], margin, level),
        }
        for name in _names(runs, metrics)
        # More is better: the negated metric is compared.
        for sign in [-1.0 if metrics[name].margin else 1.0]
        for cell in range(len(runs.cells))
        for read in [{a: column_of(runs, law, cell, metrics[name]) for a, law in laws.items()}]
        for a, b in combinations(laws, 2)
        for of_a, of_b in [(read[a], read[b])]
        if of_a is not None and of_b is not None
        for used in [runs.done(laws[a])[cell] & runs.done(laws[b])[cell]]
    ]


def sensitivity(runs: StudyRuns, draws: Mapping[str, Any], level: float, metrics: Known) -> Rows:
    """Spearman's rank correlation of every metric with every drawn number, by law and cell.

    `draws` are the drawn quantities (draws,) by name; words have no ranks and are left out. Column
    `n` counts draws with the metric; `by_chance` is what unrelated quantities stay within at
    `level`.
    """
    drawn = {name: np.asarray(values) for name, values in draws.items()}
    numbers = {name: values for name, values in drawn.items() if values.dtype.kind in "fiub"}
    return [
        {
            "law": law,
            "cell": runs.cells[cell],
            "quantity": quantity,
            "metric": name,
            "n": known,
            "correlation": correlation,
            "by_chance": statistics.by_chance(known, level),
        }
        for law in runs.laws
        for cell in range(len(runs.cells))
        for done in [runs.done(law)[cell]]
        for ranked in [{q: statistics.centre_ranks(values[done]) for q, values in numbers.items()}]
        for name, values in _columns(runs, law, cell, metrics)
        for known in [int(np.sum(~np.isnan(values)))]
        for quantity, correlation in statistics.rank_correlations(ranked, values).items()
    ]


def without_intervals(rows: Rows) -> Rows:
    """The table with NaN in all columns that need independent draws.

    These are ends of intervals, and what correlations reach by chance.
    """
    return [
        {
            name: np.nan if name.endswith(ENDS) or name == "by_chance" else cell
            for name, cell in row.items()
        }
        for row in rows
    ]


def _names(runs: StudyRuns, metrics: Known) -> list[str]:
    """The metrics of these runs in the order of tables, without measured times."""
    return [name for name in metrics if name in runs.metrics and not metrics[name].clocked]


def column_of(runs: StudyRuns, law: str, cell: int, about: MetricAbout) -> Vector | None:
    """A metric (draws,) of a cell, the `worst` for a run that failed; None where the law has none.

    It has the metric where a run that succeeded has it, or where there is no such run.
    """
    done, success = runs.done(law)[cell], runs.success(law)[cell]
    values = worst(about, runs.metric(law, about.name)[cell], ~success)
    known = values[done & success]
    return values if done.any() and not (len(known) and np.isnan(known).all()) else None


def _columns(runs: StudyRuns, law: str, cell: int, metrics: Known) -> Iterator[tuple[str, Vector]]:
    """Every metric that the law has, over the draws of a cell that it met."""
    for name in _names(runs, metrics):
        if (values := column_of(runs, law, cell, metrics[name])) is not None:
            yield name, values[runs.done(law)[cell]]


def _failures(runs: StudyRuns, law: str, cell: int, level: float) -> dict[str, Any]:
    """Failed draws of a law in a cell: counts, and their share with its interval.

    `level` is the confidence of the interval. Broken runs, which crashed or hung, count as failed.
    """
    done: Mask = runs.done(law)[cell]
    failed, n = int(np.sum(done & ~runs.success(law)[cell])), int(np.sum(done))
    return {
        "law": law,
        "cell": runs.cells[cell],
        "n": n,
        "broken": int(np.sum(done & runs.broken(law)[cell])),
        **statistics.share(failed, n, level).columns("failed"),
    }


def _quantiles(values: Vector, level: float) -> dict[str, Any]:
    """Quantiles of a metric over draws (n,) with intervals; `level` is their confidence."""
    columns: dict[str, Any] = {"unknown": int(np.isnan(values).sum())}
    intervals = statistics.quantiles(values, QUANTILES, level)
    for q, interval in zip(QUANTILES, intervals, strict=True):
        columns |= interval.columns(f"q{round(100 * q):02d}")
    return columns


def _pair(a: Vector, b: Vector, margin: float, level: float) -> dict[str, Any]:
    """Two laws in the same draws (n,): wins, ties and ratio.

    Values within `margin` of each other, relative to the larger, are a tie; `level` is the
    confidence.
    """
    compared = statistics.pairs(a, b, margin)
    ratio = statistics.quantile(statistics.ratios(a, b), statistics.MEDIAN, level)
    return {
        "n": compared.n,
        "ties": compared.ties,
        "both_failed": compared.both_failed,
        "unknown": compared.unknown,
        **compared.win_rate(level).columns("a_wins"),
        **compared.loss_rate(level).columns("b_wins"),
        **ratio.columns("ratio"),
    }
