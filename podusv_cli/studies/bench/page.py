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
from podusv_cli.studies.bench.standing import (
    CROSS,
    PLACE,
    by_vessel,
    columns,
    digits,
    leaderboard_rows,
)

FIRST = 60  # failures that the page lists
DARKEST = 10.0  # times the best law's IAE
PALE, DARK = (236, 244, 250), (8, 64, 112)  # red, green, blue


class PageCell(NamedTuple):
    """A law in a case: what is written, on which colour, and why it failed."""

    text: str
    colour: str
    ink: str
    why: str


def page(
    made: pd.DataFrame,
    figures: Sequence[Picture],
    provenance: Mapping[str, Any],
    optima: Sequence[Least] = (),
) -> str:
    """The page as HTML.

    `made` is `standing.table` of all runs, `with_optima` where there are any.
    """
    laws = list(made.law.unique())
    failed = made[made.status != "finished"]
    counts = {f"{name}s": made[name].nunique() for name in PLACE}
    return (
        environment("podusv_cli.studies.bench")
        .get_template("bench.html.j2")
        .render(
            title=f"Bench of {len(laws)} laws",
            boards={vessel: leaderboard_rows(rows) for vessel, rows in by_vessel(made).items()},
            laws=laws,
            columns=columns(made),
            counts=counts | {"cases": len(made) // len(laws), "runs": len(made)},
            heat=list(_heat(made, laws)),
            failures=failed[[*PLACE, "law", "status", "cause"]].to_numpy().tolist()[:FIRST],
            more=max(0, len(failed) - FIRST),
            figures=figures,
            provenance=[(key, value_text(value)) for key, value in flat(provenance)],
            optima=_grids(optima) if optima else None,
        )
    )


def as_markdown(made: pd.DataFrame) -> str:
    """The leaderboard of each hull as a table below its name."""
    tables = (f"### {vessel}\n\n{_table(rows)}" for vessel, rows in by_vessel(made).items())
    return "\n".join(tables)


def _table(made: pd.DataFrame) -> str:
    """The leaderboard of one vessel as a table in Markdown; `made` has its rows."""
    head, *rows = leaderboard_rows(made)
    lines = [head, *([markdown(law), *texts] for law, *texts in rows)]
    joined = [f"| {' | '.join(line)} |\n" for line in lines]
    return f"{joined[0]}|{'---|' * len(head)}\n{''.join(joined[1:])}"


def _grids(optima: Sequence[Least]) -> dict[str, Any]:
    """What the page says of the optima.

    These are the coarsest of the finest steps [s], the most that a finest grid changed the IAE [m
    s], and the number of cases.
    """
    return {
        "step": f"{max(optimum.step for optimum in optima):.2g}",
        "lowered": f"{max(abs(optimum.lowered) for optimum in optima):.1g}",
        "count": sum(len(optimum.places) for optimum in optima),
    }


def _heat(made: pd.DataFrame, laws: Sequence[str]) -> Iterator[tuple[str, list[Any]]]:
    """For every vessel the rows of its heat map: task, condition, a cell a law, IAE of `_least`."""
    for vessel, cases in by_vessel(made).items():
        rows = [
            (task, condition, _cells(case, laws), _least(case))
            for (task, condition), case in cases.groupby(["task", "condition"], sort=False)
        ]
        yield vessel, rows


def _cells(case: pd.DataFrame, laws: Sequence[str]) -> list[PageCell]:
    by_law = case.set_index("law")
    return [_cell(by_law.ratio[law], f"{by_law.status[law]}: {by_law.cause[law]}") for law in laws]


def _cell(ratio: float, why: str) -> PageCell:
    """A cell of the heat map for a `ratio` of IAE to the best law's.

    A failure has inf, and `why` it failed. The colour goes with the ratio's logarithm, from PALE at
    1 to DARK at DARKEST.
    """
    if not math.isfinite(ratio):
        return PageCell(CROSS, "#f6d5c3", "#7a2b00", why)
    depth = min(math.log(ratio) / math.log(DARKEST), 1.0)
    mixed = (round(p + depth * (d - p)) for p, d in zip(PALE, DARK, strict=True))
    return PageCell(digits(ratio), f"rgb{tuple(mixed)}", "#fff" if depth > 0.45 else "#1b1f24", "")


def _least(case: pd.DataFrame) -> list[str]:
    """IAE of the best law, and of the optimum where the table has it."""
    good = case.iae[case.status == "finished"]
    optimum = case.optimum.iloc[0] if "optimum" in case else None
    numbers = [good.min() if len(good) else math.inf, *([] if optimum is None else [optimum])]
    return [f"{iae:.4g}" if math.isfinite(iae) else CROSS for iae in numbers]
