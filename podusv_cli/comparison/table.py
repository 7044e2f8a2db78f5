"""The comparison table: every metric, the best marked, ratios to the first run."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping

import pandas as pd

from podusv_cli.core import escaping, quantities
from podusv_cli.metrics.metric import Metric
from podusv_cli.metrics.table import CLOCKED, METRICS
from podusv_cli.storage import csv_files

METRIC = "metric"
NOTE = (
    "* smallest of its row among the runs that end at their target, except for measured times and, "
    "where a law keeps a standoff, for numbers that contain it; in brackets the ratio to the first "
    "run; - not defined, or the run did not finish"
)
Names = Collection[str]


def table(
    metrics: Mapping[str, Mapping[str, float]], known: Mapping[str, Metric] = METRICS
) -> pd.DataFrame:
    """Metrics by label as a table: one row per metric that is known, one column per run."""
    names = [name for name in known if any(name in numbers for numbers in metrics.values())]
    rows = {name: [numbers.get(name, math.nan) for numbers in metrics.values()] for name in names}
    frame = pd.DataFrame.from_dict(rows, orient="index", columns=list(metrics), dtype=float)
    return frame.rename_axis(METRIC)


def numbers(frame: pd.DataFrame) -> dict[str, dict[str, float | None]]:
    """The table as plain data: numbers (or None) by metric and run."""
    return {
        str(name): {str(label): None if math.isnan(x) else float(x) for label, x in row.items()}
        for name, row in frame.iterrows()
    }


def with_ratios(frame: pd.DataFrame, known: Mapping[str, Metric] = METRICS) -> pd.DataFrame:
    """The table with units, and a column of ratios to the first run for each further run."""
    first = frame.columns[0]
    full = frame.copy()
    full.insert(0, "unit", [known[name].unit for name in frame.index])
    for label in frame.columns[1:]:
        full[f"{label}/{first}"] = frame[label] / frame[first].where(frame[first] != 0)
    return full


def as_csv(frame: pd.DataFrame, known: Mapping[str, Metric] = METRICS) -> str:
    """The table as CSV, in full precision, with ratios last."""
    return csv_files.text(with_ratios(frame, known).reset_index())


def cells(
    frame: pd.DataFrame, known: Mapping[str, Metric] = METRICS, unsettled: Names = ()
) -> list[list[str]]:
    """Rows of text: metric, unit, then number and ratio to the first run; best marked with *.

    `unsettled` are the runs that do not end at their target; they are never the best.
    """
    rows, unranked = [], _unranked(frame, known)
    for name, numbers in frame.iterrows():
        best = math.nan if name in unranked else numbers.drop(list(unsettled)).min()
        first = numbers.iloc[0]
        texts = [
            _cell(number, first, math.nan if label in unsettled else best, i)
            for i, (label, number) in enumerate(numbers.items())
        ]
        rows.append([str(name), known[str(name)].unit, *texts])
    return rows


def _unranked(frame: pd.DataFrame, known: Mapping[str, Metric] = METRICS) -> list[str]:
    """Metrics in which no run is marked best.

    Measured times vary. Where a law keeps a standoff, being nearer to the target is not better.
    Smaller margins are worse.
    """
    has_both = {"iae", "iae_e"} <= set(frame.index)
    standoff = has_both and bool((frame.loc["iae"].gt(frame.loc["iae_e"])).any())
    return [
        name
        for name in frame.index
        if name in CLOCKED or known[name].margin or (standoff and known[name].counts_standoff)
    ]


def leaders(
    frame: pd.DataFrame, known: Mapping[str, Metric] = METRICS, unsettled: Names = ()
) -> dict[str, list[str]]:
    """The metrics in which each run is best; equal numbers and measured times rank nobody.

    Neither do `unsettled` runs, which do not end at their target.
    """
    ranked = frame.drop(index=_unranked(frame, known), columns=list(unsettled))
    best: dict[str, list[str]] = {str(label): [] for label in ranked.columns}
    for name, numbers in ranked.iterrows():
        shown = numbers.dropna().map(_shown)
        if shown.nunique() > 1:
            for label in shown.index[shown == _shown(numbers.min())]:
                best[str(label)].append(str(name))
    return best


def _shown(number: float) -> str:
    """As readers see it; numbers are compared as printed."""
    return f"{number:.5g}"


def _cell(number: float, first: float, best: float, position: int) -> str:
    if math.isnan(number):
        return "-"
    mark = "*" if _shown(number) == _shown(best) else ""
    ratio = f" ({number / first:.3g})" if position and first and math.isfinite(first) else ""
    return f"{_shown(number)}{mark}{ratio}"


def as_markdown(
    frame: pd.DataFrame, endings: Mapping[str, str], known: Mapping[str, Metric] = METRICS,
    unsettled: Names = (),
) -> str:  # fmt: skip
    """The table in Markdown, followed by the reasons why runs did not finish."""
    last = {label: ending.strip().splitlines()[-1:] for label, ending in endings.items()}
    failures = [
        f"- {escaping.markdown(label)}: {escaping.markdown(line)}"
        for label, lines in last.items()
        for line in lines
    ]
    head = ["metric", "unit", *(escaping.markdown_cell(str(label)) for label in frame.columns)]
    lines = [head, ["---", "---", *["---:"] * len(frame.columns)], *cells(frame, known, unsettled)]
    return (
        "\n".join("| " + " | ".join(line) + " |" for line in lines)
        + f"\n\n{NOTE}\n"
        + ("\n".join(["", *failures, ""]) if failures else "")
    )


def as_latex(
    frame: pd.DataFrame, known: Mapping[str, Metric] = METRICS, unsettled: Names = ()
) -> str:
    """The table in LaTeX (booktabs): symbols where metrics have one, the best of a row in bold."""
    head = ["metric", "unit", *map(str, frame.columns)]
    body = [[escaping.latex(cell) for cell in head]]
    for name, unit, *numbers in cells(frame, known, unsettled):
        symbol = known[name].symbol
        shown = f"${symbol}$" if symbol else escaping.latex(name)
        body.append([shown, quantities.raised(unit), *map(_marked, numbers)])
    lines = [" & ".join(row) + r" \\" for row in body]
    columns = "ll" + "r" * len(frame.columns)
    opening = [rf"\begin{{tabular}}{{{columns}}}", r"\toprule", lines[0], r"\midrule"]
    return "\n".join([*opening, *lines[1:], r"\bottomrule", r"\end{tabular}", ""])


def _marked(cell: str) -> str:
    """A cell with powers of ten as formulas, which are bold with a number marked as the best."""
    powers = re.sub(r"e([+-]\d+)", lambda found: rf"$\times10^{{{int(found[1])}}}$", cell)
    number, marked, ratio = powers.partition("*")
    bold = r"\boldmath " if "$" in number else ""
    return rf"\textbf{{{bold}{number}}}{ratio}" if marked else number
