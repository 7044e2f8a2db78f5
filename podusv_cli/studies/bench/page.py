"""The leaderboard as a page, and as a table in Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import pandas as pd

from podusv_cli.core.escaping import markdown
from podusv_cli.core.phrases import value_text
from podusv_cli.pages.page import Picture, environment, flat
from podusv_cli.studies.bench.optima import Least
from podusv_cli.studies.bench.standing import PLACE, leaderboard

FIRST = 60  # failures that the page lists
DARKEST = 10.0  # times the best law's IAE
PALE, DARK = (236, 244, 250), (8, 64, 112)  # red, green, blue
CROSS = "✗"
HEADINGS = (
    "law", "mean rank", "failed", "median of IAE / best", "beyond the standoff", "variation",
    "within 10 % of the best",
)  # fmt: skip


class Cell(NamedTuple):
    """A law in a case: what is written, on which colour, and why it failed."""

    text: str
    colour: str
    ink: str
    why: str


def page(
    made: pd.DataFrame, figures: Sequence[Picture], provenance: Mapping[str, Any],
    optima: Sequence[Least] = (),
) -> str:  # fmt: skip
    """The page; `made` is `standing.table` of all runs, `with_optima` where there are any."""
    board = leaderboard(made)
    failed = made[made.status != "finished"]
    counts = {f"{name}s": made[name].nunique() for name in PLACE}
    return environment("podusv_cli.studies.bench").get_template("bench.html.j2").render(
        title=f"Bench of {len(board)} laws",
        board=[(str(law), cells_of(row), number(row.settled)) for law, row in board.iterrows()],
        headings=headings(board),
        counts=counts | {"cases": len(made) // len(board), "runs": len(made)},
        heat=list(_heat(made, list(board.index))),
        failures=failed[[*PLACE, "law", "status", "cause"]].to_numpy().tolist()[:FIRST],
        more=max(0, len(failed) - FIRST),
        figures=figures,
        provenance=[(key, value_text(value)) for key, value in flat(provenance)],
        optima=_grids(optima) if optima else None,
    )  # fmt: skip


def as_markdown(made: pd.DataFrame) -> str:
    """The leaderboard as a table."""
    board = leaderboard(made)
    head = headings(board)
    rows = ([markdown(str(law)), *cells_of(row)] for law, row in board.iterrows())
    lines = [" | ".join(row) for row in (head, *rows)]
    return f"| {lines[0]} |\n|{'---|' * len(head)}\n" + "".join(f"| {row} |\n" for row in lines[1:])


def _grids(optima: Sequence[Least]) -> dict[str, Any]:
    """What the page says of the optima: the finest grid's step, its effect, and their cases."""
    return {
        "step": f"{max(optimum.step for optimum in optima):.2g}",
        "lowered": f"{max(abs(optimum.lowered) for optimum in optima):.1g}",
        "count": sum(len(optimum.places) for optimum in optima),
    }


def headings(board: pd.DataFrame) -> list[str]:
    """Of the leaderboard: a rank for each vessel, and the last where optima were found."""
    vessels = [f"rank {name}" for name in board if str(name).startswith("on ")]
    return [*HEADINGS, *vessels, *(["median of IAE / optimum"] if "of_optimum" in board else [])]


def cells_of(row: Any) -> list[str]:
    """A law's row of the leaderboard below these headings, but for the law's name."""
    texts = [
        f"{row.mean_rank:.2f}", f"{row.failed:.0f} of {row.cases:.0f}", number(row.median_ratio),
        number(row.median_ratio_e), number(row.variation), f"{100 * row.close:.0f} %",
        *(f"{row[name]:.2f}" for name in row.index if str(name).startswith("on ")),
    ]  # fmt: skip
    return [*texts, *([number(row.of_optimum)] if "of_optimum" in row else [])]


def number(ratio: float) -> str:
    """A ratio in three digits; a cross for a failure."""
    return f"{ratio:.3g}" if math.isfinite(ratio) else CROSS


def _heat(made: pd.DataFrame, laws: Sequence[str]) -> Iterator[tuple[str, list[Any]]]:
    """For every vessel the rows of its table: task, condition, a cell a law, least IAE."""
    for vessel, cases in made.groupby("vessel", sort=False):
        rows = [
            (task, condition, _cells(case, laws), _least(case))
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


def _least(case: pd.DataFrame) -> list[str]:
    """IAE of the best law, and of the optimum where the table has it."""
    good = case.iae[case.status == "finished"]
    optimum = case.optimum.iloc[0] if "optimum" in case else None
    numbers = [good.min() if len(good) else math.inf, *([] if optimum is None else [optimum])]
    return [f"{iae:.4g}" if math.isfinite(iae) else CROSS for iae in numbers]
