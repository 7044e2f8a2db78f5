"""Who did how well: ratios to the best law of each case, ranks, failures, and the leaderboards.

Every hull has a leaderboard of its own: a median over several would be a property of none of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from podusv_cli.core.kernel import Vector
from podusv_cli.studies.bench.optima import Least
from podusv_cli.studies.bench.runs import BenchRun

PLACE = ["vessel", "task", "condition"]
COLUMNS = (
    "iae",
    "iae_e",
    "z_e_steady",
    "e_steady",
    "settling_time",
    "peak_tau_u",
    "peak_tau_r",
    "tv_tau_u",
    "tv_tau_r",
)
# What counts in their place where a path is followed
FOLLOWED = {
    "iae": "e_ct_integral",
    "iae_e": "e_ct_integral",
    "z_e_steady": "e_ct_steady",
    "e_steady": "e_ct_steady",
    "settling_time": "path_time",
}
RATIOS = {"ratio": "iae", "ratio_e": "iae_e", "variation": "tv_tau_u"}
CROSS = "✗"
FEWEST_TASKS = 3  # that an interval over tasks is computed from
CLOSE = 1.1  # times the best law's IAE counts as close


def table(runs: Iterable[BenchRun]) -> pd.DataFrame:
    """A row for each law in each case, with ratios (inf where it failed) and `rank`.

    `ratio` is its IAE over the least of the laws that are at their target, `ratio_e` the same of
    the error beyond the standoff, `variation` that of the total variation of the surge demand.
    Ranks, by IAE, count from 1; laws that failed share the mean of the last ranks.
    """
    rows = [
        {
            **dict(zip(PLACE, run.place, strict=True)),
            "law": run.law,
            "status": run.status,
            "cause": run.cause,
            **{name: _number(run.metrics, name) for name in COLUMNS},
        }
        for run in runs
    ]
    made = pd.DataFrame(rows)
    place = [made[name] for name in PLACE]
    for name, column in RATIOS.items():
        counted = made[column].where(made.status == "finished", np.inf)
        best = counted.groupby(place, sort=False).transform("min")
        made[name] = np.where(np.isfinite(counted), counted / best, np.inf)
    counted = made.iae.where(made.status == "finished", np.inf)
    made["rank"] = counted.groupby(place, sort=False).rank(method="average")
    return made


def _number(metrics: Mapping[str, float], name: str) -> float:
    """A metric of a run, or what FOLLOWED has in its place for a followed path.

    NaN without either.
    """
    return metrics.get(name, metrics.get(FOLLOWED.get(name, ""), np.nan))


def with_optima(made: pd.DataFrame, optima: Sequence[Least]) -> pd.DataFrame:
    """The table `made` with `optimum` [m s] and `of_optimum`, the IAE over it.

    `optimum` is NaN where none was found. `of_optimum` is inf for a failed run.
    """
    iae = {place: optimum.iae for optimum in optima for place in optimum.places}
    least = [iae.get(place, np.nan) for place in made[PLACE].itertuples(index=False, name=None)]
    counted = made.iae.where(made.status == "finished", np.inf)
    return made.assign(optimum=least, of_optimum=counted / least)


class Column(NamedTuple):
    """A column of the leaderboard: a number of all rows of a law, and how a table writes it.

    A column without a heading is in `--json` alone. `text` takes the law's row of the leaderboard.
    `meaning` says below the table what the heading does not.
    """

    name: str
    of: Callable[[pd.DataFrame], float]
    heading: str = ""
    text: Callable[[pd.Series], str] = str
    meaning: str = ""


def digits(ratio: float) -> str:
    """A ratio in three digits; a cross for a failure."""
    return f"{ratio:.3g}" if math.isfinite(ratio) else CROSS


def over_tasks(rows: pd.DataFrame) -> tuple[float, float]:
    """The 95 % interval of a law's mean rank if other tasks like these were taken.

    Student's, of the means by task; NaN with fewer than three tasks.
    """
    # One number a task: cases of a task are not independent, as they share path and speed.
    means = rows.groupby("task")["rank"].mean()
    if len(means) < FEWEST_TASKS:
        return math.nan, math.nan
    from scipy.stats import t  # slow to import

    half = float(t.ppf(0.975, len(means) - 1) * means.std() / math.sqrt(len(means)))
    return float(means.mean()) - half, float(means.mean()) + half


def _interval(number: float, low: float, high: float) -> str:
    return f"{number:.2f}" + (f" [{low:.2f}, {high:.2f}]" if math.isfinite(high - low) else "")


BOARD = (
    Column("cases", len),
    Column("rank_low", lambda rows: over_tasks(rows)[0]),
    Column("rank_high", lambda rows: over_tasks(rows)[1]),
    Column(
        "mean_rank",
        lambda rows: rows["rank"].mean(),
        "mean rank",
        lambda law: _interval(law.mean_rank, law.rank_low, law.rank_high),
        "By IAE, the integral of the distance from the vessel's origin to the target; 95 % "
        "intervals over tasks, the hull and the conditions being given. Failed runs share the mean "
        "of the last ranks of their case. A rank depends on which laws take part.",
    ),
    Column(
        "failed",
        lambda rows: int((rows.status != "finished").sum()),
        "failed",
        lambda law: f"{law.failed:.0f} of {law.cases:.0f}",
        "A run has failed where it does not reach its end, or ends further off its standoff than "
        "metrics.settling_radius, on average over the last part of the run. In podusv's own bench "
        "these are half of the hull's length, and a fifth.",
    ),
    Column(
        "median_ratio",
        lambda rows: middle(rows.ratio),
        "median of IAE / best",
        lambda law: digits(law.median_ratio),
        "A law that keeps a standoff on purpose pays for it here. A cross: it failed in half of "
        "the cases or more.",
    ),
    Column(
        "median_ratio_e",
        lambda rows: middle(rows.ratio_e),
        "beyond the standoff",
        lambda law: digits(law.median_ratio_e),
        "The median of the same ratio of the error |z_e - standoff|.",
    ),
    Column(
        "variation",
        lambda rows: middle(rows.variation),
        "variation",
        lambda law: digits(law.variation),
        "The median of the total variation of the surge demand over the least of the laws at their "
        "target.",
    ),
    Column(
        "close",
        lambda rows: float((rows.ratio <= CLOSE).mean()),
        "within 10 % of the best",
        lambda law: f"{100 * law.close:.0f} %",
        "The share of cases in which the IAE is.",
    ),
    Column(
        "settled",
        lambda rows: middle(rows.z_e_steady.fillna(np.inf)),
        "settled [m]",
        lambda law: digits(law.settled),
        "The median of the mean distance over the last part of the run.",
    ),
)
OF_OPTIMUM = Column(
    "of_optimum",
    lambda rows: middle(rows.of_optimum.dropna()),
    "median of IAE / optimum",
    lambda law: digits(law.of_optimum),
    "Over the cases that have an optimum.",
)


def columns(made: pd.DataFrame) -> list[Column]:
    """Of the leaderboards of a table; with one of optima where it has any."""
    return [*BOARD, *([OF_OPTIMUM] if "of_optimum" in made else [])]


def by_vessel(made: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The rows of each hull."""
    return {str(vessel): rows for vessel, rows in made.groupby("vessel", sort=False)}


def leaderboards(made: pd.DataFrame) -> pd.DataFrame:
    """The leaderboard of each hull, one below the other, with the hull and the law as index."""
    boards = {vessel: leaderboard(rows) for vessel, rows in by_vessel(made).items()}
    return pd.concat(boards, names=["vessel"])


def leaderboard(made: pd.DataFrame) -> pd.DataFrame:
    """The leaderboard of one vessel: a row for each law, least mean rank first; see `columns`.

    `made` has the rows of that vessel alone.
    """
    shown = columns(made)
    rows = {
        law: {column.name: column.of(of_law) for column in shown}
        for law, of_law in made.groupby("law", sort=False)
    }
    board = pd.DataFrame.from_dict(rows, orient="index").rename_axis("law")
    return board.sort_values("mean_rank", kind="stable")


def leaderboard_rows(made: pd.DataFrame) -> list[list[str]]:
    """The leaderboard of one vessel as text: its headings, then a row a law.

    `made` has its rows.
    """
    board, shown = leaderboard(made), [column for column in columns(made) if column.heading]
    rows = [[str(law), *(column.text(row) for column in shown)] for law, row in board.iterrows()]
    return [["law", *(column.heading for column in shown)], *rows]


def middle(numbers: Iterable[float]) -> float:
    """The median, where inf counts as the largest number."""
    ordered = np.sort(np.fromiter(numbers, float))
    half = len(ordered) // 2
    return float(ordered[half] if len(ordered) % 2 else ordered[half - 1 : half + 1].mean())


def profile(made: pd.DataFrame, law: str, ratios: Vector) -> Vector:
    """Share of cases in which the law's IAE is at most `ratios` (n,) times the best one: (n,).

    `made` has the rows of one vessel. The performance profile of Dolan and More (2002): where it
    stays below 1, the law failed in the rest of the cases.
    """
    own = np.sort(made.ratio[made.law == law].to_numpy())
    return np.searchsorted(own, ratios, side="right") / len(own)
