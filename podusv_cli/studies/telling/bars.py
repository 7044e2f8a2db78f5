"""Intervals of a claim's statistics as bars and in words, beside the bound of the claim."""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator
from typing import NamedTuple

from podusv_cli.studies.counting.claims import Link, ParsedStudyClaim
from podusv_cli.studies.counting.samples import FAILURES, SHARE
from podusv_cli.studies.counting.statistics import Interval, digits
from podusv_cli.studies.counting.verdict import Statistic, StudyVerdict

SIGNS: dict[type[ast.cmpop], str] = {
    ast.Lt: "below",
    ast.LtE: "at most",
    ast.Gt: "above",
    ast.GtE: "at least",
}
UPWARD = (ast.Gt, ast.GtE)
FORMS = {False: ".4g", True: ".3g%"}  # of shares
MARGIN = 0.12  # of an axis beyond what is on it


class Bar(NamedTuple):
    """A bar; places in percent of its width, `None` for an estimate beyond the axis.

    `asked` is the stretch where the comparison holds. An open end runs to the edge.
    """

    words: str
    low: float
    high: float
    estimate: float | None
    bound: float
    asked: tuple[float, float]
    ends: tuple[str, str]


def bars(claim: ParsedStudyClaim, verdict: StudyVerdict) -> Iterator[Bar]:
    """A bar for each comparison of a claim in each cell."""
    for link in claim.parsed.links:
        for part in verdict.parts:
            if part.statistic == link.text and part.n:
                yield _bar(link, part)


def _bar(link: Link, part: Statistic) -> Bar:
    """The bar of one statistic beside the bound of its comparison.

    Its places are in percent of the axis.
    """
    shares = isinstance(link.call.func, ast.Name) and link.call.func.id in (SHARE, FAILURES)
    first, last = _axis(link, part, shares=shares)

    def place(number: float) -> float:
        """Where a number lies along the axis [%]; beyond the ends, at the end."""
        return round(100.0 * (min(max(number, first), last) - first) / (last - first), 2)

    bound = place(link.bound)
    asked = (bound, 100.0) if isinstance(link.sign, UPWARD) else (0.0, bound)
    estimate = place(part.estimate) if math.isfinite(part.estimate) else None
    ends = [f"{Interval(end, math.nan, math.nan):{FORMS[shares]}}" for end in (first, last)]
    words = _words(link, part, shares=shares)
    return Bar(words, place(part.low), place(part.high), estimate, bound, asked, (ends[0], ends[1]))


def _axis(link: Link, part: Statistic, *, shares: bool) -> tuple[float, float]:
    """The ends of an axis with bound and interval on it, and some room; shares end at 0 and 1.

    `link` has the bound, `part` is the statistic with its interval.
    """
    ends = [n for n in (part.low, part.high, part.estimate, link.bound) if math.isfinite(n)]
    low, high = min(ends), max(ends)
    # Where all of them are one number, a tenth of it, or 1 around zero.
    room = MARGIN * (high - low) or 0.1 * abs(high) or 1.0
    low, high = low - room, high + room
    return (max(low, 0.0), min(high, 1.0)) if shares else (low, high)


def _words(link: Link, part: Statistic, *, shares: bool) -> str:
    """A number of a claim, its interval, and the bound that it is compared with."""
    at = f" at {part.cell}" if part.cell else ""
    interval = Interval(part.estimate, part.low, part.high).text(FORMS[shares])
    bound = digits(link.bound * (100.0 if shares else 1.0), ".4g") + (" %" if shares else "")
    return f"{link.text}{at}: {interval}; compared with: {SIGNS[type(link.sign)]} {bound}"
