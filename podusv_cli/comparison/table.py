"""The comparison table: every metric, the best marked, ratios to the first run."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from podusv_cli.core import escaping, quantities
from podusv_cli.core.about import MetricAbout
from podusv_cli.metrics.table import CLOCKED, METRICS
from podusv_cli.storage import csv_files

if TYPE_CHECKING:
    import pandas as pd

METRIC = "metric"
END = "path_time"  # the metric that says when a path was over
HEAD = ("", "unit")  # before the runs
LAST = "name"  # of a metric in claims and in comparison.csv, after the runs
RANKED = (
    "* smallest of its row among the runs that end at their target, except for measured times and, "
    "where a law keeps a standoff, for numbers that contain it; in brackets the ratio to the first "
    "run; "
)
UNDEFINED = (
    "- not defined, or the run did not finish, or it was made before: times that were measured at "
    "another time do not compare"
)
DIGITS = 5  # of a number
FEW = 3  # where there is room for the numbers alone
PACKAGES = (
    "% needs \\usepackage{booktabs,graphicx,tabularx}; numbers stand in two columns each, cut at "
    "their point"
)
# As wide as the line, in table* the page: words are broken, and all is smaller where numbers alone
# are wider.
FITTED = r"\resizebox{\linewidth}{!}{\setlength{\tabcolsep}{0.4em}%"
SMALL = 2  # a number of this power of ten below 1, or of FEW above it, has more than FEW digits
WORDS, BETWEEN, CHARACTER = 7.5, 0.8, 0.52  # em: least width of words, of a gap, of a character
POWER = 5  # characters of a power of ten
LABEL = 10  # characters; a longer label is broken at its underscores
NUMBER = re.compile(r"(-?\d+)(\.\d+)?(?:e([+-]\d+))?")
Names = Collection[str]


class MetricRow(NamedTuple):
    """A metric's row: the metric, and for every run number and ratio to the first run."""

    metric: MetricAbout
    texts: list[str]


class Scaled(NamedTuple):
    """A row whose numbers are to be multiplied by a power of ten."""

    metric: MetricAbout
    texts: list[str]
    power: int


@dataclass(frozen=True)
class MetricTable:
    """A number for every metric (`rows`, by name) and run (`columns`), NaN where there is none."""

    columns: tuple[str, ...]
    rows: Mapping[str, tuple[float, ...]]

    def of(self, label: str) -> dict[str, float]:
        """The numbers of a run, by metric."""
        place = self.columns.index(label)
        return {name: numbers[place] for name, numbers in self.rows.items()}

    def only(self, names: Collection[str]) -> MetricTable:
        """The table of these metrics alone."""
        return MetricTable(self.columns, {n: row for n, row in self.rows.items() if n in names})

    @property
    def finished(self) -> list[bool]:
        """Which runs have any number; a run that did not finish has none."""
        return [any(not math.isnan(x) for x in self.of(label).values()) for label in self.columns]

    def frame(self) -> pd.DataFrame:
        """The table as pandas has it, for Python and notebooks."""
        import pandas as pd  # slow to import

        frame = pd.DataFrame.from_dict(
            dict(self.rows), orient="index", columns=list(self.columns), dtype=float
        )
        return frame.rename_axis(METRIC)


def table(
    metrics: Mapping[str, Mapping[str, float]], known: Mapping[str, MetricAbout] = METRICS
) -> MetricTable:
    """Metrics by label as a table: one row per metric that is known, one column per run."""
    names = [name for name in known if any(name in numbers for numbers in metrics.values())]
    rows = {
        name: tuple(float(numbers.get(name, math.nan)) for numbers in metrics.values())
        for name in names
    }
    return MetricTable(tuple(metrics), rows)


def numbers(frame: MetricTable) -> dict[str, dict[str, float | None]]:
    """The table as plain data: numbers (or None) by metric and run."""
    return {
        name: {
            label: None if math.isnan(x) else x for label, x in zip(frame.columns, row, strict=True)
        }
        for name, row in frame.rows.items()
    }


def as_csv(frame: MetricTable, known: Mapping[str, MetricAbout] = METRICS) -> str:
    """The table as CSV, in full precision, with ratios to the first run last."""
    first = frame.columns[0]
    heads = [METRIC, "unit", *frame.columns, *(f"{column}/{first}" for column in frame.columns[1:])]
    lines = (
        [name, known[name].unit, *map(_blank, [*row, *(_ratio(x, row[0]) for x in row[1:])])]
        for name, row in frame.rows.items()
    )
    return csv_files.lines([heads, *lines])


def _blank(number: float) -> float | str:
    """The number, and an empty cell where there is none."""
    return "" if math.isnan(number) else number


def _ratio(number: float, first: float) -> float:
    return number / first if first else math.nan


def window(frame: MetricTable) -> str:
    """Up to when the numbers of each run count, as a sentence; empty where no path has ended."""
    ends = dict(zip(frame.columns, frame.rows.get(END, ()), strict=False))
    over = {label: f"{time:.5g} s" for label, time in ends.items() if not math.isnan(time)}
    if not over:
        return ""
    times = next(iter(over.values())) if len(ends) == 1 else ", ".join(map(" ".join, over.items()))
    numbers = dict(zip(frame.columns, zip(*frame.rows.values(), strict=True), strict=True))
    others = ", ".join(  # without a log, which has no number of its own
        label
        for label, own in numbers.items()
        if label not in over and not all(map(math.isnan, own))
    )
    return f"numbers up to the end of the path: {times}" + (
        f"; of the whole run: {others}" if others else ""
    )


def note(frame: MetricTable) -> str:
    """What the marks of the table mean; a run by itself is not ranked."""
    return f"{RANKED if len(frame.columns) > 1 else ''}{UNDEFINED}"


def rows(
    frame: MetricTable,
    known: Mapping[str, MetricAbout] = METRICS,
    unsettled: Names = (),
    *,
    chosen: Sequence[str] = (),
    brief: bool = False,
    ratios: bool = True,
) -> list[MetricRow]:
    """The rows of the metrics `chosen`, in this order; best numbers marked with *.

    None chosen: all, those that a reader sees first before the others. `unsettled` are the runs
    that do not end at their target; they are never the best, and neither is a run by itself.
    `brief` numbers have FEW digits. `ratios` says whether those to the first run are added.
    """
    of_metrics = dict[str, MetricRow]()
    unranked, finished = _metrics_without_best(frame, known), frame.finished
    out, is_ranked = [label in unsettled for label in frame.columns], len(frame.columns) > 1
    for name, numbers in frame.rows.items():
        ranked = [x for x, off in zip(numbers, out, strict=True) if not (off or math.isnan(x))]
        best = min(ranked, default=math.nan) if name not in unranked and is_ranked else math.nan
        first, metric = numbers[0], known[name]
        texts = [
            metric.undefined_word
            if metric.happens and finished[i] and math.isnan(number)
            else "no limit"
            if metric.margin and math.isinf(number)
            else _cell(
                number,
                first if i and ratios else math.nan,
                math.nan if out[i] else best,
                FEW if brief else DIGITS,
            )
            for i, number in enumerate(numbers)
        ]
        of_metrics[name] = MetricRow(metric, texts)
    first_read = sorted(of_metrics, key=lambda name: not known[name].headline)
    return [of_metrics[name] for name in chosen or first_read if name in of_metrics]


def cells(
    frame: MetricTable,
    known: Mapping[str, MetricAbout] = METRICS,
    unsettled: Names = (),
    *,
    chosen: Sequence[str] = (),
) -> list[list[str]]:
    """The `rows` as text: what the metric is, unit, a text a run, and the metric's name.

    The arguments are those of `rows`.
    """
    return [
        [metric.row, metric.unit, *texts, metric.name]
        for metric, texts in rows(frame, known, unsettled, chosen=chosen)
    ]


def head(frame: MetricTable) -> list[str]:
    """What stands above the `cells`."""
    return [*HEAD, *frame.columns, LAST]


def _metrics_without_best(
    frame: MetricTable, known: Mapping[str, MetricAbout] = METRICS
) -> list[str]:
    """Metrics in which no run is marked best; `known` describes the metrics by name.

    Measured times vary. Where a law keeps a standoff, being nearer to the target is not better.
    Larger margins are better, and the least number is marked.
    """
    both = zip(frame.rows.get("iae", ()), frame.rows.get("iae_e", ()), strict=False)
    # iae integrates |z_e|, iae_e |z_e - standoff|: without a standoff they have the same bits. Of a
    # law that stays within half its standoff iae_e is larger. NaN is neither above nor below.
    standoff = any(iae < iae_e or iae > iae_e for iae, iae_e in both)
    return [
        name
        for name in frame.rows
        if name in CLOCKED or known[name].margin or (standoff and known[name].counts_standoff)
    ]


def leaders(
    frame: MetricTable, known: Mapping[str, MetricAbout] = METRICS, unsettled: Names = ()
) -> dict[str, list[str]]:
    """The metrics in which each run is best, by label.

    Equal numbers and measured times make no run the best. Numbers are compared as printed.
    `unsettled` runs, which do not end at their target, are left out.
    """
    unranked = _metrics_without_best(frame, known)
    best: dict[str, list[str]] = {column: [] for column in frame.columns if column not in unsettled}
    for name, numbers in frame.rows.items():
        paired = zip(frame.columns, numbers, strict=True)
        ranked = {label: x for label, x in paired if label in best and not math.isnan(x)}
        shown = {label: _format_number(x) for label, x in ranked.items()}
        if name not in unranked and len({*shown.values()}) > 1:
            least = _format_number(min(ranked.values()))
            for label in (label for label, text in shown.items() if text == least):
                best[label].append(name)
    return best


def _format_number(number: float, digits: int = DIGITS) -> str:
    """As readers see it; numbers are compared as printed. FEW digits are all there, zeros too."""
    if digits == FEW and number:
        return f"{number:#.{digits}g}".removesuffix(".")
    return f"{number:.{digits}g}"


def _cell(number: float, first: float, best: float, digits: int) -> str:
    """A number with `*` where it prints like the `best` one, and its ratio to the `first` run's.

    NaN for `best` or `first` gives no mark or no ratio.
    """
    if math.isnan(number):
        return "-"
    shown = _format_number(number, digits)
    mark = "*" if shown == _format_number(best, digits) else ""
    ratio = f" ({number / first:.3g})" if first and math.isfinite(first) else ""
    return f"{shown}{mark}{ratio}"


def as_markdown(
    frame: MetricTable,
    endings: Mapping[str, str],
    known: Mapping[str, MetricAbout] = METRICS,
    unsettled: Names = (),
    *,
    chosen: Sequence[str] = (),
) -> str:
    """The table in Markdown, followed by the reasons why runs did not finish (`endings`)."""
    # The last line of a traceback says what is wrong.
    last = {label: ending.strip().splitlines()[-1:] for label, ending in endings.items()}
    failures = [
        f"- {escaping.markdown(label)}: {escaping.markdown(line)}"
        for label, lines in last.items()
        for line in lines
    ]
    texts = (
        [escaping.markdown_cell(words), *numbers, escaping.markdown_code(name)]
        for words, *numbers, name in cells(frame, known, unsettled, chosen=chosen)
    )
    top = [escaping.markdown_cell(label) for label in head(frame)]
    lines = [top, ["---", "---", *["---:"] * len(frame.columns), "---"], *texts]
    return (
        "\n".join("| " + " | ".join(line) + " |" for line in lines)
        + f"\n\n{'; '.join(filter(None, (note(frame), escaping.markdown(window(frame)))))}\n"
        + ("\n".join(["", *failures, ""]) if failures else "")
    )


def as_latex(
    frame: MetricTable,
    known: Mapping[str, MetricAbout] = METRICS,
    unsettled: Names = (),
    *,
    chosen: Sequence[str] = (),
    ratios: bool = False,
) -> str:
    """The table in LaTeX, as wide as the column, or in `table*` the page.

    Symbols or words, numbers of FEW digits with their decimal points aligned, the best of a row in
    bold, ratios to the first run in brackets. Every number takes two columns, before and from its
    decimal point on.
    """
    shown = [
        _of_a_power(row)
        for row in rows(frame, known, unsettled, chosen=chosen, brief=True, ratios=ratios)
    ]
    heads = [_break_label(label) for label in frame.columns]
    lines = [[*HEAD, *(rf"\multicolumn{{2}}{{c}}{{{_stack_lines(head)}}}" for head in heads)]]
    for metric, texts, power in shown:
        words = f"${metric.symbol}$" if metric.symbol else escaping.latex(metric.row)
        parts = [part for text in texts for part in _cut(text)]
        unit = [rf"$10^{{{power}}}$"] if power else []
        if not power or metric.unit != "1":
            unit.append(quantities.raise_powers(metric.unit))
        lines.append([words, " ".join(unit), *parts])
    top, *body = (" & ".join(cells) + r" \\" for cells in lines)
    width = _least_width(heads, shown)
    wide = rf"\ifdim\linewidth<{width:.1f}em {width:.1f}em\else\linewidth\fi"
    columns = r"@{}>{\raggedright\arraybackslash}Xl" + "r@{}l" * len(heads) + "@{}"
    opening = [PACKAGES, FITTED, rf"\begin{{tabularx}}{{{wide}}}{{{columns}}}", r"\toprule"]
    return "\n".join([*opening, top, r"\midrule", *body, r"\bottomrule", r"\end{tabularx}}", ""])


def _of_a_power(row: MetricRow) -> Scaled:
    """A row of large or small numbers as multiples of a power of ten, which its unit then has.

    Rows that print in FEW digits anyway, or that span too many powers, stay as they are.
    """
    numbers = [float(match[0]) for text in row.texts if (match := NUMBER.match(text))]
    powers = [math.floor(math.log10(abs(number))) for number in numbers if number]
    power = min(powers, default=0)
    if (max(powers, default=0) > -SMALL and power < FEW) or max(powers) - power >= FEW:
        return Scaled(*row, 0)
    texts = [
        NUMBER.sub(lambda own: _format_number(float(own[0]) / 10.0**power, FEW), text, count=1)
        for text in row.texts
    ]
    return Scaled(row.metric, texts, power)


def _least_width(heads: Sequence[Sequence[str]], shown: Sequence[Scaled]) -> float:
    """About the width [em] that the columns take where words are broken.

    `heads` are the lines of each label, `shown` the rows.
    """
    lengths = max((len(own.metric.unit) + POWER * bool(own.power) for own in shown), default=0)
    for place, head in enumerate(heads):
        sides = zip(*(_lengths(own.texts[place]) for own in shown), strict=True)
        lengths += max(sum(map(max, sides)), *map(len, head))
    return WORDS + BETWEEN * (1 + len(heads)) + CHARACTER * lengths


def _lengths(text: str) -> tuple[int, int]:
    """Characters of a number before and from its decimal point on, with its ratio."""
    number, _, ratio = text.partition(" (")
    whole, point, power = _parts(number.removesuffix("*"))
    return len(whole), len(point) + POWER * bool(power) + len(ratio)


def _break_label(label: str) -> list[str]:
    """A label in lines, broken behind underscores."""
    lines = textwrap.wrap(label.replace("_", "_ "), LABEL, break_long_words=False)
    return [line.replace("_ ", "_") for line in lines] or [label]


def _stack_lines(lines: Sequence[str]) -> str:
    stack = r"\\".join(map(escaping.latex, lines))
    return rf"\shortstack{{{stack}}}" if len(lines) > 1 else stack


def _cut(text: str) -> list[str]:
    """A number up to its decimal point, and the rest with the ratio.

    Both are bold where the number is marked best.
    """
    number, _, ratio = text.partition(" (")
    whole, point, power = _parts(number.removesuffix("*"))
    cut = [whole, point + power]
    if number.endswith("*"):
        bold = r"\boldmath " if power else ""
        cut = [part and rf"\textbf{{{bold}{part}}}" for part in cut]
    return [cut[0], f"{cut[1]}~({ratio}" if ratio else cut[1]]


def _parts(number: str) -> tuple[str, str, str]:
    """A number before and from its decimal point, and its power of ten; words are all before."""
    match = NUMBER.fullmatch(number)
    if not match:
        return number, "", ""
    whole, point, power = match.groups("")
    return whole, point, rf"$\times10^{{{int(power)}}}$" if power else ""
