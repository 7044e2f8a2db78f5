"""Fill the table of results/identify.md in from results/identify/coverage.csv; prints the page.

python -m benchmarks.coverage results/identify/coverage.csv    # an hour and more
python examples/reproduce/identify_coverage.py > results/.table
mv results/.table results/identify.md
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

RESULTS = Path(__file__).parents[2] / "results"
PAGE, MADE = RESULTS / "identify.md", RESULTS / "identify" / "coverage.csv"
HEADS = ("", "", "sets", "no hull, not settled, refused", "determined", "held", "rms z")
FACTORS = {  # what a set may have, by the column of MADE
    "rows": "rows [1/s]",
    "logged": "logged",
    "gnss": "GNSS [m]",
    "sea": "sea",
    "hull": "hull",
    "settled": "settled",
    "refused": "refused",
}
ANSWERS = {True: "yes", False: "no"}
LARGE = 12  # sets of a cell that counts by itself
TABLE = r"(?ms)^\| \| \| sets .*?\n\n.*?(?=\n\n)"  # and the paragraph behind it


def count_held(cell: pd.DataFrame) -> dict[str, Any]:
    """Of a cell: its sets, and how much the intervals of what counts as determined hold.

    All sets count, also those whose search did not settle, of which podusv calls nothing
    determined, and those whose hull it refuses.
    """
    there = cell[cell.what != "none"]
    known = there[there.determined.astype(bool)]
    sets = cell.number.nunique()
    return {
        "sets": sets,
        "none": sets - there.number.nunique(),
        "unsettled": there[~there.settled.astype(bool)].number.nunique(),
        "refused": there[there.refused.astype(bool)].number.nunique(),
        "determined": len(known),
        "held": 100.0 * known.holds.astype(float).mean(),
        "rms": float(np.sqrt(np.mean(known.off.astype(float) ** 2))),
    }


def rows(made: pd.DataFrame) -> Iterator[list[str]]:
    """The cells of a line for all sets, then for each value of each factor."""
    yield ["all", "", *_cells(count_held(made))]
    for factor, title in FACTORS.items():
        for value, cell in made.groupby(factor):
            shown = ANSWERS[bool(value)] if factor in ("settled", "refused") else str(value)
            yield [title, shown, *_cells(count_held(cell))]


def _cells(counts: dict[str, Any]) -> list[str]:
    without = f"{counts['none']}, {counts['unsettled']}, {counts['refused']}"
    shares = (
        [f"{counts['held']:.0f} %", f"{counts['rms']:.2f}"] if counts["determined"] else ["", ""]
    )
    return [str(counts["sets"]), without, str(counts["determined"]), *shares]


def pairs(made: pd.DataFrame) -> pd.DataFrame:
    """The counts of each pair of values of two factors that has so many sets as count."""
    factors = list(FACTORS)[:5]
    found = [
        {"cell": f"{a} and {b}", **count_held(cell)}
        for one, other in combinations(factors, 2)
        for (a, b), cell in made.groupby([one, other])
    ]
    return pd.DataFrame([pair for pair in found if pair["sets"] >= LARGE])


def paragraph(made: pd.DataFrame) -> str:
    """The pooled numbers, those without gusts, where gusts were found, and the lowest cells."""
    pooled, calmer = count_held(made), count_held(made[made.sea != "gusts"])
    gusty, found = made[made.sea == "gusts"], made[made.gusts.eq(True)]
    return (
        f"Of the {pooled['determined']} numbers and forces that count as determined "
        f"{pooled['held']:.1f} % lie in their intervals, with an rms of {pooled['rms']:.2f}; "
        f"in the {calmer['sets']} sets without gusts {calmer['held']:.1f} %, {calmer['rms']:.2f}. "
        f"Loads were taken for gusts in {found[found.sea == 'gusts'].number.nunique()} of the "
        f"{gusty.number.nunique()} sets with gusts, and in "
        f"{found[found.sea != 'gusts'].number.nunique()} others."
        f"{_lowest_pairs(pairs(made))}"
    )


def _lowest_pairs(cells: pd.DataFrame) -> str:
    """A sentence on the pairs that hold least; none before any of them has enough sets."""
    if cells.empty:
        return ""
    lowest = cells.sort_values("held").head(3)
    told = ", ".join(f"{row.cell} {row.held:.0f} %" for row in lowest.itertuples())
    return f" {len(cells)} pairs of values have {LARGE} sets or more; the lowest are {told}."


def filled(page: str) -> str:
    """The page with its table and the paragraph behind it anew."""
    made = pd.read_csv(MADE)
    head, *lines = (
        f"| {' | '.join(line)} |\n".replace("|  ", "| ") for line in (HEADS, *rows(made))
    )
    table = "".join([head, "|---" * len(HEADS), "|\n", *lines])
    text, found = re.subn(TABLE, lambda match: f"{table}\n{paragraph(made)}", page)
    if found != 1:
        raise SystemExit(f"{PAGE} has {found} tables that begin with '| | | sets', not one")
    return text


if __name__ == "__main__":
    print(filled(PAGE.read_text()), end="")
