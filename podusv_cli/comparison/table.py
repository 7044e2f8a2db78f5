"""The comparison table: every metric, the best marked, ratios to the first run."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping
from typing import NamedTuple

import pandas as pd

from podusv_cli.core import escaping, quantities
from podusv_cli.metrics.metric import Metric
from podusv_cli.metrics.table import CLOCKED, METRICS
from podusv_cli.storage import csv_files

METRIC = "metric"
HEAD = ("", "unit")  # before the runs
LAST = "name"  # of a metric in claims and in comparison.csv, after the runs
NOTE = (
    "* smallest of its row among the runs that end at their target, except for measured times and, "
    "where a law keeps a standoff, for numbers that contain it; in brackets the ratio to the first "
    "run; - not defined, or the run did not finish"
)
PACKAGES = "% needs \\usepackage{booktabs}; numbers stand in two columns each, cut at their point"
NUMBER = re.compile(r"(-?\d+)(\.\d+)?(?:e([+-]\d+))?")
Names = Collection[str]


class Row(NamedTuple):
    """A metric's row: the metric, and for every run number and ratio to the first run."""

    metric: Metric
    texts: list[str]


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


def rows(
    frame: pd.DataFrame, known: Mapping[str, Metric] = METRICS, unsettled: Names = ()
) -> list[Row]:
    """All rows, those that a reader sees first before the others; best numbers marked with *.

    `unsettled` are the runs that do not end at their target; they are never the best.
    """
    found, unranked = [], _unranked(frame, known)
    whole = frame.notna().any()  # a run that did not finish has no metric
    for name, numbers in frame.iterrows():
        best = math.nan if name in unranked else numbers.drop(list(unsettled)).min()
        first, metric = numbers.iloc[0], known[str(name)]
        never = numbers.index[whole & numbers.isna()] if metric.happens else ()
        texts = [
            "never" if label in never else "no limit" if metric.margin and math.isinf(number) else
            _cell(number, first, math.nan if label in unsettled else best, i)
            for i, (label, number) in enumerate(numbers.items())
        ]  # fmt: skip
        found.append(Row(metric, texts))
    return sorted(found, key=lambda row: not row.metric.headline)


def cells(
    frame: pd.DataFrame, known: Mapping[str, Metric] = METRICS, unsettled: Names = ()
) -> list[list[str]]:
    """The rows as text: what the metric is, unit, a text a run, and the metric's name."""
    return [
        [metric.row, metric.unit, *texts, metric.name]
        for metric, texts in rows(frame, known, unsettled)
    ]


def head(frame: pd.DataFrame) -> list[str]:
    """What stands above the `cells`."""
    return [*HEAD, *map(str, frame.columns), LAST]


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
    texts = (
        [escaping.markdown_cell(words), *numbers, escaping.markdown_code(name)]
        for words, *numbers, name in cells(frame, known, unsettled)
    )
    top = [escaping.markdown_cell(label) for label in head(frame)]
    lines = [top, ["---", "---", *["---:"] * len(frame.columns), "---"], *texts]
    return (
        "\n".join("| " + " | ".join(line) + " |" for line in lines)
        + f"\n\n{NOTE}\n"
        + ("\n".join(["", *failures, ""]) if failures else "")
    )


def as_latex(
    frame: pd.DataFrame, known: Mapping[str, Metric] = METRICS, unsettled: Names = ()
) -> str:
    """The table in LaTeX: symbols or words, decimal points aligned, the best of a row in bold.

    Every number takes two columns, before and from its decimal point on; a run but the first has a
    third with the ratio to the first.
    """
    spans = [2, *[3] * (len(frame.columns) - 1)]
    labels = (
        rf"\multicolumn{{{span}}}{{c}}{{{escaping.latex(str(label))}}}"
        for span, label in zip(spans, frame.columns, strict=True)
    )
    lines = [" & ".join([*HEAD, *labels])]
    for metric, texts in rows(frame, known, unsettled):
        shown = f"${metric.symbol}$" if metric.symbol else escaping.latex(metric.row)
        parts = [part for span, text in zip(spans, texts, strict=True) for part in _cut(text, span)]
        lines.append(" & ".join([shown, quantities.raised(metric.unit), *parts]))
    columns = "ll" + "".join("r@{}l" if span == 2 else "r@{}l@{ }r" for span in spans)
    top, *body = (rf"{line} \\" for line in lines)
    opening = [PACKAGES, rf"\begin{{tabular}}{{{columns}}}", r"\toprule", top, r"\midrule"]
    return "\n".join([*opening, *body, r"\bottomrule", r"\end{tabular}", ""])


def _cut(text: str, span: int) -> list[str]:
    """A cell in so many parts: up to the decimal point, the rest of the number, the ratio."""
    number, _, ratio = text.partition(" ")
    whole, point, power = _parts(number.removesuffix("*"))
    cut = [whole, point + power]
    if number.endswith("*"):
        bold = r"\boldmath " if power else ""
        cut = [part and rf"\textbf{{{bold}{part}}}" for part in cut]
    ratio = ratio and f"({''.join(_parts(ratio.strip('()')))})"
    return [*cut, *([ratio] if span > 2 else [])]


def _parts(number: str) -> tuple[str, str, str]:
    """A number before and from its decimal point, and its power of ten; words are all before."""
    found = NUMBER.fullmatch(number)
    if not found:
        return number, "", ""
    whole, point, power = found.groups("")
    return whole, point, rf"$\times10^{{{int(power)}}}$" if power else ""
