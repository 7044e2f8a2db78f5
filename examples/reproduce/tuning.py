"""Fill the table and numbers of docs/tuning.md in from results/tuning/; prints the page.

python examples/reproduce/tuning.py > results/.table && mv results/.table docs/tuning.md
"""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from fill_page import ratio, with_numbers, with_rows

from podusv_cli.studies.tuning.searches import compare_laws

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "results"
PAGE = ROOT / "docs" / "tuning.md"
FOUND = "## What the committed searches found\n"  # where the numbers begin
LEVEL = 0.95  # of intervals that hold together
SEEDS = 21  # of resampling; a pair near the limit is apart with some of them
PAPERS = ["adaptive_crab", "full_backstepping", "dsc", "adaptive_neural", "los_pid", "pid"]


def table(folder: str, name: str = "laws") -> pd.DataFrame:
    """A committed table."""
    return pd.read_csv(RESULTS / "tuning" / folder / f"{name}.csv")


def whole(number: float) -> str:
    """No digits; what is not finite fails."""
    return f"{number:.0f}" if math.isfinite(number) else "fails"


def place(row: dict[str, Any]) -> str:
    """The ranks that are left open."""
    ends = sorted({row["place_low"], row["place_high"]})
    return " to ".join(f"{end:.0f}" for end in ends)


def error(row: dict[str, Any], before: str, after: str, usual: str) -> list[str]:
    """The cells of the error before and after."""
    first = [whole(row[before + end]) for end in ("", "_low", "_high")]
    then = [whole(row[after + end]) for end in (usual, "_low", "_high")]
    return ["{} [{}, {}]".format(*first), "{} ({} to {})".format(*then)]


def rows() -> Iterator[list[str]]:
    """A law's error before and after the search, and what the gains make of other hulls."""
    others = [table(f"judged/{hull}").set_index("law") for hull in ("fresh", "cybership2", "otter")]
    for row in table("hull").sort_values("repeats_median").to_dict("records"):
        first = error(row, "objective_before", "repeats", "_median")
        yield [row["law"], place(row), *first, *(_ratio(one.loc[row["law"]]) for one in others)]


def _ratio(row: Any) -> str:
    if not math.isfinite(row.ratio_high):
        return f"{row.ratio:.2f}, open"
    told = f"{row.ratio:.2f} [{row.ratio_low:.2f}, {row.ratio_high:.2f}]"
    return f"**{told}**" if row.ratio_high < 1.0 or row.ratio_low > 1.0 else told


def sentences() -> Iterator[tuple[Any, ...]]:
    """Sentences with places for numbers, and the numbers."""
    page = " ".join(PAGE.read_text().split())
    for case in ("hull", "network"):
        for row in table(case, "searches").itertuples():
            pair = f"`{row.a}` / `{row.b}`: "
            if pair in page:  # not all are named
                yield f"{pair}{{}} [{{}}, {{}}]", *ratio(row)
    yield (
        "Given these 500 draws {} of 91 pairs are apart, {} of them without `pid`",
        *_apart_given_draws("hull"),
    )
    hulls = ("fresh", "cybership2", "otter")
    fresh, other, otter = (table(f"judged/{hull}").set_index("law") for hull in hulls)
    better = 100 * (1 - other.ratio[other.ratio_high < 1.0])
    least, most = whole(better.min()), whole(better.max())
    yield "better with found gains, by {} to {} % in the median", least, most
    off, rest = 100 * (1 - fresh.ratio[PAPERS]), 100 * (1 - fresh.ratio.drop(PAPERS))
    yield (
        "Found gains take {} to {} % off the paper's laws, PID and `los_pid` on other draws of "
        "these hulls, and at most {} % off the others",
        *map(whole, (off.min(), off.max(), rest.max())),
    )
    before = 100 * other.failed_before[["adrc", "hand_position", "pid"]]
    yield "too, in {} to {} %", *map(whole, (before.min(), before.max()))
    yield "{} of the 280 sets hold all of them there", other.held_after.sum()
    yield (
        "{} of 280 sets do, on the Otter, with limits in proportion to its forces, {}.",
        fresh.held_after.sum(),
        otter.held_after.sum(),
    )
    places = ["law", "training_set", "search"]
    spread = table("hull", "spread").set_index(places)["median"].unstack()
    within = np.log(spread).var(axis=1).groupby("law").mean()
    between = np.log(spread).mean(axis=1).groupby("law").var() - within / spread.shape[1]
    sets, seeds = (100 * np.sqrt(part.clip(lower=0.0)) for part in (between, within))
    named = sets[["adrc", "hand_position", "sliding_mode", "super_twisting", "pid"]]
    yield (
        "by {} to {} % (standard deviation of the logarithm between sets, `spread.csv`), the other "
        "laws by at most {} %; the tuner's seed moves laws by {} to {} % on one set",
        *map(whole, (named.min(), named.max(), sets.drop(named.index).max())),
        *map(whole, (seeds.min(), seeds.max())),
    )


def _those_apart(pairs: pd.DataFrame) -> pd.DataFrame:
    return pairs[(pairs.ratio_high < 1.0) | (pairs.ratio_low > 1.0)]


def _apart_given_draws(case: str) -> tuple[int, int]:
    """Pairs apart where sets and searches are drawn again, the judging draws are not; without pid.

    A search has one number there, its median over these draws. Both are medians over seeds.
    """
    spread = table(case, "spread").sort_values(["search", "training_set"])
    medians = {law: rows["median"].to_numpy()[:, None] for law, rows in spread.groupby("law")}
    sets = spread.training_set.nunique()
    tables = [compare_laws(medians, LEVEL, seed, sets=sets).table() for seed in range(SEEDS)]
    apart = [_those_apart(table)[["a", "b"]] for table in tables]
    without = [pairs[~pairs.eq("pid").any(axis=1)] for pairs in apart]
    return int(np.median([*map(len, apart)])), int(np.median([*map(len, without)]))


def filled(page: str) -> str:
    """The page with its table and numbers anew; where lines break stays."""
    before, title, text = page.partition(FOUND)
    return before + title + with_numbers(with_rows(text, "| law | place |", rows()), sentences())


if __name__ == "__main__":
    print(filled(PAGE.read_text()), end="")
