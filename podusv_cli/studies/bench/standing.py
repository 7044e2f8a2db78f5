"""Who did how well: ratios to the best law of each case, ranks, failures, and the leaderboard."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pandas as pd

from podusv_cli.core.kernel import Vector
from podusv_cli.studies.bench.optima import Least
from podusv_cli.studies.bench.runs import BenchRun

PLACE = ["vessel", "task", "condition"]
COLUMNS = (
    "iae", "iae_e", "z_e_steady", "e_steady", "settling_time", "peak_tau_u", "peak_tau_r",
    "tv_tau_u", "tv_tau_r",
)  # fmt: skip
# What counts in their place where a path is followed
FOLLOWED = {
    "iae": "e_ct_integral", "iae_e": "e_ct_integral", "z_e_steady": "e_ct_steady",
    "e_steady": "e_ct_steady", "settling_time": "path_time",
}  # fmt: skip
RATIOS = {"ratio": "iae", "ratio_e": "iae_e", "variation": "tv_tau_u"}
CLOSE = 1.1  # times the best law's IAE counts as close


def table(runs: Iterable[BenchRun]) -> pd.DataFrame:
    """A row for each law in each case, with ratios (inf where it failed) and `rank`.

    `ratio` is its IAE over the least of the laws that are at their target, `ratio_e` the same of
    the error beyond the standoff, `variation` that of the total variation of the surge demand.
    Ranks, by IAE, count from 1; laws that failed share the mean of the last ranks.
    """
    rows = [
        {**dict(zip(PLACE, run.place, strict=True)), "law": run.law, "status": run.status,
         "cause": run.cause, **{name: _number(run.metrics, name) for name in COLUMNS}}
        for run in runs
    ]  # fmt: skip
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
    """A metric, or what stands for it on a path that is followed; NaN where there is neither."""
    return metrics.get(name, metrics.get(FOLLOWED.get(name, ""), np.nan))


def with_optima(made: pd.DataFrame, optima: Sequence[Least]) -> pd.DataFrame:
    """The table with `optimum` [m s], NaN where there is none, and `of_optimum`, IAE over it.

    `of_optimum` is inf for a failed run.
    """
    iae = {place: optimum.iae for optimum in optima for place in optimum.places}
    least = [iae.get(place, np.nan) for place in made[PLACE].itertuples(index=False, name=None)]
    counted = made.iae.where(made.status == "finished", np.inf)
    return made.assign(optimum=least, of_optimum=counted / least)


def leaderboard(made: pd.DataFrame) -> pd.DataFrame:
    """A row for each law, the best first: by mean rank over all cases.

    `close` is the share of cases in which the law's IAE is within 10 % of the best. `median_ratio`
    and `settled`, the distance over the steady window [m], are medians, with a run that failed or
    ended early as inf; so are `median_ratio_e` and `variation` (see `table`), and `of_optimum`, if
    the table has it, over cases with an optimum. `on` and a vessel's name: its mean rank there.
    """
    laws = made.groupby("law", sort=False)
    board = pd.DataFrame(
        {
            "cases": laws.size(),
            "failed": laws.status.agg(lambda status: int((status != "finished").sum())),
            "mean_rank": laws["rank"].mean(),
            "median_ratio": laws.ratio.agg(middle),
            "median_ratio_e": laws.ratio_e.agg(middle),
            "variation": laws.variation.agg(middle),
            "close": laws.ratio.agg(lambda ratio: float((ratio <= CLOSE).mean())),
            "settled": laws.z_e_steady.agg(lambda z_e: middle(z_e.fillna(np.inf))),
        }
    )
    for vessel, rows in made.groupby("vessel", sort=False):
        board[f"on {vessel}"] = rows.groupby("law", sort=False)["rank"].mean()
    if "of_optimum" in made:
        board["of_optimum"] = laws.of_optimum.agg(lambda ratio: middle(ratio.dropna()))
    return board.sort_values("mean_rank", kind="stable")


def middle(numbers: Iterable[float]) -> float:
    """The median, where inf counts as the largest number."""
    ordered = np.sort(np.fromiter(numbers, float))
    half = len(ordered) // 2
    return float(ordered[half] if len(ordered) % 2 else ordered[half - 1 : half + 1].mean())


def profile(made: pd.DataFrame, law: str, ratios: Vector) -> Vector:
    """Share of all cases in which the law's IAE is at most so many times the best one.

    The performance profile of Dolan and More (2002); what it lacks to 1 at the right are failures.
    """
    own = np.sort(made.ratio[made.law == law].to_numpy())
    return np.searchsorted(own, ratios, side="right") / len(own)
