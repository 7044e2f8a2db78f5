"""The leaderboard as a page, and as a table in Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import pandas as pd

from podusv_cli.bench.standing import PLACE, leaderboard
from podusv_cli.core.escaping import markdown
from podusv_cli.pages.page import Picture, environment, flat, value_text

FIRST = 60  # failures that the page lists
DARKEST = 10.0  # times the best law's IAE
PALE, DARK = (236, 244, 250), (8, 64, 112)  # red, green, blue
CROSS = "✗"


class Cell(NamedTuple):
    """A law in a case: what is written, on which colour, and why it failed."""

    text: str
    colour: str
    ink: str
    why: str


def page(
    made: pd.DataFrame, figures: Sequence[Picture], provenance: Mapping[str, Any]
) -> str:  # fmt: skip
    """The page; `made` is `standing.table` of all runs."""
    board = leaderboard(made)
    failed = made[made.status != "finished"]
    counts = {f"{name}s": made[name].nunique() for name in PLACE}
    return environment("podusv_cli.bench").get_template("bench.html.j2").render(
        title=f"Bench of {len(board)} laws",
        board=list(board.iterrows()),
        counts=counts | {"cases": len(made) // len(board), "runs": len(made)},
        heat=list(_heat(made, list(board.index))),
        failures=failed[[*PLACE, "law", "status", "cause"]].to_numpy().tolist()[:FIRST],
        more=max(0, len(failed) - FIRST),
        figures=figures,
        provenance=[(key, value_text(value)) for key, value in flat(provenance)],
        number=number,
    )  # fmt: skip


def as_markdown(made: pd.DataFrame) -> str:
    """The leaderboard as a table."""
    head = (
        "| law | mean rank | failed | median of IAE / best | within 10 % of the best |\n"
        "|---|---|---|---|---|\n"
    )
    rows = (
        f"| {markdown(str(law))} | {row.mean_rank:.2f} | {row.failed:.0f} of {row.cases:.0f} | "
        f"{number(row.median_ratio)} | {100 * row.close:.0f} % |\n"
        for law, row in leaderboard(made).iterrows()
    )
    return head + "".join(rows)


def number(ratio: float) -> str:
    """A ratio in three digits; a cross for a failure."""
    return f"{ratio:.3g}" if math.isfinite(ratio) else CROSS


def _heat(made: pd.DataFrame, laws: Sequence[str]) -> Iterator[tuple[str, list[Any]]]:
    """For every vessel the rows of its table: task, condition, a cell for each law, best IAE."""
    for vessel, cases in made.groupby("vessel", sort=False):
        rows = [
            (task, condition, _cells(case, laws), _best(case))
            for (task, condition), case in cases.groupby(["task", "condition"], sort=False)
        ]
        yield str(vessel), rows


def _cells(case: pd.DataFrame, laws: Sequence[str]) -> list[Cell]:
    by_law = case.set_index("law")
    return [_cell(by_law.ratio[law], f"{by_law.status[law]}: {by_law.cause[law]}") for law in laws]


def _cell(ratio: float, why: str) -> Cell:
    if not math.isfinite(ratio):
        return Cell(CROSS, "#f6d5c3", "#7a2b00", why)
    depth = min(math.log(ratio) / math.log(DARKEST), 1.0)
    mixed = (round(p + depth * (d - p)) for p, d in zip(PALE, DARK, strict=True))
    return Cell(number(ratio), f"rgb{tuple(mixed)}", "#fff" if depth > 0.45 else "#1b1f24", "")


def _best(case: pd.DataFrame) -> str:
    good = case.iae[case.status == "finished"]
    return f"{good.min():.4g}" if len(good) else CROSS
