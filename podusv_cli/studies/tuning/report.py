"""The HTML report of a search: one file that needs nothing else, the answer first."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from podusv_cli.core.phrases import value_text
from podusv_cli.pages.page import Picture, environment, flat
from podusv_cli.process.extras import Failure
from podusv_cli.scenario.words import in_words
from podusv_cli.studies.counting.statistics import Interval, digits
from podusv_cli.studies.making.sessions import sessions
from podusv_cli.studies.tuning.remarks import remarks
from podusv_cli.studies.tuning.results import SearchResults
from podusv_cli.studies.tuning.space import units_of

FEW = 15  # pairs that are shown at once


def page(
    folder: Path, results: SearchResults, figures: Sequence[Picture], missing: Sequence[Failure]
) -> str:
    """The whole report as HTML.

    `folder` is that of the search, `missing` what could not be drawn or written.
    """
    plan = results.plan
    assert plan.scenario.sweep
    numbered = [*enumerate(figures, 1)]
    return (
        environment("podusv_cli.studies.tuning")
        .get_template("tune.html.j2")
        .render(
            title=f"{plan.scenario.name}: gains",
            folder=folder,
            scenario=plan.scenario,
            sweep=plan.scenario.sweep,
            tune=plan.tune,
            objective=plan.tune.objective,
            laws=list(_laws(results)),
            remarks=remarks(results),
            words={name: about.row for name, about in plan.metrics.items()},
            pairs=list(_pairs(results)),
            few=FEW,
            metric=results.shown_metrics[0] if results.shown_metrics else "",
            gains=list(_gains(results)),
            varied=[
                (", ".join(quantity.targets(name)), in_words(quantity))
                for name, quantity in plan.scenario.sweep.vary.items()
            ],
            beside=numbered[:1],
            figures=numbered,
            metrics=plan.metrics,
            missing=[str(failure) for failure in missing],
            latest=[
                (key, value_text(value)) for key, value in flat((sessions(folder) or [{}])[-1])
            ],
        )
    )


def _laws(results: SearchResults) -> Iterator[dict[str, Any]]:
    """The rows of the answer, the best law after the search first."""
    keys = ["place_low", "place_high", "rank_after", "rank_before"]
    ordered: Any = results.laws.sort_values(keys).to_dict("records")
    for row in ordered:
        yield row | {
            "before": intervals(row, "before"),
            "after": intervals(row, "after"),
            "failed": f"{percent(row, 'failed_before')} -> {percent(row, 'failed_after')}",
            "rank": count_change(row, "rank"),
            "better": count_change(row, "better_than"),
            "change": ratio(row) if row["runs"] else "-",
            "spread": spread(row),
            "place": place(row),
        }


def count_change(row: Any, name: str) -> str:
    """A count before and after; a dash for a law that is not ranked."""
    return " -> ".join(
        "-" if pd.isna(row[f"{name}_{when}"]) else f"{row[f'{name}_{when}']}"
        for when in ("before", "after")
    )


def intervals(row: Any, when: str) -> str:
    """The objective with its interval."""
    return f"{Interval.of(row, f'objective_{when}')}"


def percent(row: Any, name: str) -> str:
    """A share."""
    return f"{100.0 * row[name]:.3g} %"


def ratio(row: Any) -> str:
    """A median ratio with its interval."""
    return f"{Interval.of(row, 'ratio'):.3f}"


def spread(row: Any) -> str:
    """The objective of the searches' winners: median (least to largest).

    `row` is one of the answer's table. A dash for a single search.
    """
    middle, low, high = (row[f"repeats_{end}"] for end in ("median", "low", "high"))
    if math.isnan(low) or low == high:
        return "-"
    return f"{digits(middle)} ({digits(low)} to {digits(high)})"


def place(row: Any) -> str:
    """The ranks that the law may have, from the best to the worst; a dash where they are unknown.

    `row` is one of the answer's table.
    """
    low, high = row["place_low"], row["place_high"]
    if math.isnan(low):
        return "-"
    return f"{low:.0f}" if low == high else f"{low:.0f} to {high:.0f}"


def _pairs(results: SearchResults) -> Iterator[dict[str, Any]]:
    """Every pair of laws with its numbers before and after, for the first metric."""
    table = results.pairs
    table = table[table.metric.isin(results.shown_metrics[:1])]
    by = {when: rows.to_dict("records") for when, rows in table.groupby("when")}
    for before, after in zip(by.get("before", ()), by.get("after", ()), strict=True):
        yield {
            "a": before["a"],
            "b": before["b"],
            "before": ratio(before),
            "after": ratio(after),
            "wins": [f"{100 * pair['a_wins']:.3g} %" for pair in (before, after)],
            "losses": [f"{100 * pair['b_wins']:.3g} %" for pair in (before, after)],
            "turned": _order_change(before, after),
        }


def _order_change(before: Any, after: Any) -> str:
    """Which law overtakes the other by the search, with both intervals clear of 1; else empty.

    `before` and `after` are rows of the same pair.
    """
    if before["ratio_low"] > 1.0 > after["ratio_high"]:
        return f"{before['a']} overtakes"
    if before["ratio_high"] < 1.0 < after["ratio_low"]:
        return f"{before['b']} overtakes"
    return ""


def _gains(results: SearchResults) -> Iterator[dict[str, Any]]:
    """The rows of the report's table of gains, as text."""
    units = {law: units_of(own) for law, own in results.plan.laws.items()}
    share = results.importance.set_index(["law", "gain"]) if len(results.importance) else None
    rows: Any = results.gains.to_dict("records")
    for row in rows:
        at = (row["law"], row["gain"])
        text = "-"
        if share is not None and at in share.index:
            text = f"{Interval(*share.loc[at]):.0f%}"
        numbers = {name: value_text(row[name]) for name in ("before", "after")}
        numbers |= {name: _end(row[name]) for name in ("low", "high")}
        yield row | numbers | {"unit": units[row["law"]][row["gain"]], "share": text}


def _end(number: float) -> str:
    return "-" if math.isnan(number) else f"{number:.4g}"
